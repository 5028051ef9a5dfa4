"""What type checkers say of the package, of its stubs, and of code that uses it."""

import os
import pathlib
import subprocess
import sys

import pytest

USED = '''
import mirrorstats as ms

study = ms.open(["runs"], metrics="TSA", by=["model"], lost="as-failure", definitions={"include": ["paper"]})
rows: int = len(study.episodes)
names: list[str] = study.cells.column_names
study.figure("heatmap").save("heatmap.png")
warnings: list[str] = study.stats(confidence=0.9)["warnings"]
height: int = study.stats().tests.to_polars().height
latex: str = study.table(style="paper").latex
found = ms.compare({"a": study, "b": study}).to_polars()


async def agent(message: ms.Message) -> dict[str, str]:
    return {"action": "w"}


answer = ms.record(agent, "E1", seeds=1, on_error="lose", images="array", in_flight=4)
try:
    study.query("SELECT 1")
except ms.QueryError as error:
    print(error.hint, error.faults)
'''


def checked(folder, *words):
    # The checker finds the package where this interpreter does.
    path = os.pathsep.join(filter(None, [os.environ.get("MYPYPATH"), str(folder)]))
    ended = subprocess.run(
        [sys.executable, "-m", *words], cwd=folder, env={**os.environ, "MYPYPATH": path}, capture_output=True, text=True
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr


def test_code_that_uses_the_package_is_strictly_typed(tmp_path):
    (tmp_path / "used.py").write_text(USED)
    checked(tmp_path, "mypy", "--strict", "used.py")
    wrong = USED.replace('figure("heatmap")', 'figure("heat")').replace('on_error="lose"', 'on_error="ignore"')
    (tmp_path / "used.py").write_text(wrong)
    with pytest.raises(AssertionError, match="Found 2 errors"):
        checked(tmp_path, "mypy", "--strict", "used.py")


def test_the_package_and_its_stubs_are_strictly_typed(tmp_path):
    checked(tmp_path, "mypy", "--strict", "-p", "mirrorstats")
    checked(tmp_path, "mypy.stubtest", "mirrorstats")
