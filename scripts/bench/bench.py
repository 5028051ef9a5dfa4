"""Measures `score` beside other engines on generated traces, in turn, and writes benches/RESULTS.md.

`make bench-scores` calls it; `--help` lists what may be changed. Times are wall-clock; of a process of ours, the whole
process; of a Python engine, the work without imports and without the start of the interpreter. Peak memory is the
process's largest resident set.
"""

import argparse
import collections
import json
import os
import platform
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parent.parent
KEYS = 5
Run = collections.namedtuple("Run", "seconds megabytes")


def child(command, inside=False):
    """Runs a command: its seconds (as it says itself if `inside`), its peak memory."""
    import time

    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as errors:
        start = time.perf_counter()
        process = subprocess.Popen([str(part) for part in command], stdout=out, stderr=errors)
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode != 0:
            errors.seek(0)
            raise RuntimeError(f"{command[0]} ... {command[-1]}: {errors.read().strip()[-400:]}")
        if inside:
            out.seek(0)
            seconds = float(out.read().split()[-1])
        return Run(seconds, usage.ru_maxrss / 1024)


class Bench:
    def __init__(self, options):
        self.options = options
        self.data = Path(options.data).resolve()
        self.program = Path(options.program).resolve()
        # A program with Polars in it is some 100 MB larger and starts more slowly, so the others are measured without it.
        self.polars = Path(options.polars or options.program).resolve()
        self.examples = self.program.parent / "examples"
        self.data.mkdir(parents=True, exist_ok=True)
        self.sql = {}
        for dialect in ("portable", "duckdb"):
            path = self.data / f"{dialect}.sql"
            path.write_text(self.say("sql", "--dialect", dialect), encoding="utf-8")
            self.sql[dialect] = path

    def say(self, *arguments):
        return subprocess.run([self.program, *arguments], check=True, capture_output=True, text=True).stdout

    def generate(self, steps, files):
        folder = self.data / f"{steps}-in-{files}"
        if not folder.is_dir():
            partial = self.data / "partial"
            shutil.rmtree(partial, ignore_errors=True)
            subprocess.run([self.examples / "generate", "--steps", str(steps), "--files", str(files), "--out", partial], check=True)
            partial.rename(folder)
        return folder

    def contenders(self):
        python = [sys.executable, HERE / "engines.py"]
        return {
            "native": lambda folder, out: child([self.program, "score", folder, "-o", out]),
            "bare decode": lambda folder, out: child([self.examples / "decode", folder]),
            "--engine polars": lambda folder, out: child([self.polars, "score", "--engine", "polars", folder, "-o", out]),
            "DuckDB": lambda folder, out: child([*python, "duckdb", folder, out, self.sql["duckdb"]], inside=True),
            "Polars (Python)": lambda folder, out: child([*python, "polars", folder, out, self.sql["portable"]], inside=True),
            "pandas": lambda folder, out: child([*python, "pandas", folder, out], inside=True),
        }

    def measure(self, folder, names, rounds):
        """Rounds in which each takes its turn; those that fail are left out from then on, with the reason."""
        runs, notes = collections.defaultdict(list), {}
        contenders = self.contenders()
        for turn in range(rounds + 1):
            for name in names:
                if name in notes or (name == "pandas" and turn > 1):
                    continue
                out = self.data / f"out-{re.sub('[^a-z]', '', name.lower())}.parquet"
                # Some file systems take longer where there is a file to replace.
                out.unlink(missing_ok=True)
                try:
                    run = contenders[name](folder, out)
                except RuntimeError as error:
                    notes[name] = " ".join(str(error).split())
                    continue
                # The first round warms the cache.
                if turn > 0:
                    runs[name].append(run)
                print(f"round {turn}: {name}: {run.seconds:.3f} s, {run.megabytes:.0f} MB", file=sys.stderr, flush=True)
        return runs, notes

    def sums(self, name):
        """Rows, then the count and sum of each metric."""
        path = self.data / f"out-{re.sub('[^a-z]', '', name.lower())}.parquet"
        # In a process of its own: what this one holds in memory would count as its children's peak.
        command = [sys.executable, HERE / "engines.py", "sums", path, str(KEYS)]
        return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)

    def profile(self, folder):
        """Where native's time goes, by stage, if Linux's perf is here."""
        if not shutil.which("perf"):
            return None
        record = self.data / "perf.data"
        out = self.data / "out-profile.parquet"
        command = ["perf", "record", "-F", "4000", "-g", "-o", record, self.program, "score", folder, "-o", out]
        if subprocess.run(command, capture_output=True).returncode != 0:
            return None
        report = ["perf", "report", "-i", record, "--no-children", "-g", "none", "--sort", "dso,symbol", "--stdio"]
        return subprocess.run(report, capture_output=True, text=True).stdout


