"""Compares results row by row, in a process of its own: `same.py episodes OURS THEIRS` or `same.py cells OURS THEIRS`.

Episode tables are Parquet and must have the same rows in the same order. Cells are our cells.csv and a Parquet file,
in any order. Exits with 1 and the first difference. `same.py middle TABLE` prints the id of the middle episode.
"""

import csv
import sys

import duckdb

MOMENTS = ("n", "sum", "sum_sq")


def rows(path):
    result = duckdb.execute(f"SELECT * FROM read_parquet('{path}')")
    # The portable statement has TSA_C for TSA-C.
    names, types = zip(*((name.replace("-", "_"), str(kind)) for name, kind, *_ in result.description))
    if any(kind in ("FLOAT", "DOUBLE") for kind in types):
        sys.exit(f"{path} has columns that are not integers: {types}")
    return list(names), result.fetchall()


def episodes(ours, theirs):
    (expected_names, expected), (found_names, found) = rows(ours), rows(theirs)
    if expected_names != found_names:
        sys.exit(f"columns: ours {expected_names}, theirs {found_names}")
    if len(expected) != len(found) or not expected:
        sys.exit(f"episodes: ours {len(expected)}, theirs {len(found)}")
    for at, (left, right) in enumerate(zip(expected, found)):
        if left != right:
            sys.exit(f"row {at}: ours {left}, theirs {right}")
    print(len(expected))


def cells(ours, theirs):
    with open(ours, newline="", encoding="utf-8") as file:
        expected = {
            (row["experiment"], row["model"], row["metric"]): tuple(int(row[name]) for name in MOMENTS)
            for row in csv.DictReader(file)
        }
    found = {row[:3]: row[3:] for row in rows(theirs)[1]}
    if expected.keys() != found.keys() or not expected:
        sys.exit(f"cells: only one side has {sorted(expected.keys() ^ found.keys())[:3]}")
    for key, moments in expected.items():
        if moments != found[key]:
            sys.exit(f"cell {key}: ours {moments}, theirs {found[key]}")
    print(len(expected))


def middle(table):
    names, found = rows(table)
    print(found[len(found) // 2][names.index("episode_id")])


if __name__ == "__main__":
    {"episodes": episodes, "cells": cells, "middle": middle}[sys.argv[1]](*sys.argv[2:])
