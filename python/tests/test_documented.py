"""Every example of a docstring runs, and every public class and property has a docstring."""

import doctest
import inspect
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
def test_a_docstring_is_there_and_its_example_runs(one, paper, monkeypatch, tmp_path):
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


@pytest.mark.parametrize("page", ["README.md", "docs/how-to/python.md"])
def test_the_block_of_a_page_runs(page, recorded, monkeypatch, tmp_path):
    block = (FIXTURES.parent / page).read_text().split("```python\n")[1].split("\n```")[0]
    for folder in ["runs", "a", "b"]:
        shutil.copytree(recorded, tmp_path / folder)
    (tmp_path / "mine.toml").write_text('include = ["paper"]\n')
    monkeypatch.chdir(tmp_path)
    rows = random_rows(7)
    said = {"rows": rows, "frame": polars.DataFrame(rows)}
    exec(compile(block, page, "exec"), said)
    assert len(said["study"].episodes) > 0 and (tmp_path / "tsa.pdf").is_file()
