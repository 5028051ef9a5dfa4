"""Every example of a docstring runs, and every public class and property has a docstring."""

import doctest
import inspect
import re
import shutil

import mirrorstats as ms
import polars
import pytest
from conftest import FIXTURES
from test_study import random_rows

PUBLIC = [getattr(ms, name) for name in ms.__all__ if not name.startswith("_") and name != "Message"]


def members():
    for one in PUBLIC:
        yield one
        if inspect.isclass(one):
            own = [member for name, member in vars(one).items() if not name.startswith("_")]
            yield from (member for member in own if callable(member) or inspect.isdatadescriptor(member))


@pytest.mark.parametrize("one", list(members()), ids=lambda one: getattr(one, "__qualname__", getattr(one, "__name__", str(one))))
def test_a_docstring_exists_and_its_example_runs(one, paper, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    words = inspect.getdoc(one)
    assert words, "no docstring"
    test = doctest.DocTestParser().get_doctest(words, {}, str(one), None, 0)
    failed = []
    runner = doctest.DocTestRunner(verbose=False)
    runner.run(test, out=failed.append)
    assert runner.failures == 0, "".join(failed)


def test_functions_and_classes_have_examples():
    without = {"Answer", "Changes", "Explanation", "Imported", "Manifest", "Recorded", "Validation", "ArgumentError", "DefinitionError", "InputError", "OutputError", "QueryError", "RecordError"}
    lacking = {one.__name__ for one in PUBLIC if ">>>" not in (inspect.getdoc(one) or "")}
    assert lacking - without == set()


def blocks(page):
    return [rest.split("\n```")[0] for rest in (FIXTURES.parent / page).read_text().split("```python\n")[1:]]


def test_every_page_with_python_is_run_below():
    root = FIXTURES.parent
    pages = [page.relative_to(root).as_posix() for page in [*root.glob("*.md"), *root.glob("docs/**/*.md")]]
    assert {page: len(blocks(page)) for page in pages if blocks(page)} == {
        "README.md": 1,
        "docs/how-to/python.md": 1,
        "docs/how-to/cluster.md": 1,
        "docs/how-to/harness.md": 1,
        "docs/tutorials/own-agent.md": 1,
        "docs/tutorials/train.md": 1,
    }


def test_the_environment_of_the_page_plays(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    exec(compile(*blocks("docs/how-to/harness.md"), "harness.md", "exec"), {})
    assert capsys.readouterr().out.endswith("0.0 True 0\n")
    assert ms.open("runs").episodes.to_polars()["TTD"].to_list() == [1]


def test_the_agent_of_the_tutorial_learns(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    exec(compile(*blocks("docs/tutorials/train.md"), "train.md", "exec"), {})
    first, last = map(float, re.findall(r"0\.\d+", capsys.readouterr().out))
    assert first < 0.6 and last > 0.85
    scores = ms.open("runs").episodes.to_polars()
    assert len(scores) == 21 and scores["WARRANTED"].sum() >= 5


def test_the_agent_of_the_tutorial_is_recorded(tmp_path):
    said = {}
    exec(compile(*blocks("docs/tutorials/own-agent.md"), "own-agent.md", "exec"), said)
    answer = ms.record(said["walk"], "E1", seeds=1, runs=1, out=tmp_path, no_log=True, no_frames=True)
    assert answer["recorded"] == 1 and answer["steps"] > 1


def test_the_sql_of_a_page_gives_the_episodes_in_other_libraries(recorded, command, monkeypatch, tmp_path):
    shutil.copytree(recorded, tmp_path / "runs")
    (tmp_path / "scores.sql").write_text(command("definitions", "sql").stdout)
    monkeypatch.chdir(tmp_path)
    parts = {part.splitlines()[0]: part for part in blocks("docs/how-to/cluster.md")[0].split("# ")[1:]}
    # `tests/spark` and `make end-to-end` have the libraries of the other two.
    assert list(parts) == ["DuckDB", "Polars", "DataFusion", "Spark"]
    expected = ms.open("runs", definitions="paper").episodes.to_polars().sort("episode_id")
    expected = expected.rename(lambda name: name.replace("-", "_"))
    for name in ["DuckDB", "Polars"]:
        exec(compile(f"# {parts[name]}", name, "exec"), {})
        found = polars.read_parquet(f"by-{name.lower()}.parquet").sort("episode_id")
        kept = expected.select(found.columns)
        assert len(kept.columns) == 15 and found.cast(kept.schema).equals(kept)


@pytest.mark.parametrize("page", ["README.md", "docs/how-to/python.md"])
def test_the_block_of_a_page_runs(page, recorded, monkeypatch, tmp_path):
    (block,) = blocks(page)
    for folder in ["runs", "a", "b"]:
        shutil.copytree(recorded, tmp_path / folder)
    (tmp_path / "mine.toml").write_text('include = ["paper"]\n')
    monkeypatch.chdir(tmp_path)
    rows = random_rows(7)
    said = {"rows": rows, "frame": polars.DataFrame(rows)}
    exec(compile(block, page, "exec"), said)
    assert len(said["study"].episodes) > 0 and (tmp_path / "tsa.pdf").is_file()
