"""Answers of a study, beside those of the command line and of the libraries that take them."""

import json
import pathlib
import random
import shutil

import duckdb
import mirrorstats as ms
import pandas
import polars
import pyarrow
import pyarrow.parquet
import pytest


def written(command, tmp_path, *words):
    """What `score -o` writes, without the labels of the design that only a file keeps."""
    command("score", *words, "-o", "scores.parquet")
    table = pyarrow.parquet.read_table(tmp_path / "scores.parquet").replace_schema_metadata(None)
    return table.drop_columns([name for name in ("body_color", "repetition") if name in table.column_names])


# The reconstructed traces hold no words, which the extended definitions read.
@pytest.mark.parametrize("fixture, definitions", [("paper", "paper"), ("recorded", "paper"), ("recorded", "extended")])
@pytest.mark.parametrize("where", [None, "experiment <> 'E2' and TSA = 1", "seed > 99"])
def test_episodes_equal_the_output_of_score(fixture, where, definitions, request, command, tmp_path):
    traces = request.getfixturevalue(fixture)
    words = [traces, "--definitions", definitions] + (["--where", where] if where else [])
    expected = written(command, tmp_path, *words)
    found = pyarrow.table(ms.open(traces, definitions=definitions, where=where).episodes)
    assert found.schema == expected.schema
    assert found.equals(expected)
    assert (found.num_rows == 0) == (where == "seed > 99")


COLORS = ["red", "green", "blue", "white"]
PIXELS = ["mirror_self_px", "mirror_other_px", "mirror_px", "direct_other_px"]
WORDS = ["view_description", "reasoning", "summary", "identification"]
TEXTS = ["a mirror", "I am red", "that is me", "another agent", "", None]
ACTIONS = ["move_forward", "move_backward", "turn_left", "turn_right"]


def random_rows(seed):
    """Whole episodes of chance decisions, the rows in any order."""
    chance = random.Random(seed)
    rows = []
    for episode in range(chance.randint(1, 12)):
        experiment, model, run = chance.choice(["E1", "E2", "E4", "E5"]), chance.choice(["a", "bé"]), episode + 1
        same = {
            "episode_id": f"{experiment}/{model}/s1/r{run}",
            "model": model,
            "experiment": experiment,
            "seed": 1,
            "run": run,
            "body_color": chance.choice(COLORS),
        }
        length = chance.randint(1, 40)
        for t in range(1, length + 1):
            is_done = t == length and chance.random() < 0.7
            rows.append(
                {
                    **same,
                    "t": t,
                    "action": "done" if is_done else chance.choice([*ACTIONS, None]),
                    "self_color": chance.choice([*COLORS, "unknown", None]),
                    "selected_cube": chance.choice([*COLORS, "none", None]),
                    "mirror_visible": chance.random() < 0.4,
                    **{name: chance.choice([0, 1, 59, 60, 200]) for name in PIXELS},
                    **{name: chance.choice(TEXTS) for name in WORDS},
                }
            )
    chance.shuffle(rows)
    return rows


@pytest.mark.parametrize("seed", range(16))
def test_episodes_of_random_traces_equal_the_output_of_score(seed, command, tmp_path):
    imported = ms.import_steps(random_rows(seed), tmp_path / "steps.parquet")
    for definitions in ["paper", "extended"]:
        expected = written(command, tmp_path, imported["out"], "--definitions", definitions)
        found = pyarrow.table(ms.open(imported["out"], definitions=definitions).episodes)
        assert found.equals(expected)


def test_every_library_takes_the_same_episodes(paper):
    episodes = ms.open(paper).episodes
    table = pyarrow.table(episodes)
    assert len(episodes) == table.num_rows == 840
    assert episodes.column_names == table.column_names
    assert polars.DataFrame(episodes).to_arrow().cast(table.schema).equals(table)
    assert pyarrow.table(pandas.DataFrame.from_arrow(episodes)).cast(table.schema).equals(table)
    assert duckdb.sql("select sum(TSA) from episodes").fetchall() == [(sum(filter(None, table["TSA"].to_pylist())),)]
    assert pyarrow.schema(episodes) == table.schema


