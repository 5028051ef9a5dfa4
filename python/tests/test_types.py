"""What type checkers say of the package, of its stubs, and of code that uses it."""

import os
import pathlib
import subprocess
import sys

import pytest
from conftest import FIXTURES

USED = '''
from typing import Literal, Optional

import mirrorstats as ms

study = ms.open(["runs"], metrics="TSA", by=["model"], lost="as-failure", definitions={"include": ["paper"]})
rows: int = len(study.episodes)
names: list[str] = study.cells.column_names
study.figure("heatmap").save("heatmap.png")
warnings: list[str] = study.stats(confidence=0.9)["warnings"]
height: int = study.stats().tests.to_polars().height
latex: str = study.table(style="paper").latex
study.figure("intervals", metric="TSA", width="8.5cm")
verdict = ms.gate(study, study, metric="TSA", margin=0.2)
steps: Optional[list[int]] = verdict["cells"][0]["flips"][0]["new"]["timesteps"]
if verdict["verdict"] == "regressed":
    print(verdict.flips.column_names)
flipped: list[str] = [flip["episode_id"] for flip in study.diff(study)["flips"]]
kept: Optional[str] = study.report("report", style="paper")["where"]
decisive: list[int] = study.explain("E1/a/s1/r1")["metrics"][0]["timesteps"]
severity: Literal["error", "note"] = ms.validate("runs", definitions="paper")["findings"][0]["severity"]
recorded: int = ms.import_steps([{"episode_id": "a"}])["episodes"]
found = ms.compare({"a": study, "b": study}).to_polars()


async def agent(message: ms.Message) -> dict[str, str]:
    return {"action": "w"}


lost: list[str] = [one["reason"] for one in ms.record("oracle")["lost"]]
answer = ms.record(agent, "E1", seeds=1, on_error="lose", images="array", in_flight=4)
try:
    study.query("SELECT 1")
except ms.QueryError as error:
    print(error.hint, error.faults)
'''


PYRIGHT = ["basedpyright", "--level", "error", "--pythonpath", sys.executable]


def checked(folder, *words):
    # The checker finds the package where this interpreter does.
    path = os.pathsep.join(filter(None, [os.environ.get("MYPYPATH"), str(folder)]))
    start = [] if words[0].endswith(".py") else ["-m"]
    ended = subprocess.run(
        [sys.executable, *start, *words], cwd=folder, env={**os.environ, "MYPYPATH": path}, capture_output=True, text=True
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr


def test_code_that_uses_the_package_is_strictly_typed(tmp_path):
    (tmp_path / "used.py").write_text(USED)
    checked(tmp_path, "mypy", "--strict", "used.py")
    wrong = USED.replace('figure("heatmap")', 'figure("heat")').replace('on_error="lose"', 'on_error="ignore"')
    (tmp_path / "used.py").write_text(wrong)
    with pytest.raises(AssertionError, match="Found 2 errors"):
        checked(tmp_path, "mypy", "--strict", "used.py")


def test_pyright_finds_the_types_of_answers_and_a_key_that_none_has(tmp_path):
    (tmp_path / "used.py").write_text(USED)
    checked(tmp_path, *PYRIGHT, "used.py")
    for right, wrong in [('verdict["verdict"]', 'verdict["verdikt"]'), ('["reason"]', '["reasons"]'), ('"paper")', '3)')]:
        assert right in USED
        (tmp_path / "used.py").write_text(USED.replace(right, wrong))
        with pytest.raises(AssertionError, match="[1-9] errors?,"):
            checked(tmp_path, *PYRIGHT, "used.py")


def test_the_types_of_answers_match_the_schemas(tmp_path):
    checked(tmp_path, str(FIXTURES.parent / "scripts" / "python-types.py"), "--check")


def test_the_package_and_its_stubs_are_strictly_typed(tmp_path):
    checked(tmp_path, "mypy", "--strict", "-p", "mirrorstats")
    checked(tmp_path, "mypy.stubtest", "mirrorstats")
