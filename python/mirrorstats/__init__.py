"""Scores mirror self-recognition episodes: step traces in, exact metrics, tables and reports out.

    import mirrorstats as ms

    study = ms.open("runs/*.parquet", definitions="paper", where="experiment <> 'E2'")
    study.table("main")                 # shows itself in a notebook
    study.episodes                      # Arrow: polars.DataFrame(study.episodes), pyarrow.table(study.episodes)

Every answer is the one that the command `mirrorstats` gives, in words of arguments. Each kind of error has a class under
`Error`. Settings of the command line (`mirrorstats.toml`) do not apply.
`MIRRORSTATS_BUDGET` allows larger inputs. Work that takes time releases the
interpreter's lock.
"""

from ._answer import Changes, Explanation, Gate, Imported, Manifest, Recorded, Statistics, Validation
from ._dict import Answer
from ._error import ArgumentError, DefinitionError, Error, InputError, OutputError, QueryError, RecordError
from ._example import example_runs
from ._import import import_steps
from ._native import ArrowSteps, ArrowTable, Figure, Table, __version__
from ._record import Message, record
from ._study import Study, compare, gate, open
from ._validate import validate

__all__ = [
    "Answer",
    "ArgumentError",
    "ArrowSteps",
    "ArrowTable",
    "Changes",
    "DefinitionError",
    "Error",
    "Explanation",
    "Figure",
    "Gate",
    "Imported",
    "InputError",
    "Manifest",
    "Message",
    "OutputError",
    "QueryError",
    "RecordError",
    "Recorded",
    "Statistics",
    "Study",
    "Table",
    "Validation",
    "__version__",
    "compare",
    "example_runs",
    "gate",
    "import_steps",
    "open",
    "record",
    "validate",
]
