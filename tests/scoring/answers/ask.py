"""Answers SQL statements over steps.parquet and episodes.parquet: one JSON text per line in, one JSON object per line out."""

import json
import math
import sys

import duckdb

connection = duckdb.connect()
for table in ["steps", "episodes"]:
    connection.execute(f"CREATE TABLE {table} AS SELECT * FROM read_parquet('{sys.argv[1]}/{table}.parquet')")


def cell(value):
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, int):
        return {"int": str(value)}
    value = float(value)
    return {"float": value if math.isfinite(value) else str(value)}


for line in sys.stdin:
    try:
        rows = connection.execute(json.loads(line)).fetchall()
        answer = {"rows": [[cell(value) for value in row] for row in rows]}
    except duckdb.Error as error:
        answer = {"error": str(error)}
    print(json.dumps(answer), flush=True)