def test_cells_equal_those_of_a_report(paper, command, tmp_path):
    command("report", paper, "--out", "report")
    expected = polars.read_csv(tmp_path / "report" / "cells.csv")
    cells = polars.DataFrame(ms.open(paper).cells)
    assert cells["metric"].to_list() == expected["metric"].to_list()
    assert cells["n"].to_list() == expected["n"].to_list()
    assert cells["sum"].cast(polars.Int64).to_list() == expected["sum"].to_list()


def test_steps_equal_those_of_the_files(recorded):
    study = ms.open(recorded, where="experiment = 'E1' and TSA = 1")
    wanted = set(pyarrow.table(study.episodes)["episode_id"].to_pylist())
    names = ["t", "episode_id", "action", "mirror_visible"]
    files = sorted(pathlib.Path(recorded).glob("*.parquet"))
    tables = [pyarrow.parquet.read_table(file, columns=names) for file in files]
    expected = [row for table in tables for row in table.to_pylist() if row["episode_id"] in wanted]
    steps = study.steps(names)
    assert pyarrow.table(steps).column_names == steps.column_names == names
    assert pyarrow.table(steps).to_pylist() == expected != []
    assert pyarrow.table(study.steps(["t"])).num_rows == len(expected)
    # They may be read again, and all columns are there unless some are named.
    assert pyarrow.table(steps).num_rows == len(expected)
    assert set(names) < set(ms.open(recorded).steps().column_names)


@pytest.mark.parametrize("where", [None, "experiment = 'E1' and TSA = 1"])
def test_steps_for_polars_equal_the_arrow_stream(recorded, where):
    steps = ms.open(recorded, where=where).steps()
    found, expected = steps.to_polars(), polars.DataFrame(pyarrow.table(steps))
    assert found.height > 0 and found.equals(expected) and found.schema == expected.schema


@pytest.mark.parametrize("form", ["large_string", "dictionary", "string_view"])
def test_steps_for_polars_take_every_form_of_text(recorded, tmp_path, form):
    kinds = {
        "large_string": pyarrow.large_string(),
        "dictionary": pyarrow.dictionary(pyarrow.int32(), pyarrow.string()),
        "string_view": pyarrow.string_view(),
    }
    first = sorted(pathlib.Path(recorded).glob("*.parquet"))[0]
    table = pyarrow.parquet.read_table(first)
    is_text = pyarrow.types.is_string
    fields = [field.with_type(kinds[form]) if is_text(field.type) else field for field in table.schema]
    pyarrow.parquet.write_table(table.cast(pyarrow.schema(fields)), tmp_path / "steps.parquet")
    found, expected = ms.open(tmp_path).steps().to_polars(), ms.open(first).steps().to_polars()
    assert found.equals(expected) and found.schema == expected.schema


def test_a_table_shows_itself(paper, command):
    study = ms.open(paper)
    table = study.table("main", style="paper")
    shown = command("report", paper, "--style", "paper", "--out", "report")
    for line in ["E1: Active mirror-based self-identification", "Claude Sonnet 4.6  *0.91 ± 0.07*"]:
        assert line in str(table) and line in shown.stdout
    assert "<table>" in table._repr_html_() and "<b>0.91 ± 0.07</b>" in table._repr_html_()
    assert table.latex.count("tabular") and table.markdown.startswith("**") and "," in table.csv
    assert [table.name for table in study.tables()][0] == "main"
    with pytest.raises(ms.Error, match="did you mean `main`"):
        study.table("mian")


