"""How time and memory grow with each dimension of a study: `shape.py --program PROGRAM`, which writes benches/SHAPE.md.

`make bench-shape` calls it. One dimension at a time grows while the others stay: steps of an episode, episodes, files,
models, metrics, columns. The exponent is the slope of log(processor time) over log(size), without the time that the program
takes for the smallest trace: 1 is proportional, 0 is independent. Processor time is that of the process and all its
threads, so that other programs on the machine disturb it less than time on the wall.
"""

import argparse
import collections
import math
import subprocess
import sys
from pathlib import Path

import bench
import timing

COMMANDS = {
    "score": lambda folder, more, out: ["score", folder, *more, "-o", out / "scores.parquet"],
    "report --no-figures": lambda folder, more, out: ["report", folder, *more, "--no-figures", "--out", out / "report"],
    "stats": lambda folder, more, out: ["stats", folder, *more],
    "trace validate": lambda folder, more, out: ["trace", "validate", folder],
    "trace info": lambda folder, more, out: ["trace", "info", folder],
}
MOST = 1.05
# The traces of a dimension at one size, and what the commands get beside the folder.
Study = collections.namedtuple("Study", "steps longest files models columns metrics", defaults=(100, 1, 4, 3, 10))
# By dimension: what it is called, its smaller and its larger size, and the study at a size.
DIMENSIONS = [
    ("steps of an episode", 100, 1000, lambda size: Study(5_000 * size, longest=size)),
    ("episodes", 7_000, 70_000, lambda size: Study(71 * size)),
    ("files", 1, 1000, lambda size: Study(500_000, files=size)),
    ("models", 4, 40, lambda size: Study(500_000, models=size)),
    ("metrics", 10, 100, lambda size: Study(500_000, metrics=size)),
    ("columns", 15, 150, lambda size: Study(200_000, columns=size - 12)),
]


def definitions(metrics, path):
    """As many metrics as asked for, all different."""
    parts = ["include = []\n"]
    for at in range(metrics):
        parts.append(f'[metric.M{at}]\ntitle = "Turns after step {at}"\nvalue = "count(action = \'turn_left\' and t > {at})"\n')
    path.write_text("\n".join(parts))
    return path


class Shape:
    def __init__(self, options):
        self.program, self.rounds = options.program.resolve(), options.rounds
        self.generate = self.program.parent / "examples/generate"
        self.work = options.data.resolve() / "shape"
        self.work.mkdir(parents=True, exist_ok=True)

    def traces(self, study):
        folder = self.work / "traces"
        timing.remove(folder)
        shape = ["--longest", study.longest, "--models", study.models, "--columns", study.columns, "--files", study.files]
        command = [self.generate, "--wild", "--steps", study.steps, *shape, "--out", folder]
        subprocess.run([str(part) for part in command], check=True)
        return folder

    def best(self, command):
        """The least processor time in seconds, and the most memory in MB."""
        runs = []
        for _ in range(self.rounds):
            timing.remove(self.work / "report")
            runs.append(timing.run([self.program, *command])[0])
        return min(run.processor for run in runs), max(run.megabytes for run in runs)

    def at(self, study):
        """By command: seconds and megabytes."""
        folder = self.traces(study)
        more = ["--definitions", definitions(study.metrics, self.work / "many.toml")]
        return {name: self.best(command(folder, more, self.work)) for name, command in COMMANDS.items()}


def lines(shape):
    start = {name: seconds for name, (seconds, _) in shape.at(Study(1)).items()}
    above = 0
    yield "| dimension | command | s | s | exponent | MB | MB |"
    yield "|---|---|---:|---:|---:|---:|---:|"
    for dimension, small, large, study in DIMENSIONS:
        first, second = shape.at(study(small)), shape.at(study(large))
        for name in COMMANDS:
            (seconds, peak), (more_seconds, more_peak) = first[name], second[name]
            # Runs of the same command differ by some milliseconds.
            own = [max(found - start[name], 0.005) for found in (seconds, more_seconds)]
            exponent = math.log(own[1] / own[0]) / math.log(large / small)
            above += exponent > MOST
            shown = f"**{exponent:.2f}**" if exponent > MOST else f"{exponent:.2f}"
            sizes = f"{dimension}: {small:,} to {large:,}"
            yield f"| {sizes} | `{name}` | {seconds:.3f} | {more_seconds:.3f} | {shown} | {peak:.0f} | {more_peak:.0f} |"
            print(f"{sizes}, {name}: {exponent:.2f}", file=sys.stderr, flush=True)
    yield ""
    yield f"{above} exponents are above {MOST}." if above else f"No exponent is above {MOST}."


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=Path, default=bench.REPOSITORY / "target/release/mirrorstats")
    parser.add_argument("--data", type=Path, default=bench.REPOSITORY / "target/bench")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--results", type=Path, default=bench.REPOSITORY / "benches/SHAPE.md")
    options = parser.parse_args()
    text = [
        "# Results of `make bench-shape`",
        "",
        f"Machine: {bench.machine()}. Commit: {bench.commit()}.",
        "",
        "One dimension grows, the others stay. The traces are as other programs write them (`examples/generate --wild`):",
        "episodes of 1 to 100 steps, one file, 4 models, 15 columns, 10 metrics. Seconds are processor time, the least of",
        f"{options.rounds} runs; megabytes are the peak. The exponent is that of a power law through both sizes, without the time",
        "that the program takes for one step: 1 is proportional, 0 is independent.",
        "",
        *lines(Shape(options)),
        "",
    ]
    options.results.write_text("\n".join(text), encoding="utf-8")
    print("\n".join(text))


if __name__ == "__main__":
    main()