# Which part of the work a function belongs to; the first pattern that fits.
STAGES = [
    ("decompression (zstd)", r"ZSTD_decompress|HUF_decompress|ZSTD_(?!compress).*(decode|Seq)|zstd.*decomp|FSE_read|FSE_build.*DTable|XXH|HUF_read"),
    ("compression of the output", r"ZSTD_|HUF_|FSE_"),
    ("pages: runs and keys", r"trace.*(pages|hybrid|chunk)"),
    ("output", r"ArrowWriter|arrow_writer|encod|writer|score.*format"),
    ("decoding", r"parquet"),
    ("rules and cutting into episodes", r"mirrorstats.*trace|trace::"),
    ("ordering the rows", r"score.*rows|base.*runs|Merge|slice.*sort|driftsort|quicksort|smallsort|insertion_sort"),
    ("kernels", r"mirrorstats.*score|arrow"),
    ("memory (copies, pages)", r"mem(cpy|move|set|cmp|chr)|alloc|free|clear_page|page_fault|fault|copy_"),
    ("kernel, reading files", r"\[k\]"),
]


def stages(report):
    shares = collections.Counter()
    top = []
    for line in report.splitlines():
        match = re.match(r"\s*([\d.]+)%\s+(\S+)\s+(\[.\])\s+(.*)", line)
        if not match:
            continue
        share, symbol = float(match[1]), f"{match[3]} {match[4].strip()}"
        stage = next((name for name, pattern in STAGES if re.search(pattern, symbol)), "other")
        shares[stage] += share
        top.append((share, match[4].strip()))
    return shares, top[:15]


