"""Times the import of Parquet beside Polars: `import_parquet.py --program PROGRAM --data FOLDER`.

`scripts/bench/import_parquet.sh` calls it. The file has the columns of the schema and two of its own, in row groups of
Polars' default size. Polars reads all columns and writes them again with Zstandard, as the import does. Both take turns.
The exit code is 1 if the import takes more than twice the time of Polars, or more than 500 MB.
"""

import argparse
import statistics
import sys
from pathlib import Path

import polars as pl
import timing

EPISODE = 40
COPY = """
import sys, time, polars
start = time.perf_counter()
polars.scan_parquet(sys.argv[1]).sink_parquet(sys.argv[2], compression="zstd")
print(time.perf_counter() - start)
"""
MOST_TIMES, MOST_MEGABYTES = 2.0, 500.0


def pick(number, texts):
    """One of the texts in each row, by a number."""
    return number.mod(len(texts)).replace_strict(list(range(len(texts))), texts, return_dtype=pl.String)


def steps(count):
    """Steps of whole episodes, in order."""
    row = pl.int_range(count, dtype=pl.Int64)
    episode, t = row.floordiv(EPISODE), row.mod(EPISODE) + 1
    # Products with large primes, so that neighbouring rows differ.
    noise = (row * 2_654_435_761).mod(1_000_003)
    colors = ["blue", "brown", "cyan", "green", "orange", "pink", "purple", "red", "white", "yellow"]
    actions = ["move_forward", "move_backward", "turn_left", "turn_right"]
    return pl.select(
        episode_id=pl.format("{}-{}", pick(episode, ["a", "b", "c"]), episode),
        model=pick(episode, ["model-a", "model-b", "model-c", "model-d"]),
        experiment=pick(episode, ["E1", "E2", "E3", "E4", "E5"]),
        seed=(episode.mod(3) + 1).cast(pl.Int32),
        run=episode.cast(pl.Int32),
        body_color=pick(episode, colors),
        t=t.cast(pl.Int32),
        action=pl.when(t == EPISODE).then(pl.lit("done")).otherwise(pick(noise, actions)),
        self_color=pl.when(noise.mod(3) == 0).then(None).otherwise(pick(noise, colors)),
        selected_cube=pick(noise.floordiv(7), colors),
        mirror_visible=noise.mod(2) == 0,
        mirror_self_px=noise.mod(4000).cast(pl.Int32),
        pose_x=(noise / 1000.0).cast(pl.Float32),
        gain=noise / 7.0,
        tries=noise.mod(5),
    )


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=14_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    options.data.mkdir(parents=True, exist_ok=True)
    source = options.data / f"steps-{options.steps}.parquet"
    if not source.exists():
        steps(options.steps).write_parquet(source.with_suffix(".new"), compression="zstd")
        source.with_suffix(".new").rename(source)
    out = options.data / "out.parquet"
    commands = {
        "import": ([options.program, "import", source, "-o", out], False),
        "polars": ([sys.executable, "-c", COPY, source, out], True),
    }
    runs = {name: [] for name in commands}
    for _ in range(options.rounds):
        for name, (command, inside) in commands.items():
            timing.remove(out)
            taken, _ = timing.run(command, inside)
            runs[name].append(taken)
            print(f"{name}: {taken.seconds:.2f} s, {taken.megabytes:.0f} MB, {taken.processor:.2f} s on processors", flush=True)
    seconds = {name: statistics.median(run.seconds for run in taken) for name, taken in runs.items()}
    times, megabytes = seconds["import"] / seconds["polars"], max(run.megabytes for run in runs["import"])
    print(f"{options.steps} steps: {times:.2f} times the time of Polars, {megabytes:.0f} MB")
    sys.exit(times > MOST_TIMES or megabytes > MOST_MEGABYTES)


if __name__ == "__main__":
    main()
