"""Runs every contender once and checks its result before any is timed. That run warms the cache, too.

A rival that gives another result than ours is an error, and so is a failure of ours. A rival that fails is left out,
and the table says why.
"""

import filecmp
import sys
from pathlib import Path

import contenders as c
import timing

HERE = Path(__file__).resolve().parent
COLUMNS = 11


class Different(Exception):
    """Two results that must be the same."""


def compare(kind, ours, theirs, name):
    """The number of rows of two results that are the same."""
    try:
        # In a process of its own: what this one holds in memory would count as its children's peak.
        return int(timing.run([sys.executable, HERE / "same.py", kind, ours, theirs])[1])
    except timing.Failed as failure:
        raise Different(f"{name}: {failure}") from None


def middle_episode(table):
    return timing.run([sys.executable, HERE / "same.py", "middle", table])[1].strip()


def printed_number(printed, expected, name):
    if int(printed.split()[0]) != expected:
        raise Different(f"{name}: expected {expected}, found {printed.strip()}")


def warm_up(turns, data, folder, listed, outputs, steps):
    """Runs all on one set of data and checks the results; gives the number of episodes."""
    printed = {}
    for contender in listed:
        printed[contender.name] = turns.take(data, folder, contender, outputs, counts=False)
    reference = outputs / f"{data}-score.parquet"
    episodes = compare("episodes", reference, outputs / f"{data}-report/episodes.parquet", c.REPORT)
    for contender in listed:
        if contender.out is None or printed[contender.name] is None or contender.name in (c.SCORE, c.REPORT):
            continue
        found = outputs / f"{data}-{contender.out}"
        if contender.name == c.CELLS:
            compare("cells", outputs / f"{data}-report/cells.csv", found, contender.name)
        elif contender.own and not filecmp.cmp(reference, found, shallow=False):
            raise Different(f"{contender.name}: other bytes than those of {c.SCORE}")
        else:
            compare("episodes", reference, found, contender.name)
    printed_number(printed[c.DECODE], steps, c.DECODE)
    printed_number(printed[c.PAGES], COLUMNS * steps, c.PAGES)
    return episodes


def same_in_every_order(outputs, orders):
    """The files of both orders hold the same episodes, so their scores are the same bytes."""
    first, *others = [outputs / f"{order}-score.parquet" for order in orders]
    if not all(filecmp.cmp(first, other, shallow=False) for other in others):
        raise Different(f"other bytes from {' and '.join(orders)}")