def machine():
    model = next((line.split(":", 1)[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), "?")
    memory = next(int(line.split()[1]) for line in open("/proc/meminfo") if line.startswith("MemTotal")) / 2**20
    return f"{model}, {os.cpu_count()} cores, {memory:.0f} GB, {platform.system()} {platform.release()}"


def versions(program):
    from importlib import metadata

    found = [subprocess.run([program, "--version"], capture_output=True, text=True).stdout.strip()]
    for name in ("duckdb", "polars", "pandas", "pyarrow"):
        try:
            found.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            found.append(f"{name} not installed")
    return ", ".join(found) + f", Python {platform.python_version()}"


def median(runs):
    return statistics.median(run.seconds for run in runs)


def peak(runs):
    return max(run.megabytes for run in runs)


def size(folder):
    return sum(path.stat().st_size for path in folder.glob("*.parquet")) / 2**20


def verdict(found, holds):
    return f"{found} | {'yes' if holds else 'no'}"


def table_of(runs, notes, names, reference):
    lines = ["| engine | median s | min to max s | times native | peak MB |", "|---|---|---|---|---|"]
    for name in names:
        if name in notes:
            lines.append(f"| {name} | not measured: {notes[name]} | | | |")
            continue
        times = [run.seconds for run in runs[name]]
        lines.append(
            f"| {name} | {statistics.median(times):.3f} | {min(times):.3f} to {max(times):.3f} | "
            f"{statistics.median(times) / reference:.2f} | {peak(runs[name]):.0f} |"
        )
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", default=REPOSITORY / "target/release/mirrorstats")
    parser.add_argument("--polars", default="", help="a program with `--engine polars` built in")
    parser.add_argument("--data", default=REPOSITORY / "target/bench")
    parser.add_argument("--steps", type=int, default=14_000_000)
    parser.add_argument("--files", type=int, default=4)
    parser.add_argument("--many", type=int, default=40, help="files of the split")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--large", type=int, default=0, help="steps of a larger set, e.g. 140000000; 0 for none")
    parser.add_argument("--skip", default="", help="engines to leave out, separated by commas")
    parser.add_argument("--results", default=REPOSITORY / "benches/RESULTS.md")
    options = parser.parse_args()
    bench = Bench(options)
    folder = bench.generate(options.steps, options.files)
    names = [name for name in bench.contenders() if name not in options.skip.split(",")]
    runs, notes = bench.measure(folder, names, options.rounds)
    reference = median(runs["native"])

    expected = bench.sums("native")
    writers = [name for name in names if name in runs and name != "bare decode"]
    different = [name for name in writers if bench.sums(name) != expected]
    if different:
        sys.exit(f"other numbers than native's from {', '.join(different)}")

    one, many = bench.generate(options.steps, 1), bench.generate(options.steps, options.many)
    split = {1: [], options.many: []}
    for _ in range(options.rounds):
        for count, where in ((1, one), (options.many, many)):
            split[count].append(bench.contenders()["native"](where, bench.data / "out-split.parquet"))

    lines = [
        "# Results of `make bench-scores`",
        "",
        f"Machine: {machine()}.  ",
        f"Versions: {versions(bench.program)}.  ",
        f"Traces: {options.steps:,} steps, {expected[0]:,} episodes, {options.files} files, {size(folder):.0f} MB "
        f"(`examples/generate`), warm cache; {options.rounds} rounds, every engine in its turn, after one that does not count.",
        "",
        "`native` and `bare decode` are whole processes, from start to exit: `mirrorstats score TRACES -o out.parquet`, and",
        "`examples/decode` over the same eleven columns on all cores. Engines in Python are timed inside, without imports;",
        "they run `mirrorstats sql` and write the same table, which is not there before. pandas runs once. "
        "All of them gave the same number of episodes and, metric by metric, the same count and sum.",
        "",
        *table_of(runs, notes, names, reference),
        "",
        "## What must hold",
        "",
        "| measure | at least | found | holds |",
        "|---|---|---|---|",
    ]

    def ratio(name):
        return median(runs[name]) / reference if name in runs else None

    for title, name, least in (("DuckDB / native", "DuckDB", 5), ("Polars streaming (Python) / native", "Polars (Python)", 15)):
        if (found := ratio(name)) is not None:
            lines.append(f"| {title} | {least} | {verdict(f'{found:.1f}', found >= least)} |")
    if (found := ratio("bare decode")) is not None:
        lines.append(f"| native / bare decode | at most 1.5 | {verdict(f'{1 / found:.2f}', 1 / found <= 1.5)} |")
    shape = statistics.median(run.seconds for run in split[1]) / median(split[options.many])
    lines.append(f"| one file / {options.many} files | 0.8 to 1.25 | {verdict(f'{shape:.2f}', 0.8 <= shape <= 1.25)} |")
    small_peak = peak(runs["native"])
    lines.append(f"| peak memory at {options.steps:,} steps | under 300 MB | {verdict(f'{small_peak:.0f} MB', small_peak < 300)} |")

    if options.large:
        shutil.rmtree(one)
        shutil.rmtree(many)
        large = bench.generate(options.large, options.files * max(1, options.large // options.steps))
        big, more = bench.measure(large, ["native"], 3)
        if more:
            sys.exit(more["native"])
        episodes = bench.sums("native")[0]
        factor = options.large / options.steps
        seconds, memory = median(big["native"]), peak(big["native"])
        growth = seconds / reference
        lines.append(f"| peak memory at {options.large:,} steps | under 300 MB | {verdict(f'{memory:.0f} MB', memory < 300)} |")
        apart = abs(memory - small_peak) / small_peak
        lines.append(f"| the two peaks | within 10 % | {verdict(f'{apart:.1%}', apart <= 0.1)} |")
        found = verdict(f"{growth:.2f} ({seconds:.2f} s, {episodes:,} episodes)", growth <= 1.05 * factor)
        lines.append(f"| time at {options.large:,} / time at {options.steps:,} | at most {1.05 * factor:.1f} | {found} |")
        shutil.rmtree(large)

    report = bench.profile(folder)
    if report:
        shares, top = stages(report)
        lines += ["", "## Where native's time goes", "", "Linux `perf`, cycles of all threads, by what a function belongs to:", ""]
        lines += ["| stage | share |", "|---|---|"]
        lines += [f"| {stage} | {share:.0f} % |" for stage, share in shares.most_common() if share >= 0.5]
        lines += ["", "The functions at the top:", "", "```text"]
        lines += [f"{share:5.1f} %  {symbol[:110].rstrip()}" for share, symbol in top] + ["```"]

    lines += [
        "",
        "## How to repeat it",
        "",
        "`make bench-scores` (variables: `STEPS`, `FILES`, `ROUNDS`, `LARGE=140000000` for the larger set, which takes 5 GB of disk",
        "for a while; `BENCH_FEATURES=polars` builds a second program with `--engine polars`, minutes). `cargo bench --bench kernels` measures",
        "the kernels alone.",
        "",
    ]
    Path(options.results).write_text("\n".join(lines), encoding="utf-8")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