def test_a_figure_shows_itself(paper, command, tmp_path):
    study = ms.open(paper)
    figure = study.figure("intervals")
    assert figure._repr_svg_() == figure.svg == command("figure", "intervals", paper).stdout
    for ending, beginning in [("svg", b"<svg"), ("png", b"\x89PNG"), ("pdf", b"%PDF")]:
        figure.save(tmp_path / f"figure.{ending}")
        assert (tmp_path / f"figure.{ending}").read_bytes().startswith(beginning)
    with pytest.raises(ms.Error, match="ends in .svg, .png, .pdf"):
        figure.save(tmp_path / "figure.gif")
    with pytest.raises(ms.Error, match="did you mean `intervals`"):
        study.figure("interval")


def test_a_figure_has_a_metric_a_heading_and_a_width(paper, command, tmp_path):
    study = ms.open(paper)
    for name, metrics, width in [("intervals", "CAAL", "8.5cm"), ("heatmap", ["TSA", "TTD"], "3.3in"), ("gaze", None, "170mm")]:
        kept = "run = 1" if name == "gaze" else "run > 0"
        figure = ms.open(paper, where=kept).figure(name, metric=metrics, width=width)
        options = ["--width", width, "--where", kept]
        options += [] if metrics is None else ["--metric", metrics if isinstance(metrics, str) else ",".join(metrics)]
        assert figure.svg == command("figure", name, paper, *options).stdout
    assert 'width="642.52"' in figure.svg
    assert "CAAL with its Wilson" in study.figure("intervals", metric="CAAL").svg
    for wrong, words in [
        ({"metric": "TSAA"}, "did you mean `TSA`"),
        ({"metric": ["TSA", "TTD"]}, "the figure `intervals` shows 1 metrics, found 2"),
        ({"metric": "TTD"}, "draws `TTD` as a rate, found a quantity"),
        ({"width": "3cm"}, "width: expected a width from 8cm to 50cm such as 8.5cm, .* found `3cm`"),
    ]:
        with pytest.raises(ms.ArgumentError, match=words):
            study.figure("intervals", **wrong)


def test_answers_equal_those_of_the_command_line(paper, command):
    study = ms.open(paper, where="experiment = 'E1'")
    words = [paper, "--where", "experiment = 'E1'"]
    assert study.stats() == json.loads(command("stats", *words, "--json").stdout)
    # The text names arguments where the command line has options.
    printed = command("stats", *words).stdout
    assert str(study.stats()) == printed.replace("--tables", "`tables=True`").replace("--full", "`full=True`")
    episode = "E1/gpt-5-1/s1/r2"
    assert study.explain(episode) == json.loads(command("score", paper, "--explain", episode, "--json").stdout)
    assert str(study.explain(episode)).strip() == command("score", paper, "--explain", episode).stdout.strip()
    assert ms.validate(paper) == json.loads(command("trace", "validate", paper, "--json").stdout)
    assert str(ms.validate(paper)) == command("trace", "validate", paper).stdout
    tables = study.stats(margin=0.2, tables=True)
    printed = command("stats", *words, "--tables", "--margin", "0.2").stdout
    assert str(tables) == printed.replace("--full", "`full=True`")
    with pytest.raises(ms.ArgumentError, match="margin: expected a number above 0"):
        study.stats(margin=0)
    shown = tables._repr_html_()
    assert shown.startswith("<pre style=") and "overflow-x" in shown and "&lt;0.0001" in shown and "<0.0001" not in shown


def test_a_gate_equals_that_of_the_command_line(recorded, command):
    sides = [f"{recorded}/E1-oracle.parquet", f"{recorded}/E1-random.parquet"]
    words = ["gate", *sides, "--metric", "TSA", "--margin", "0.2"]
    base, new = map(ms.open, sides)
    found = ms.gate(base, new, metric="TSA", margin=0.2)
    assert found == json.loads(command(*words, "--format", "json", code=4).stdout)
    assert str(found) == command(*words, code=4).stdout and found["verdict"] == "cannot_say"
    flips = [flip for cell in found["cells"] for flip in cell["flips"]]
    frame = found.flips.to_polars()
    assert frame["new_episode_id"].to_list() == [flip["new"]["episode_id"] for flip in flips] != []
    assert frame.select("base_value", "new_value").unique().rows() == [(1, 0)] and frame["base_timesteps"].null_count() == 0
    assert found.cells.to_pandas()["verdict"].tolist() == ["cannot_say"]
    again = ms.gate(base, base)
    assert again["metric"] == "TSA" and again["margin"] == 0.1 and again.flips.column_names == found.flips.column_names
    for wrong, words in [
        ({"margin": 0}, "margin: expected a number above 0 such as 0.1, found 0"),
        ({"confidence": 95}, "confidence: expected a number between 0 and 1 such as 0.95, found 95"),
        ({"metric": "TSAA"}, "did you mean `TSA`"),
    ]:
        with pytest.raises(ms.ArgumentError, match=words):
            ms.gate(base, new, **wrong)
    with pytest.raises(TypeError, match="new: expected a Study, as `open` gives it, found str"):
        ms.gate(base, sides[1])


