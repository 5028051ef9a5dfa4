"""Steps of dicts and of data frames."""

import datetime
import math

import duckdb
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


def test_gaps_of_a_frame_are_null_and_its_whole_numbers_integers(tmp_path):
    rows = [{**row, "mirror_px": None} if at == 3 else row for at, row in enumerate(random_rows(7))]
    frame = pandas.DataFrame(rows)
    assert frame["mirror_px"].dtype == float
    forms = [rows, frame, frame.to_dict("records"), frame.assign(mirror_px=frame["mirror_px"].astype("Int64"))]
    forms += [polars.DataFrame(rows), polars.LazyFrame(rows), duckdb.sql("select * from frame")]
    traces = [pyarrow.parquet.read_table(ms.import_steps(form)["out"]) for form in forms]
    assert traces[0]["mirror_px"].null_count == 1
    for trace in traces[1:]:
        assert trace.equals(traces[0])


def test_an_error_is_reported_once_per_column_with_its_first_row_and_count(tmp_path):
    out, frame = tmp_path / "steps.parquet", pandas.DataFrame(random_rows(7))
    frame.loc[2:5, "mirror_px"] = 999
    frame["mirror_px"] = frame["mirror_px"].astype(float)
    frame.loc[[2, 5], "mirror_px"] = [0.5, 1.5]
    frame.loc[3, "body_color"] = "Red"
    with pytest.raises(ms.InputError) as raised:
        ms.import_steps(frame, out)
    first, second = str(raised.value).split("\n  help: ")[0], str(raised.value).splitlines()[2]
    assert first.startswith("row 2 (from 0), column `mirror_px`, and 1 more row: expected an integer from 0")
    assert first.endswith("found 0.5")
    assert second.startswith("row 3 (from 0), column `body_color`: expected the lower-case name of a colour, found the text `Red`")
    assert not out.exists()


def test_an_invalid_value_is_reported_by_row_and_column(tmp_path):
    rows, out = random_rows(7), tmp_path / "steps.parquet"
    with pytest.raises(ValueError, match=r"row 1 \(from 0\), column `x`: expected a finite number, found inf"):
        ms.import_steps([{**rows[0], "x": 1.0}, {**rows[1], "x": math.inf}], out)
    with pytest.raises(ms.InputError, match=r"row 1 \(from 0\), column `x`: expected a finite number"):
        ms.import_steps(polars.DataFrame(rows[:2]).with_columns(x=polars.Series([1.0, math.inf])), out)
    with pytest.raises(TypeError, match=r"row 0 \(from 0\), column `day`: .* found date"):
        ms.import_steps([{**rows[0], "day": datetime.date(2026, 1, 1)}], out)
    with pytest.raises(ms.InputError, match="at least one step"):
        ms.import_steps([], out)
    with pytest.raises(ms.OutputError, match="ends in .parquet"):
        ms.import_steps(rows, tmp_path / "steps.csv")
    assert not out.exists()


def test_a_palette_and_a_cluster_are_declared_in_the_footer(tmp_path):
    out = tmp_path / "steps.parquet"
    answer = ms.import_steps(random_rows(3), out, palette=["red", "green", "blue", "white"], cluster="seed")
    assert answer["out"].endswith("steps.parquet") and answer["steps"] == len(random_rows(3))
    recording = pyarrow.parquet.read_schema(out).metadata[b"mirrorstats.recording"]
    assert b'"palette"' in recording and b'"seed"' in recording
    assert not [finding for finding in ms.validate(out)["findings"] if finding["severity"] == "error"]
