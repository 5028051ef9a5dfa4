"""Steps of dicts and of data frames."""

import datetime
import math

import mirrorstats as ms
import pandas
import polars
import pyarrow
import pyarrow.parquet
import pytest
from test_study import random_rows


def test_rows_and_frames_of_every_library_are_the_same_trace(tmp_path):
    rows = random_rows(7)
    table = pyarrow.Table.from_pylist(rows)
    forms = [rows, iter(rows), table, polars.DataFrame(rows), pandas.DataFrame(rows).convert_dtypes()]
    traces = [pyarrow.parquet.read_table(ms.import_steps(form)["out"]) for form in forms]
    assert traces[0].num_rows == len(rows)
    for trace in traces[1:]:
        assert trace.equals(traces[0])


def test_what_is_wrong_is_told_by_row(tmp_path):
    rows = random_rows(7)
    out = tmp_path / "steps.parquet"
    with pytest.raises(ms.Error, match="rows, line 1, key `body_color`"):
        ms.import_steps([{**rows[0], "body_color": "Red"}], out)
    with pytest.raises(ValueError, match="not JSON compliant"):
        ms.import_steps([{**rows[0], "x": math.nan}], out)
    with pytest.raises(TypeError, match="found date"):
        ms.import_steps([{**rows[0], "day": datetime.date(2026, 1, 1)}], out)
    with pytest.raises(ms.Error, match="at least one step"):
        ms.import_steps([], out)
    assert not out.exists()


def test_what_is_known_beside_the_rows_is_declared(tmp_path):
    out = tmp_path / "steps.parquet"
    answer = ms.import_steps(random_rows(3), out, palette=["red", "green", "blue", "white"], cluster="seed")
    assert answer["out"].endswith("steps.parquet") and answer["steps"] == len(random_rows(3))
    recording = pyarrow.parquet.read_schema(out).metadata[b"mirrorstats.recording"]
    assert b'"palette"' in recording and b'"seed"' in recording
    assert not [finding for finding in ms.validate(out)["findings"] if finding["severity"] == "error"]