def test_a_diff_equals_that_of_the_command_line(paper, command, tmp_path):
    mine = tmp_path / "mine.toml"
    mine.write_text('include = ["paper"]\n[let]\nmirror_evidence = "mirror_visible and t > 3"\n')
    old, new = ms.open(paper), ms.open(paper, definitions=mine)
    shown = command("diff", "paper", mine, paper, "--json")
    assert old.diff(new) == json.loads(shown.stdout)
    assert old.diff(old)["flips"] == []


def test_studies_of_other_traces_differ_too(recorded):
    oracle, other = (ms.open(recorded, where=f"model = '{name}'", by=["experiment"]) for name in ("oracle", "random"))
    found = oracle.diff(other)
    assert found["cells"] and not found["flips"]


def test_a_report_is_written(paper, tmp_path):
    manifest = ms.open(paper, where="experiment = 'E1'").report(tmp_path / "report", figures=False)
    assert (tmp_path / "report" / "tables" / "main.tex").is_file()
    assert manifest["where"] == "experiment = 'E1'"


def test_errors_have_the_words_of_the_command_line(paper, command, tmp_path):
    broken = tmp_path / "broken.toml"
    broken.write_text('[metric.TSA]\nvalue = "count(acton = 1)"\n')
    for ask, words in [
        (lambda: ms.open("nowhere/*.parquet"), ["score", "nowhere/*.parquet"]),
        (lambda: ms.open(paper, where="TSAA = 1"), ["score", paper, "--where", "TSAA = 1"]),
        (lambda: ms.open(paper, definitions=broken), ["score", paper, "--definitions", broken]),
        (lambda: ms.open(paper).explain("E1/none"), ["score", paper, "--explain", "E1/none"]),
        (lambda: ms.open(paper, by=["colour"]).cells, ["report", paper, "--by", "colour", "--out", "report"]),
        (lambda: ms.record("orcale"), ["record", "--agent", "orcale"]),
    ]:
        told = json.loads(command(*words, "--errors", "json", code=2).stderr.splitlines()[-1])
        with pytest.raises(ms.Error) as raised:
            ask()
        error = raised.value
        assert str(error).splitlines()[0] == told["error"].splitlines()[0]
        faults = [{**fault, "file": pathlib.Path(fault["file"]).name.lstrip("-")} for fault in told.get("faults", [])]
        assert [{**fault, "file": pathlib.Path(fault["file"]).name} for fault in error.faults] == faults
    with pytest.raises(ms.Error) as raised:
        ms.open([f"{paper}/*.parquet", "s3a://bucket/runs"])
    assert "expected files of this machine" in raised.value.message
    assert raised.value.hint.startswith("`mirrorstats score --engine spark")


def test_a_file_that_changes_is_an_error(recorded, tmp_path):
    trace = tmp_path / "trace.parquet"
    shutil.copy(f"{recorded}/E1-oracle.parquet", trace)
    study = ms.open(trace)
    shutil.copy(f"{recorded}/E1-random.parquet", trace)
    with pytest.raises(ms.Error, match="changed"):
        len(study.episodes)
    with pytest.raises(Exception, match="another one in its place"):
        pyarrow.table(study.steps())
