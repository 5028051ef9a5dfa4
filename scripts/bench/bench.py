"""Measures `score` and its neighbours beside hand-written queries and generated SQL, and writes benches/RESULTS.md.

`make bench-scores` calls it; `--help` lists what may be changed. The data is generated in two orders: as a study is
recorded, and shuffled. Every contender runs once before any is timed, and its result is compared with ours row by row;
a difference is an error. Then all take turns. A third set has the optional columns of a recording, with values that
hardly repeat: its pages are larger, and the columns that are read are a small part of each file. The last two sets are as
other programs write them, once without checksums and once sealed.
"""

import argparse
import os
import platform
import subprocess
import sys
import zlib
from pathlib import Path

import checks
import contenders as c
import profiling
import scaling
import table
import timing

REPOSITORY = Path(__file__).resolve().parent.parent.parent
ORDERS = (table.SHUFFLED, table.STUDY)
# How each set of data is generated.
OPTIONS = {
    table.SHUFFLED: ["--order", "shuffled"],
    table.STUDY: ["--order", "study"],
    table.RECORDED: ["--order", "shuffled", "--optional"],
    table.WILD: ["--wild"],
}


class Bench:
    """The programs and folders of a benchmark."""

    def __init__(self, program, data):
        self.program = Path(program).resolve()
        self.examples = self.program.parent / "examples"
        self.data = Path(data).resolve()
        self.outputs = self.data / "outputs"
        self.outputs.mkdir(parents=True, exist_ok=True)

    def generate(self, data, steps, files):
        """A folder of traces, made by these builds of the generator and of `trace seal`; folders of other builds are removed."""
        generator = self.examples / "generate"
        name = f"{data}-{steps}-in-{files}"
        made_by = digest(generator) + (digest(self.program) if data == table.SEALED else "")
        folder = self.data / f"{name}-{made_by}"
        if not folder.is_dir():
            for old in self.data.glob(f"{name}-*"):
                timing.remove(old)
            partial = self.data / "partial"
            timing.remove(partial)
            if data == table.SEALED:
                self.seal(self.generate(table.WILD, steps, files), partial)
            else:
                options = [*OPTIONS[data], "--steps", str(steps), "--files", str(files), "--out", partial]
                subprocess.run([generator, *options], check=True)
            partial.rename(folder)
        return folder

    def seal(self, traces, folder):
        """Copies of traces with checksums."""
        folder.mkdir()
        for trace in sorted(traces.glob("*.parquet")):
            timing.run([self.program, "trace", "seal", trace, folder / trace.name])

    def statements(self):
        """The generated SQL, as files by dialect."""
        paths = {}
        for dialect in ("portable", "duckdb"):
            paths[dialect] = self.data / f"{dialect}.sql"
            command = [self.program, "definitions", "sql", "--dialect", dialect]
            paths[dialect].write_bytes(subprocess.run(command, check=True, capture_output=True).stdout)
        return paths

    def contenders(self, folder):
        """All that have turns; the episode to explain is the middle one of the table."""
        scores = self.outputs / "first.parquet"
        timing.run([self.program, "score", folder, "-o", scores])
        listed = c.ours(self.program, checks.middle_episode(scores))
        return listed + c.floors(self.examples) + c.rivals(self.statements())


def digest(path):
    """A file's CRC-32. Read in parts, without a large library: what this process holds counts as its children's peak."""
    found = 0
    with open(path, "rb") as file:
        while block := file.read(1 << 16):
            found = zlib.crc32(block, found)
    return f"{found:08x}"


