"""Trains the network of seeing.py: walks through rooms of its own, and learns from the frames and the trace's labels.

    python3 train_seeing.py --program mirrorstats --out weights.npz

The rooms belong to the two experiments below, so they are not those of E1 to E5. The labels are columns of the trace:
the body's colour, the pixels of the own reflection, and the pixels of the mirror, from which its place follows. Equal
frames and seeds give equal weights.
"""

import argparse
import csv
import io
import json
import pathlib
import random
import shlex
import subprocess
import sys
import tempfile
import time

import numpy as np

import network
import sight

ROOMS = """
[experiment.seeing-alone]
title = "Training: nobody else"
prompt = "cube-selection"
cubes = { kind = "candidates", count = 3 }
start = "any"
steps = 25
[[experiment.seeing-alone.mirror]]
kind = "mirror"

[experiment.seeing-before]
title = "Training: nobody else, before the mirror"
prompt = "cube-selection"
cubes = { kind = "candidates", count = 3 }
start = "before_mirror"
steps = 15
[[experiment.seeing-before.mirror]]
kind = "mirror"

[experiment.seeing-others]
title = "Test: among others"
prompt = "cube-selection"
cubes = { kind = "candidates", count = 3 }
others = { behavior = "walk" }
start = "before_mirror"
steps = 15
[[experiment.seeing-others.mirror]]
kind = "mirror"
"""
LABELS = """select episode_id, experiment, t, pose_x, pose_y, pose_yaw, mirror_px, mirror_self_px, body_color
from steps order by episode_id, t"""
SEEN = 60  # pixels of the own reflection from which it counts as seen: the world's own threshold
BATCH, RATE = 32, 2e-3
MIRROR = (0.15, 2.45, 3.0)  # bottom and top above the floor, and width, m


def walk(folder):
    """Plays one episode over `record --agent exec`: walks about at random, and keeps what the network would see."""
    frames = []
    for line in sys.stdin:
        message = json.loads(line)
        if message["kind"] == "task":
            rng = random.Random(message["seed"])
        elif message["kind"] == "observation":
            picture = sight.decode_png(pathlib.Path(message["image"]["path"]).read_bytes())
            frames.append(network.shrunk(picture).astype(np.float16))
            action = rng.choice("ad") if message["wall_warning"] else rng.choice("wwwwsaaadd")
            said = {"view-description": "", "reasoning": "at random", "action": action, "summary": "",
                    "identification": "unknown", "selected_cube": "none"}
            print(json.dumps(said), flush=True)
        else:
            np.save(pathlib.Path(folder) / (message["episode_id"].replace("/", "_") + ".npy"), np.array(frames))
            return


