"""Logs of inspect-robots by two of its mock policies: `FOLDER/NAME.json`."""

import sys
from pathlib import Path

from inspect_robots import eval

FOLDER = Path(sys.argv[1])
FOLDER.mkdir(parents=True, exist_ok=True)
for name in ("scripted", "random"):
    (log,) = eval("cubepick-reach", name, "cubepick", log_dir=str(FOLDER / "raw" / name), seed=7, grader=None)
    assert log.status == "success", log.error
    (made,) = (FOLDER / "raw" / name).glob("*.json")
    made.rename(FOLDER / f"{name}.json")
