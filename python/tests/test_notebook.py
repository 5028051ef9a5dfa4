"""A notebook in the words of a user: frames in, frames out, an agent that raises, questions in SQL."""

import pathlib
import pickle

import agent
import duckdb
import fsspec
import mirrorstats as ms
import numpy
import pandas
import polars
import pytest
from test_study import random_rows

QUESTIONS = [
    ("SHOW TABLES", ["name"], 3),
    ("DESCRIBE episodes", ["column_name", "column_type"], 15),
    ("SELECT count(*) FROM episodes", ["count_star()"], 1),
    ("SELECT avg(TSA), avg(TTD), max(TTD), min(TTD) FROM episodes", ["avg(TSA)", "avg(TTD)", "max(TTD)", "min(TTD)"], 1),
    ("SELECT model, avg(TSA), avg(TSA) FROM episodes GROUP BY model", ["model", "avg(TSA)", "avg(TSA)_1"], 8),
    ("SELECT model, MAX(TTD) FROM episodes GROUP BY model ORDER BY max(TTD), model", ["model", "max(TTD)"], 8),
    ("SELECT experiment, model, sum(TSA) AS hits FROM episodes GROUP BY ROLLUP(experiment, model)", ["experiment", "model", "hits"], 46),
    ("SELECT experiment, model, count(*) FROM episodes GROUP BY CUBE(experiment, model)", ["experiment", "model", "count_star()"], 54),
    ("SELECT episode_id FROM episodes WHERE TTD > (SELECT avg(TTD) FROM episodes)", ["episode_id"], 489),
    ("SELECT model FROM episodes WHERE EXISTS (SELECT 1 FROM cells WHERE mean > 1000) LIMIT 1", ["model"], 0),
    ('SELECT experiment, avg("TSA-C") AS rate FROM episodes GROUP BY experiment ORDER BY 1', ["experiment", "rate"], 5),
]


@pytest.mark.parametrize("sql, columns, rows", QUESTIONS)
def test_queries_have_the_expected_columns_and_rows(paper, sql, columns, rows):
    answer = ms.open(paper).query(sql)
    assert answer.column_names == columns and len(answer) == rows


def test_queries_agree_with_duckdb(paper):
    study = ms.open(paper)
    episodes = study.episodes
    for sql in [
        "SELECT avg(TSA), sum(TTD), count(*) FROM episodes",
        "SELECT experiment, model, count(*) AS n, sum(TTD) FROM episodes GROUP BY CUBE(experiment, model) ORDER BY 1, 2",
        "SELECT model, count(*) FROM episodes WHERE TTD > (SELECT avg(TTD) FROM episodes) GROUP BY model ORDER BY count(*), model",
    ]:
        key = lambda row: [(value is None, value) for value in row]
        expected = sorted(duckdb.sql(sql).fetchall(), key=key)
        assert sorted(study.query(sql).to_polars().rows(), key=key) == expected != []
        assert study.query(sql).column_names == duckdb.sql(sql).columns
    assert str(study.query("SELECT count(*) FROM episodes").to_polars().dtypes[0]) == "Int64"


@pytest.mark.parametrize(
    "sql, words",
    [
        ("SELECT model, avg(TSA) FROM episodes", "`model` is used beside an aggregate without GROUP BY"),
        ("SELECT *, avg(TSA) FROM episodes", "name the columns in its place"),
        ("SELECT avg(TSA-C) FROM episodes", 'write "TSA-C" in double quotes'),
        ("SELECT (SELECT TSA FROM episodes)", "a subquery runs by itself first: .* 840 rows"),
        ("SELECT model FROM episodes e WHERE 1 < (SELECT avg(TTD) FROM episodes f WHERE f.model = e.model)", "ask with a JOIN"),
        ("DESCRIBE episode", "did you mean `episodes`"),
        ("DROP TABLE episodes", "it reads, and changes nothing"),
    ],
)
def test_a_failed_query_names_the_remedy(paper, sql, words):
    with pytest.raises(ms.QueryError, match=f"(?s){words}") as raised:
        ms.open(paper).query(sql)
    assert raised.value.faults[0]["file"] == "query"


def test_frames_of_steps_and_of_scores_are_studies(paper):
    rows = random_rows(7)
    frame = pandas.DataFrame(rows)
    expected = ms.open(polars.DataFrame(rows)).cells.to_polars()
    for form in [rows, frame.to_dict("records"), frame, frame.sample(frac=1.0, random_state=1), duckdb.sql("select * from frame"), polars.LazyFrame(rows)]:
        assert ms.open(form).cells.to_polars().equals(expected)
    study = ms.open(paper)
    for scores in [study.episodes, study.episodes.to_polars(), study.episodes.to_pandas()]:
        assert ms.open(scores).cells.to_polars().equals(study.cells.to_polars())
    # As pandas has it where there are gaps.
    floats = study.episodes.to_pandas().astype({"TSA-C": "float64"})
    assert ms.open(floats, metrics="TSA-C").cells.to_polars().equals(ms.open(paper, metrics="TSA-C").cells.to_polars())
    with pytest.raises(ms.InputError, match="found the columns a, b"):
        ms.open(polars.DataFrame({"a": [1], "b": [2]}))


