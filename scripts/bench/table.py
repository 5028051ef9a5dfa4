"""The tables of RESULTS.md: times of every contender, and the goals with what was found."""

import collections

import contenders as c
import timing

# `ratio(seconds)` takes the seconds of a contender by its name. `least`: whether the goal is a lower bound.
# `orders`: the data on which it must hold; on the other data the ratio is shown for information.
Goal = collections.namedtuple("Goal", "name ratio least bound orders")
STUDY, SHUFFLED, RECORDED, WILD, SEALED = "study", "shuffled", "recorded", "wild", "sealed"
ALL = (SHUFFLED, STUDY, RECORDED, WILD, SEALED)


def fastest_duckdb(seconds):
    return min(seconds(c.PACKED), seconds(c.GENERAL))


def goals(two_threads):
    """The goals; `two_threads` is the name of the contender that runs `score` on two threads."""
    return [
        Goal("the faster DuckDB query by hand / `score`", lambda s: fastest_duckdb(s) / s(c.SCORE), True, 3.5, (SHUFFLED, RECORDED, WILD, SEALED)),
        Goal("DuckDB's query for cells / `report --no-figures`", lambda s: s(c.CELLS) / s(c.REPORT), True, 2.5, ALL),
        Goal("`score` / page floor", lambda s: s(c.SCORE) / s(c.PAGES), False, 4.3, ALL),
        Goal("`score` / library decode", lambda s: s(c.SCORE) / s(c.DECODE), False, 1.45, ALL),
        Goal("`report --no-figures` / `score`", lambda s: s(c.REPORT) / s(c.SCORE), False, 1.3, ALL),
        Goal("`stats` / `score`", lambda s: s(c.STATS) / s(c.SCORE), False, 2.5, ALL),
        Goal("`validate` / `score`", lambda s: s(c.VALIDATE) / s(c.SCORE), False, 1.3, ALL),
        Goal("`info` / `score`", lambda s: s(c.INFO) / s(c.SCORE), False, 0.4, ALL),
        Goal("`diff` / `score`", lambda s: s(c.DIFF) / s(c.SCORE), False, 1.6, ALL),
        Goal("`score`: one thread / two threads", lambda s: s(c.ONE_THREAD) / s(two_threads), True, 1.6, ALL),
    ]


def ratio_of(goal, seconds):
    """The ratio, or None where a contender of it was not measured."""
    try:
        return goal.ratio(seconds)
    except TypeError:
        return None


def verdict(found, goal):
    if found is None:
        return "missed: not measured"
    holds = found >= goal.bound if goal.least else found <= goal.bound
    return "met" if holds else "**missed**"


def goal_lines(turns, listed):
    """The goals, judged by the shortest times; the ratio of medians stands beside."""
    lines = ["| goal | bound | " + " | | ".join(f"{data} (medians)" for data in ALL) + " | |", "|---|---" + "|---|---" * len(ALL) + "|"]
    for goal in listed:
        cells = []
        for data in ALL:
            found = ratio_of(goal, lambda name: turns.best(data, name))
            median = ratio_of(goal, lambda name: turns.median(data, name))
            shown = "" if found is None else f"{found:.2f} ({median:.2f})"
            cells += [shown, verdict(found, goal) if data in goal.orders else "not a goal"]
        lines.append(f"| {goal.name} | {'at least' if goal.least else 'at most'} {goal.bound:g} | {' | '.join(cells)} |")
    return lines


def count_missed(turns, listed):
    judged = [(goal, data) for goal in listed for data in goal.orders]
    return sum(verdict(ratio_of(goal, lambda name: turns.best(data, name)), goal) != "met" for goal, data in judged)


def time_lines(turns, names):
    """Shortest and median time, times `score`, and peak memory, on each set of data."""
    half = "best s | median s | x score | peak MB"
    lines = ["| | " + " | ".join(f"{data}: {half}" for data in ALL) + " |", "|---" + "|---:" * 4 * len(ALL) + "|"]
    for name in names:
        cells = [cell for data in ALL for cell in time_cells(turns, data, name)]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    for (data, name), reason in turns.failed.items():
        lines += ["", f"{name} is not measured on the {data} data: {reason}"]
    return lines


def time_cells(turns, data, name):
    best = turns.best(data, name)
    if best is None:
        return ["not measured", "", "", ""]
    peak, smallest = turns.peak(data, name), timing.smallest_peak()
    memory = f"{peak:.0f}" if peak > smallest else f"< {smallest:.0f}"
    return [f"{best:.3f}", f"{turns.median(data, name):.3f}", f"{best / turns.best(data, c.SCORE):.2f}", memory]
