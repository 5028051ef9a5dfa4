"""What has a turn in `bench.py`: our commands, the floors, the rivals. All use all cores unless they say otherwise."""

import os
import sys
from pathlib import Path

from timing import Contender

HERE = Path(__file__).resolve().parent
# One metric differs from the paper's definitions.
CHANGED = HERE.parent.parent / "examples/definitions/inclusive.toml"

SCORE = "score -o x.parquet"
ONE_THREAD = "score --threads 1"
TWO_THREADS = "score --threads 2"
REPORT = "report --no-figures"
DIFF = "diff, one definition changed"
INFO, VALIDATE, STATS, EXPLAIN = "trace info", "trace validate", "stats", "score --explain, one episode"
PAGES = "page floor: read and decompress"
DECODE = "library decode"
PACKED, GENERAL = "DuckDB by hand, packed", "DuckDB by hand, general"
POLARS = "Polars by hand"
CELLS = "DuckDB by hand, cells alone"
DUCKDB_SQL, POLARS_SQL = "DuckDB, generated SQL", "Polars, generated SQL"
PANDAS = "pandas, one run"


def ours(program, episode):
    """Our own commands; `episode` is the one to explain."""

    def own(name, *arguments, out=None, tail=()):
        def command(folder, target):
            last = [*tail, target] if out else []
            return [program, *arguments, folder, *last]

        return Contender(name, command, out=out, own=True)

    score = {"out": "score.parquet", "tail": ["-o"]}
    listed = [
        own(SCORE, "score", **score),
        own(ONE_THREAD, "score", "--threads", "1", **score | {"out": "score-1.parquet"}),
        own(REPORT, "report", "--no-figures", out="report", tail=["--out"]),
        own(DIFF, "diff", "paper", CHANGED),
        own(INFO, "trace", "info"),
        own(VALIDATE, "trace", "validate"),
        own(STATS, "stats"),
        own(EXPLAIN, "score", "--explain", episode),
    ]
    # On two cores, `score` has two threads anyway.
    if os.cpu_count() != 2:
        listed.insert(2, own(TWO_THREADS, "score", "--threads", "2", **score | {"out": "score-2.parquet"}))
    return listed


def floors(examples):
    """What reading costs at least: pages, then values."""
    return [
        Contender(PAGES, lambda folder, _: [examples / "decode", "--pages", folder], own=True),
        Contender(DECODE, lambda folder, _: [examples / "decode", folder], own=True),
    ]


def rivals(sql):
    """Other engines; `sql` has the paths of the generated statements by dialect."""

    def rival(name, engine, *more, once=False):
        def command(folder, out):
            return [sys.executable, HERE / "engines.py", engine, folder, out, *more]

        return Contender(name, command, out=f"{engine}.parquet", inside=True, once=once)

    return [
        rival(PACKED, "duckdb-packed"),
        rival(GENERAL, "duckdb-general"),
        rival(POLARS, "polars"),
        rival(CELLS, "duckdb-cells"),
        rival(DUCKDB_SQL, "duckdb-sql", sql["duckdb"]),
        rival(POLARS_SQL, "polars-sql", sql["portable"]),
        rival(PANDAS, "pandas", once=True),
    ]