def machine():
    model = next((line.split(":", 1)[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), "?")
    memory = next(int(line.split()[1]) for line in open("/proc/meminfo") if line.startswith("MemTotal")) / 2**20
    return f"{model}, {os.cpu_count()} cores, {memory:.0f} GB, {platform.system()} {platform.release()}"


def versions(program):
    from importlib import metadata

    found = [subprocess.run([program, "--version"], capture_output=True, text=True).stdout.splitlines()[0]]
    for name in ("duckdb", "polars", "pandas", "pyarrow"):
        try:
            found.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            found.append(f"{name} not installed")
    return ", ".join(found) + f", Python {platform.python_version()}"


def commit():
    """The commit that is measured; its name ends in `-dirty` if files differ from it."""
    command = ["git", "-C", REPOSITORY, "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    found = subprocess.run(command, capture_output=True, text=True)
    return found.stdout.strip() if found.returncode == 0 else "unknown"


def megabytes(folder):
    return sum(path.stat().st_size for path in folder.glob("*.parquet")) / 2**20


def preamble(bench, options, folders, episodes, load):
    sizes = ", ".join(f"{megabytes(folder):.1f} MB {data}" for data, folder in folders.items())
    return [
        "# Results of `make bench-scores`",
        "",
        f"Machine: {machine()}; load average {load:.2f} before the first round.  ",
        f"Commit: {commit()}.  ",
        f"Versions: {versions(bench.program)}.  ",
        f"Traces: {options.steps:,} steps, {episodes:,} episodes, {options.files} files, zstd: {sizes}",
        "(`examples/generate`); warm cache. `shuffled` and `study` have the required columns alone, `recorded` is shuffled and",
        "has the optional columns of a recording with a model, whose values hardly repeat. `wild` is as other programs write",
        "traces: without checksums, many episodes with the same model, experiment, seed and run, and actions, colours, poses,",
        "costs and texts that change with every step. `sealed` is `wild` after `trace seal`.  ",
        f"Rounds: {options.rounds}; in each, every line of the table has one turn on each set.",
        "",
        "Before the first round, every line ran once and was checked. Each episode table has the same rows in the same order as",
        "that of `score`. The query for cells gives the same cells as `report`. `score` writes the same bytes for both orders",
        "and for one thread. Our commands and the floors are whole processes, timed from start to exit. Rivals in Python are",
        "timed inside the process, without imports; they use all cores and write the same table as zstd Parquet. The",
        "hand-written queries are in `scripts/bench/rivals.py`. The generated SQL comes from `mirrorstats definitions sql`.",
        "",
    ]


def epilogue():
    return [
        "",
        "## How to repeat it",
        "",
        "Run `make bench-scores`. For a quick look that does not replace this file, run `make bench-scores STEPS=1400000",
        "ROUNDS=3`. The variables are `STEPS`, `FILES` and `ROUNDS`. `LARGE=140000000` adds a larger set.",
        "Nothing else should run on the machine. `cargo bench --bench kernels` measures the kernels alone.",
        "",
    ]


def parsed():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", default=REPOSITORY / "target/release/mirrorstats")
    parser.add_argument("--data", default=REPOSITORY / "target/bench")
    parser.add_argument("--steps", type=int, default=14_150_000)
    parser.add_argument("--files", type=int, default=4)
    parser.add_argument("--many", type=int, default=40, help="files of the comparison with one file")
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--large", type=int, default=0, help="steps of a larger set, e.g. 140000000; 0 for none")
    parser.add_argument("--skip", default="", help="rivals to leave out, by the names in the table, separated by semicolons")
    parser.add_argument("--results", default=REPOSITORY / "benches/RESULTS.md")
    options = parser.parse_args()
    if min(options.steps, options.files, options.rounds, options.many) < 1:
        parser.error("steps, files and rounds are at least 1")
    return options


def measure(bench, options):
    """Checks and times everything; gives the lines of RESULTS.md and how many goals were missed."""
    folders = {data: bench.generate(data, options.steps, options.files) for data in table.ALL}
    skipped = options.skip.split(";")
    listed = bench.contenders(folders[table.SHUFFLED])
    listed = [contender for contender in listed if contender.own or contender.name not in skipped]
    turns = timing.Turns()
    for data, folder in folders.items():
        episodes = checks.warm_up(turns, data, folder, listed, bench.outputs, options.steps)
    checks.same_in_every_order(bench.outputs, ORDERS)
    load = os.getloadavg()[0]
    timing.round_robin(turns, folders, listed, bench.outputs, options.rounds)

    goals = table.goals(c.SCORE if os.cpu_count() == 2 else c.TWO_THREADS)
    lines = preamble(bench, options, folders, episodes, load) + table.time_lines(turns, [one.name for one in listed])
    lines += ["", "## Goals", "", "Ratios of the shortest times decide; the ratios of medians are in parentheses.", ""]
    lines += table.goal_lines(turns, goals)
    lines += ["", "Files and memory, on shuffled data:", "", "| measure | bound | found | |", "|---|---|---|---|"]
    scales = scaling.files(bench, options.steps, options.many, options.rounds) + scaling.memory(turns, options.steps)
    if options.large:
        scales += scaling.large(bench, turns, options.steps, options.large, options.files)
    lines += scales + profiling.lines(bench.program, folders[table.SHUFFLED], bench.outputs) + epilogue()
    return lines, table.count_missed(turns, goals) + sum("missed" in line for line in scales)


def main():
    options = parsed()
    try:
        lines, missed = measure(Bench(options.program, options.data), options)
    except (checks.Different, timing.Failed) as error:
        sys.exit(f"error: {error}")
    Path(options.results).write_text("\n".join(lines), encoding="utf-8")
    print("\n".join(lines))
    print(f"{missed} goals missed" if missed else "every goal met")


if __name__ == "__main__":
    main()