def record(program, work, episodes):
    """Records the rooms; returns frames and rows of labels."""
    rooms, frames = work / "rooms.toml", work / "frames"
    rooms.write_text(ROOMS)
    frames.mkdir(exist_ok=True)
    walker = shlex.join([sys.executable, "-B", str(pathlib.Path(__file__).resolve()), "--walk", str(frames.resolve())])
    subprocess.run([program, "record", "--agent", "exec:" + walker, "--model", "walker", "--experiment", str(rooms),
                    "--seeds", str(episodes // 10), "--runs", "10", "--no-log", "--out", str(work / "runs")], check=True)
    asked = subprocess.run([program, "query", LABELS, str(work / "runs"), "--format", "csv"], check=True,
                           capture_output=True, text=True)
    rows = list(csv.DictReader(io.StringIO(asked.stdout)))
    kept = {name: np.load(frames / (name.replace("/", "_") + ".npy")) for name in {row["episode_id"] for row in rows}}
    return np.array([kept[row["episode_id"]][int(row["t"]) - 1] for row in rows], np.float32), rows


PLACES = [(side, middle) for side in range(4) for middle in np.arange(-2.2, 2.21, 0.2)]


def mirrors(row):
    """For each possible place of a mirror: the columns that show it from the pose of a row, and its pixels."""
    camera = sight.Camera(*(float(row[key]) for key in ("pose_x", "pose_y", "pose_yaw")))
    reach, sides, along = camera.walls(np.arange(camera.width) + 0.5)
    bottom, top = (np.clip(camera.height / 2 + camera.focal * (sight.EYE_HEIGHT - height) / reach, 0, camera.height)
                   for height in MIRROR[:2])
    shown = np.array([(sides == side) & (np.abs(along - middle) <= MIRROR[2] / 2) for side, middle in PLACES])
    return shown, shown @ (bottom - top)


def mirror_columns(rows):
    """The network's columns that show the mirror, by row of one episode: its place is that which explains the counts."""
    seen = [mirrors(row) for row in rows]
    wrong = sum(np.abs(pixels - float(row["mirror_px"])) for row, (_, pixels) in zip(rows, seen))
    return [shown[wrong.argmin()].reshape(network.COLUMNS, -1).mean(1) > 0.5 for shown, _ in seen]


def labels(rows):
    """Mirror by column, the body's colour or none, and whether that is certain; by row."""
    episodes = {}
    for row in rows:
        episodes.setdefault(row["episode_id"], []).append(row)
    mirror = np.array([shown for one in episodes.values() for shown in mirror_columns(one)], np.float32)
    pixels = np.array([int(row["mirror_self_px"]) for row in rows])
    color = np.array([sight.COLORS.index(row["body_color"]) for row in rows])
    return mirror, np.where(pixels >= SEEN, color, sight.NONE), (pixels == 0) | (pixels >= SEEN)


def train(frames, mirror, body, certain, epochs, rng):
    """Adam, with pictures flipped at random."""
    net = network.Network.fresh(rng)
    first, second, step = {}, {}, 0
    for epoch in range(epochs):
        order, losses = rng.permutation(len(frames)), []
        for at in range(0, len(order), BATCH):
            chosen = order[at : at + BATCH]
            flip = 1 if rng.random() < 0.5 else -1
            mirror_logits, body_logits, saved = net.forward(frames[chosen][:, :, ::flip])
            wanted = mirror[chosen][:, ::flip]
            share = network.softmax(body_logits)
            named = share[np.arange(len(chosen)), body[chosen]]
            losses.append(-np.log(named[certain[chosen]] + 1e-9).mean())
            body_slope = (share - np.eye(sight.NONE + 1)[body[chosen]]) * certain[chosen, None] / len(chosen)
            mirror_slope = (1 / (1 + np.exp(-mirror_logits)) - wanted) / len(chosen) / 10
            slopes = net.gradients(saved, mirror_slope.astype(np.float32), body_slope.astype(np.float32))
            step += 1
            rate = RATE * min(1, 4 * (1 - epoch / epochs)) * np.sqrt(1 - 0.999**step) / (1 - 0.9**step)
            for name, slope in slopes.items():
                first[name] = 0.9 * first.get(name, 0) + 0.1 * slope
                second[name] = 0.999 * second.get(name, 0) + 0.001 * slope * slope
                net.weights[name] -= (rate * first[name] / (np.sqrt(second[name]) + 1e-8)).astype(np.float32)
        print(f"epoch {epoch + 1} of {epochs}: loss of the colour {np.mean(losses):.3f}", flush=True)
    return net


def measure(net, frames, mirror, body, certain):
    """Accuracy as text: colour where the own body is seen, `none` where it is not, and mirror by column."""
    answers = [net.forward(frames[at : at + BATCH])[:2] for at in range(0, len(frames), BATCH)]
    columns = np.concatenate([one for one, _ in answers]) > 0
    named = np.concatenate([one for _, one in answers]).argmax(1)
    seen, unseen = certain & (body != sight.NONE), certain & (body == sight.NONE)
    right, quiet = (named == body)[seen], (named == body)[unseen]
    return (f"colour {right.sum()}/{right.size}, no body {quiet.sum()}/{quiet.size}, "
            f"columns of mirror {100 * (columns == (mirror > 0.5)).mean():.1f} %")


def main():
    parser = argparse.ArgumentParser(description="Trains the network of seeing.py in minutes on a CPU.")
    parser.add_argument("--program", default="mirrorstats", help="the mirrorstats that records")
    parser.add_argument("--out", default=str(pathlib.Path(__file__).with_name("seeing.npz")))
    parser.add_argument("--work", help="a folder for the recording, which a second call continues")
    parser.add_argument("--episodes", type=int, default=80, help="episodes of each experiment, a multiple of 10")
    parser.add_argument("--others", action="store_true", help="learn from the rooms with other bodies too")
    parser.add_argument("--epochs", type=int, default=12)
    parser.add_argument("--walk", metavar="FOLDER", help=argparse.SUPPRESS)
    typed = parser.parse_args()
    if typed.walk:
        return walk(typed.walk)
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        work = pathlib.Path(typed.work or folder)
        work.mkdir(exist_ok=True)
        frames, rows = record(typed.program, work, typed.episodes)
    mirror, body, certain = labels(rows)
    alone = np.array([row["experiment"] != "seeing-others" for row in rows])
    held = np.array([int(row["episode_id"].rsplit("/r", 1)[1]) > 8 for row in rows])
    learned, parts = (alone | typed.others) & ~held, [mirror, body, certain]
    print(f"{learned.sum()} frames to learn from, recorded in {time.monotonic() - began:.0f} s")
    net = train(frames[learned], *(part[learned] for part in parts), typed.epochs, np.random.default_rng(1))
    net.save(typed.out)
    net = network.Network.load(typed.out)
    for name, chosen in (("learned", learned), ("held out", alone & held), ("among others, held out", ~alone & held)):
        print(f"{name}, {chosen.sum()} frames: {measure(net, frames[chosen], *(part[chosen] for part in parts))}")
    print(f"{typed.out}: {pathlib.Path(typed.out).stat().st_size} bytes, in {time.monotonic() - began:.0f} s")


if __name__ == "__main__":
    main()
