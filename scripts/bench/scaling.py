"""How time and memory of `score` change with the number of files and of steps."""

import statistics

import contenders as c
import timing

ROUNDS_OF_LARGE = 3


def score(program, folder, out):
    timing.remove(out)
    return timing.run([program, "score", folder, "-o", out])[0]


def line(measure, bound, found, holds):
    return f"| {measure} | {bound} | {found} | {'met' if holds else '**missed**'} |"


def files(bench, steps, many, rounds):
    """One file against many, in turns."""
    folders = {count: bench.generate("shuffled", steps, count) for count in (1, many)}
    seconds = {count: [] for count in folders}
    for _ in range(rounds):
        for count, folder in folders.items():
            seconds[count].append(score(bench.program, folder, bench.outputs / "split.parquet").seconds)
    for folder in folders.values():
        timing.remove(folder)
    shape = min(seconds[1]) / min(seconds[many])
    return [line(f"`score`: one file / {many} files", "0.8 to 1.25", f"{shape:.2f}", 0.8 <= shape <= 1.25)]


def memory(turns, steps):
    peak = turns.peak("shuffled", c.SCORE)
    return [line(f"`score`: peak memory, {steps:,} steps", "under 300 MB", f"{peak:.0f} MB", peak < 300)]


def large(bench, turns, steps, more, count):
    """`more` steps against `steps`, in as many more files."""
    folder = bench.generate("shuffled", more, count * max(1, more // steps))
    out = bench.outputs / "large.parquet"
    runs = [score(bench.program, folder, out) for _ in range(ROUNDS_OF_LARGE + 1)][1:]
    timing.remove(folder)
    timing.remove(out)
    before, after = turns.peak("shuffled", c.SCORE), max(run.megabytes for run in runs)
    seconds = statistics.median(run.seconds for run in runs)
    growth, most = seconds / turns.median("shuffled", c.SCORE), 1.05 * more / steps
    apart = abs(after - before) / before
    return [
        line(f"`score`: peak memory, {more:,} steps", "under 300 MB", f"{after:.0f} MB", after < 300),
        line("the two peaks", "within 10 %", f"{apart:.1%}", apart <= 0.1),
        line(f"`score`: time, {more:,} / {steps:,} steps", f"at most {most:.1f}", f"{growth:.2f} ({seconds:.2f} s)", growth <= most),
    ]