def test_paths_of_every_kind_are_inputs(paper, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", paper)
    for path in [f"file://{paper}", "~", "~/*.parquet"]:
        assert len(ms.open(path).episodes) == 840
    memory = fsspec.filesystem("memory")
    file = sorted(pathlib.Path(paper).glob("*.parquet"))[0]
    memory.put_file(str(file), "/one.parquet")
    for opened in [fsspec.open("memory://one.parquet"), fsspec.open(str(file)), file]:
        assert len(ms.open(opened).episodes) == 21
    for given, error in [([], ms.ArgumentError), (7, TypeError), ([None], TypeError), ({"a": 1}, TypeError)]:
        with pytest.raises(error, match="inputs: expected"):
            ms.open(given)
    with pytest.raises(TypeError, match="inputs: expected a path, a data frame or a list of dicts, found Series"):
        ms.open(pandas.Series([1, 2]))
    with pytest.raises(TypeError, match="inputs: expected a path, found DataFrame; `import_steps` checks a data frame"):
        ms.validate(pandas.DataFrame(random_rows(7)))
    assert len(ms.open(paper.encode()).episodes) == 840
    with pytest.raises(ms.ArgumentError, match="threads: expected an integer of at least 1, found 0"):
        ms.open(paper, threads=0)


def test_an_argument_of_another_type_is_refused_by_its_name(paper, tmp_path):
    study = ms.open(paper)
    for ask, words in [
        (lambda: ms.open(paper, where=3), "where: expected a condition as text, found int"),
        (lambda: ms.open(paper, pool="yes"), "pool: expected True or False, found str"),
        (lambda: ms.open(paper, metrics=3), "metrics: expected a name or several, found int"),
        (lambda: ms.open(paper, definitions=3), "definitions: expected a name, a path, TOML text or a dict, found int"),
        (lambda: study.diff(None), "other: expected a Study, as `open` gives it, found NoneType"),
        (lambda: ms.compare([study, study]), "studies: expected studies by name, as a dict, found list"),
        (lambda: ms.compare({"a": study, "b": 3}), r"studies\['b'\]: expected a Study"),
        (lambda: ms.import_steps("steps.csv"), "rows: expected dicts or a data frame, found str; read a file first"),
        (lambda: ms.open(paper, definition="paper"), "unexpected keyword argument 'definition'"),
    ]:
        with pytest.raises(TypeError, match=words):
            ask()
    for ask, words in [
        (lambda: ms.open(paper, metrics=[]), "metrics: expected at least one name, found none"),
        (lambda: ms.import_steps([], cluster="seed", reconstruction=True), "exclude each other"),
    ]:
        with pytest.raises(ms.ArgumentError, match=words):
            ask()
    with pytest.raises(ms.OutputError, match="cannot write the trace"):
        ms.import_steps(random_rows(7), tmp_path / "nowhere" / "steps.parquet")


def test_cells_are_a_long_frame_with_units_and_intervals(paper):
    cells = ms.open(paper, metrics=["TSA", "TTD"]).cells.to_polars()
    assert [str(cells[name].dtype) for name in ("n", "sum", "sum_sq")] == ["Int64"] * 3
    kinds = cells.select("metric", "unit", "interval").drop_nulls().unique().sort("metric").rows()
    assert kinds == [("TSA", "rate", "wilson"), ("TTD", "steps", "student_t")]


def test_statistics_are_long_frames(paper):
    study = ms.open(paper, where="experiment = 'E1'")
    stats = study.stats()
    cells = stats.cells.to_polars().filter(polars.col("metric") == "TSA").sort("model")
    same = study.cells.to_polars().filter(polars.col("metric") == "TSA").sort("model")
    assert cells["intervals_wilson_low"].to_list() == same["ci_low"].to_list()
    tests = stats.tests.to_polars()
    assert set(tests["family"]) >= {"chance", "models", "conditions"} - ({"conditions"} if not stats["conditions"] else set())
    pairs = sum(len(family["tests"]) for family in stats["models"])
    assert (tests["family"] == "models").sum() == pairs == stats.families.to_polars()["tests"].sum()
    assert stats.durations.to_pandas()["median"].notna().any()
    assert "<table" in stats.tests._repr_html_() and "the first and last 10" in stats.tests._repr_html_()


def test_definitions_and_styles_are_text_or_dicts(paper):
    text = 'include = ["paper"]\n[metric.TURNS]\ntitle = "Turns"\nvalue = "count(action in (\'turn_left\', \'turn_right\'))"\n'
    value = "count(action in ('turn_left', 'turn_right'))"
    table = {"include": ["paper"], "metric": {"TURNS": {"title": "Turns", "value": value}}}
    one, other = (ms.open(paper, definitions=form, metrics="TURNS") for form in (text, table))
    assert one.episodes.to_polars().equals(other.episodes.to_polars())
    assert "definitions inline" in repr(one) and "where seed = 1" in repr(ms.open(paper, where="seed = 1"))
    with pytest.raises(ms.DefinitionError, match="did you mean `action`") as raised:
        ms.open(paper, definitions={"metric": {"X": {"title": "x", "value": "count(acton = 'done')"}}})
    assert raised.value.faults[0]["file"] == "definitions.toml" and " --> definitions.toml:" in str(raised.value)
    style = ms.open(paper).table(style={"include": ["default"], "row_order": ["Qwen 3.6 Plus"]})
    assert style.markdown.index("Qwen 3.6 Plus") < style.markdown.index("Claude")


def test_compared_studies_are_stacked_with_their_changes(paper):
    studies = {"all": ms.open(paper, by="model"), "first": ms.open(paper, by="model", where="seed = 1")}
    found = ms.compare(studies).to_polars().filter(polars.col("metric") == "TSA")
    wide = found.pivot("study", index="model", values="mean")
    changes = found.filter(polars.col("study") == "first")["change"]
    assert numpy.allclose(changes, wide["first"] - wide["all"]) and changes.null_count() == 0
    with pytest.raises(ms.ArgumentError, match="open both with the same `by`"):
        ms.compare({"a": studies["all"], "b": ms.open(paper)})


def test_answers_can_be_pickled(paper, tmp_path):
    study = ms.open(polars.DataFrame(random_rows(7)), definitions='include = ["paper"]\n', where="seed = 1")
    again = pickle.loads(pickle.dumps(study))
    del study
    assert len(again.episodes) > 0
    study = ms.open(paper)
    table, figure, stats = (pickle.loads(pickle.dumps(one)) for one in (study.table(), study.figure("heatmap"), study.stats()))
    assert str(table) == str(study.table()) and figure.svg == study.figure("heatmap").svg
    figure.save(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert stats == study.stats() and len(stats.tests) and str(stats) == str(study.stats())
    assert pickle.loads(pickle.dumps(study.cells)).to_polars().equals(study.cells.to_polars())
    with pytest.raises(TypeError, match="pickle the study, or `steps.to_polars\\(\\)`"):
        pickle.dumps(study.steps())


def test_errors_have_specific_types_and_name_arguments(paper, tmp_path):
    study = ms.open(paper)
    for ask, kind in [
        (lambda: ms.open("nowhere"), ms.InputError),
        (lambda: ms.open(paper, where="TSAA = 1"), ms.DefinitionError),
        (lambda: ms.open(paper, metrics="TSAA"), ms.ArgumentError),
        (lambda: study.figure("interval"), ms.ArgumentError),
        (lambda: study.table("mian"), ms.ArgumentError),
        (lambda: study.stats(confidence=95), ms.ArgumentError),
        (lambda: study.explain("E1/none"), ms.ArgumentError),
        (lambda: study.report(paper), ms.OutputError),
    ]:
        with pytest.raises(kind) as raised:
            ask()
        assert isinstance(raised.value, ms.Error) and "--" not in str(raised.value).replace("-->", "")
    assert "`full=True`" in str(study.stats()) or "--full" not in str(study.stats())
    steps = tmp_path / "steps.csv"
    pandas.DataFrame({"a": [1, 2], "b": [3, 4]}).to_csv(steps, index=False)
    with pytest.raises(ms.InputError, match="`episode_id`"):
        ms.open(steps).cells


def test_a_log_is_opened_where_a_trace_is(tmp_path):
    rows, steps = random_rows(7), tmp_path / "steps.csv"
    pandas.DataFrame(rows).to_csv(steps, index=False)
    trace = ms.import_steps(rows, tmp_path / "steps.parquet")["out"]
    assert ms.open(steps).cells.to_polars().equals(ms.open(trace).cells.to_polars())


def test_an_exception_of_an_agent_keeps_its_traceback(tmp_path):
    class Tired:
        def __call__(self, message):
            if message["kind"] == "observation" and message["t"] > 1:
                raise RuntimeError("too tired")
            return agent.decide(message)

    with pytest.raises(RuntimeError, match="too tired"):
        ms.record(Tired, "E1", seeds=1, runs=1, out=tmp_path, no_log=True)
    with pytest.warns(RuntimeWarning, match="too tired"):
        answer = ms.record(Tired, "E1", seeds=1, runs=1, out=tmp_path, no_log=True, on_error="lose")
    assert "1 lost" in str(answer)
