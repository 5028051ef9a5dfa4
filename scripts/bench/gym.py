"""Times `mirrorstats.gym` beside `mirrorstats.record`, and says which limit does not hold: benches/WORLD.md.

`make bench-gym` calls it. The interpreter has the wheel, Gymnasium and NumPy. Contenders alternate, and a ratio is the median
of those of the rounds. Exits with 1 if a limit is exceeded.
"""

import argparse
import json
import os
import statistics
import tempfile
import time

import gymnasium
import mirrorstats as ms
import numpy
from mirrorstats.gym import MirrorEnv

SMALL = {"eye": {"width": 84, "height_px": 84, "samples": 0}}
STEPS = 100
LETTERS = ("w", "s", "a", "d", "done")
PAGE = os.sysconf("SC_PAGE_SIZE")


def move(t):
    """Walks, and turns at every fourth step."""
    return "d" if t % 4 == 0 else "w"


def reply(action, keys):
    known = {"action": action, "selected_cube": "none", "identification": "unknown"}
    return json.dumps({key: known.get(key, "") for key in keys})


def keys_of(experiment):
    env = MirrorEnv(experiment, config=SMALL)
    system = env.reset()[1]["prompt"]["system"]
    keys = ["view-description", "reasoning", "action", "summary", "selected_cube", "identification"]
    env.close()
    return [key for key in keys if f'"{key}"' in system]


def recorded(experiment, episodes, keys, folder):
    """Seconds of a recording of a function that gets pixels."""

    def walks(message):
        return reply(move(message["t"]), keys) if message["kind"] == "observation" else None

    start = time.perf_counter()
    answer = ms.record(walks, experiment, seeds=1, runs=episodes, out=folder, images="array", threads=1, in_flight=1)
    assert answer["steps"] == episodes * STEPS
    return time.perf_counter() - start


def played(experiment, episodes, keys, **options):
    """Seconds of the same episodes in an environment."""
    start = time.perf_counter()
    env = MirrorEnv(experiment, **options)
    for run in range(1, episodes + 1):
        env.reset(seed=1, options={"run": run})
        for t in range(1, STEPS + 1):
            *_, terminated, truncated, _ = env.step(reply(move(t), keys))
        assert truncated and not terminated
    env.close()
    return time.perf_counter() - start


def alternately(rounds, episodes, contenders):
    """Steps a second of two contenders, and the median ratio of the first to the second."""
    rates = {name: [] for name in contenders}
    for turn in range(rounds):
        for name in contenders if turn % 2 else reversed(contenders):
            with tempfile.TemporaryDirectory() as folder:
                rates[name].append(episodes * STEPS / contenders[name](f"{folder}/runs"))
    for name, found in rates.items():
        print(f"  {name:34} {statistics.median(found):7.1f} steps/s")
    return statistics.median(one / other for one, other in zip(*rates.values()))


def resident():
    """The memory of this process, MB."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * PAGE / 1e6


def grown(episodes, keys):
    """MB by which memory grows from the second tenth of many episodes to the last."""
    env, sizes = MirrorEnv(config=SMALL), []
    for episode in range(1, episodes + 1):
        env.reset(seed=episode)
        for t in range(1, 6):
            env.step(reply("done" if t == 5 and episode % 5 else move(t), keys))
        if episode % (episodes // 10) == 0:
            sizes.append(resident())
    env.close()
    print("  " + ", ".join(f"{size:.0f}" for size in sizes))
    return sizes[-1] - sizes[1]


def vector(mode, keys, copies=8):
    """Steps a second of vectors of environments that play one whole episode each."""
    kwargs = {"context": "spawn"} if mode == "async" else {}
    envs = gymnasium.make_vec("mirrorstats/E1-v0", copies, mode, kwargs, config=SMALL, visibility="at_end")
    envs.reset(seed=1)
    actions = {key: numpy.full(copies, space.n - 1) for key, space in envs.single_action_space.items()}
    start, ended = time.perf_counter(), 0
    for t in range(1, STEPS + 1):
        actions["action"] = numpy.full(copies, LETTERS.index(move(t)))
        *_, truncated, _ = envs.step(actions)
        ended += truncated.sum()
    seconds = time.perf_counter() - start
    envs.close()
    assert ended == copies, ended
    print(f"  {mode:34} {copies * STEPS / seconds:7.1f} steps/s")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--episodes", type=int, default=2)
    parser.add_argument("--many", type=int, default=1000)
    options = parser.parse_args()
    faults = []

    def check(words, value, holds, limit):
        print(f"{words}: {value:.2f} ({limit})\n")
        if not holds:
            faults.append(words)

    rounds, episodes = options.rounds, options.episodes
    for experiment in ("E1", "E5"):
        keys = keys_of(experiment)
        print(f"{experiment}, {episodes} episodes of {STEPS} steps, 640 x 480, with trace and log")
        contenders = {
            "environment": lambda folder: played(experiment, episodes, keys, record=folder, model="walks"),
            "record": lambda folder: recorded(experiment, episodes, keys, folder),
        }
        ratio = alternately(rounds, episodes, contenders)
        check(f"{experiment}: environment / record", ratio, ratio >= 0.95, "at least 0.95")
    for experiment in ("E1", "E5"):
        keys = keys_of(experiment)
        print(f"{experiment}, {episodes} episodes of {STEPS} steps, without files")
        contenders = {
            "84 x 84, rays at the end": lambda _: played(experiment, episodes, keys, config=SMALL, visibility="at_end"),
            "640 x 480, rays at each step": lambda _: played(experiment, episodes, keys),
        }
        ratio = alternately(rounds, episodes, contenders)
        check(f"{experiment}: small frames / full frames", ratio, ratio >= 3, "at least 3")
    keys = keys_of("E1")
    print("8 copies of E1, an episode each, 84 x 84, rays at the end")
    for mode in ("sync", "async"):
        vector(mode, keys)
    print(f"\nresident memory after each tenth of {options.many} episodes, MB")
    more = grown(options.many, keys)
    check("MB more after the last than after the second", more, more < 20, "less than 20")
    return f"exceeded: {'; '.join(faults)}" if faults else 0


if __name__ == "__main__":
    raise SystemExit(main())
