"""Runs one rival in a process of its own: `engines.py RIVAL FOLDER OUT [SQL_FILE]` prints the seconds that it took.

Imports and the start of the interpreter are not counted; opening the files and writing the result are. All threads
are used. Rivals: the names of `RIVALS`.
"""

import glob
import os
import sys
import time

import rivals

CORES = os.cpu_count()


def duckdb_query(query):
    import duckdb

    def run(folder, out, sql):
        connection = duckdb.connect(config={"threads": CORES})
        connection.execute(f"CREATE VIEW steps AS SELECT * FROM read_parquet('{folder}/*.parquet')")
        connection.execute(f"COPY ({query or sql}) TO '{out}' (FORMAT parquet, COMPRESSION zstd)")

    return run


def polars_query(by_hand):
    # Polars reads the number of its threads when it is imported.
    os.environ["POLARS_MAX_THREADS"] = str(CORES)
    import polars

    def run(folder, out, sql):
        steps = polars.scan_parquet(f"{folder}/*.parquet", extra_columns="ignore")
        table = rivals.polars_episodes(steps) if by_hand else polars.SQLContext(steps=steps).execute(sql)
        table.sink_parquet(out, compression="zstd", engine="streaming")

    return run


def pandas_query():
    import pandas  # noqa: F401 (imported before the clock starts)
    import pyarrow.parquet

    columns = [*rivals.KEYS, "body_color", "t", "action", "self_color", "selected_cube", "mirror_visible"]
    texts = [name for name in columns if name not in ("seed", "run", "t", "mirror_visible")]

    def run(folder, out, _):
        files = sorted(glob.glob(f"{folder}/*.parquet"))
        steps = pyarrow.parquet.ParquetDataset(files, read_dictionary=texts).read(columns=columns).to_pandas()
        rivals.pandas_episodes(steps).to_parquet(out, compression="zstd", index=False)

    return run


RIVALS = {
    "duckdb-packed": lambda: duckdb_query(rivals.duckdb_episodes(rivals.PACKED)),
    "duckdb-general": lambda: duckdb_query(rivals.duckdb_episodes(rivals.GENERAL)),
    "duckdb-sql": lambda: duckdb_query(None),
    "duckdb-cells": lambda: duckdb_query(rivals.duckdb_cells(rivals.PACKED)),
    "polars": lambda: polars_query(True),
    "polars-sql": lambda: polars_query(False),
    "pandas": pandas_query,
}


def main():
    rival, folder, out, *sql = sys.argv[1:]
    text = open(sql[0], encoding="utf-8").read().rstrip().rstrip(";") if sql else None
    run = RIVALS[rival]()
    start = time.perf_counter()
    run(folder, out, text)
    print(time.perf_counter() - start)


if __name__ == "__main__":
    main()
