"""Times the wheel beside the program and Polars, and says which limit does not hold: `python.py FOLDER [WHEEL]`.

The interpreter has the wheel and Polars; FOLDER holds some 14 M steps, as `cargo run --release --example generate` makes them.
Contenders take turns. Exits with 1 if a limit is exceeded.
"""

import pathlib
import statistics
import subprocess
import sys
import tempfile

from timing import run

ROUNDS = 7
PYTHON = sys.executable
PROGRAM = pathlib.Path(PYTHON).parent / "mirrorstats"
# The seconds inside of a process, printed last.
INSIDE = "import sys, time, {imports}; start = time.perf_counter(); {work}; print(time.perf_counter() - start)"


def inside(imports, work, folder):
    return [PYTHON, "-c", INSIDE.format(imports=imports, work=work), folder]


def in_turns(contenders):
    """The median seconds of each contender, and its largest peak memory."""
    found = {name: [] for name in contenders}
    for _ in range(ROUNDS):
        for name, (command, is_inside) in contenders.items():
            found[name].append(run(command, is_inside)[0])
    for name, runs in found.items():
        seconds = statistics.median(one.seconds for one in runs)
        print(f"{name:40} {seconds:8.3f} s {max(one.megabytes for one in runs):8.0f} MB")
    return [statistics.median(one.seconds for one in runs) for runs in found.values()]


def main(folder, wheel=None):
    faults = []

    def check(words, value, most):
        print(f"{words}: {value:.2f} (at most {most})\n")
        if value > most:
            faults.append(words)

    imported, plain = in_turns(
        {"import mirrorstats": ([PYTHON, "-c", "import mirrorstats"], False), "python": ([PYTHON, "-c", "pass"], False)}
    )
    check("import, ms", (imported - plain) * 1000, 50)
    with tempfile.TemporaryDirectory() as out:
        episodes, score = in_turns(
            {
                "study.episodes": ([PYTHON, "-c", "import sys, mirrorstats as ms; ms.open(sys.argv[1]).episodes", folder], False),
                "mirrorstats score": ([PROGRAM, "score", folder, "-o", f"{out}/scores.parquet"], False),
            }
        )
    check("study.episodes / score, whole processes", episodes / score, 1.05)
    steps, polars = in_turns(
        {
            "steps().to_polars()": (inside("mirrorstats, polars", "mirrorstats.open(sys.argv[1]).steps().to_polars()", folder), True),
            "polars.read_parquet": (inside("polars", "polars.read_parquet(sys.argv[1] + '/*.parquet')", folder), True),
        }
    )
    check("steps to Polars / polars.read_parquet", steps / polars, 2)
    if wheel:
        check("wheel, MB", pathlib.Path(wheel).stat().st_size / 1e6, 45)
    return f"exceeded: {'; '.join(faults)}" if faults else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
