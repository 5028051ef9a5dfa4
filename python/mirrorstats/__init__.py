"""Scores mirror self-recognition episodes: step traces in, exact metrics, tables and reports out.

    import mirrorstats as ms

    study = ms.open("runs/*.parquet", definitions="paper", where="experiment <> 'E2'")
    study.table("main")                 # shows itself in a notebook
    study.episodes                      # Arrow: polars.DataFrame(study.episodes), pyarrow.table(study.episodes)

Every answer is the one that the command `mirrorstats` gives, and every error is an `Error` with its words. Work that
takes time releases the interpreter's lock.
"""

from ._answer import Answer
from ._error import Error
from ._example import example_runs
from ._import import import_steps
from ._native import ArrowSteps, ArrowTable, Figure, Table, __version__
from ._record import record
from ._study import Study, open
from ._validate import validate

__all__ = [
    "Answer",
    "ArrowSteps",
    "ArrowTable",
    "Error",
    "Figure",
    "Study",
    "Table",
    "__version__",
    "example_runs",
    "import_steps",
    "open",
    "record",
    "validate",
]
