"""Runs the SQL lowering on an independent engine (DuckDB) and compares every score with the native engine's: the portable
statement, and DuckDB's own.

Usage: check-sql.py MIRRORSTATS TRACES_FOLDER [MIRRORSTATS_ARGUMENT...]
"""

import csv
import io
import subprocess
import sys

import duckdb


def run(*arguments):
    return subprocess.run(arguments, check=True, capture_output=True, text=True).stdout


def native(program, folder, extra):
    header, *rows = csv.reader(io.StringIO(run(program, "score", folder, *extra)))
    # Labels come before the metrics, what the traces declare behind them.
    labels = {"scene", "fingerprint", "unusable_replies", "mirrorstats.declared"}
    metrics = [at for at, name in enumerate(header) if at >= 5 and name not in labels]
    return [(*row[:3], int(row[3]), int(row[4]), *(int(row[at]) if row[at] else None for at in metrics)) for row in rows]


def independent(program, dialect, folder, extra):
    statement = run(program, "definitions", "sql", "--dialect", dialect, *extra)
    connection = duckdb.connect()
    source = f"read_parquet('{folder}/*.parquet', union_by_name = true)"
    connection.execute(f"CREATE VIEW steps AS SELECT * FROM {source}")
    return connection.execute(statement).fetchall()


def main():
    program, folder, *extra = sys.argv[1:]
    expected = native(program, folder, extra)
    for dialect in "portable", "duckdb":
        found = independent(program, dialect, folder, extra)
        for left, right in zip(expected, found):
            if left != right:
                sys.exit(f"native {left}\nDuckDB, {dialect} {right}")
        if len(expected) != len(found) or not expected:
            sys.exit(f"native has {len(expected)} episodes, DuckDB, {dialect} {len(found)}")
        print(f"{len(found)} episodes, {len(found[0]) - 5} metrics: the same on DuckDB {duckdb.__version__}, {dialect} SQL")


if __name__ == "__main__":
    main()
