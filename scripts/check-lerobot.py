"""Compares what `import` makes of LeRobot's own files with LeRobot's own numbers: `check-lerobot.py PROGRAM`."""

import contextlib
import io
import json
import pathlib
import subprocess
import sys
import tempfile

import gymnasium
import numpy
import torch
from lerobot.configs.policies import PreTrainedConfig
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.policies.pretrained import PreTrainedPolicy
from lerobot.scripts.lerobot_eval import eval_policy_all

PROGRAM = str(pathlib.Path(sys.argv[1]).resolve())
DEFINITIONS = str(pathlib.Path("examples/domains/robots.toml").resolve())
FRAMES = 8
SOLVED = [2, 5, None, 3, 4, None]
TASKS = ["push", "push", "lift"]


def run(folder, *words):
    done = subprocess.run([PROGRAM, *words], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, f"{' '.join(words)}\n{done.stdout}{done.stderr}"
    return done.stdout


def scores(folder, trace):
    return [json.loads(line) for line in run(folder, "score", trace, "--definitions", DEFINITIONS, "--json").splitlines()]


def query(folder, trace, sql):
    return run(folder, "query", sql, trace, "--definitions", DEFINITIONS, "--format", "csv")


def data_set(root):
    """Six episodes of two tasks, four of them solved, with a list, a picture and what `next.*` says."""
    number = {"dtype": "float32", "shape": (1,), "names": None}
    features = {
        "action": {"dtype": "float32", "shape": (2,), "names": ["x", "y"]},
        "observation.state": {"dtype": "float32", "shape": (2,), "names": ["x", "y"]},
        "observation.image": {"dtype": "image", "shape": (8, 8, 3), "names": ["height", "width", "channels"]},
        "next.reward": number,
        "next.success": {**number, "dtype": "bool"},
        "next.done": {**number, "dtype": "bool"},
    }
    made = LeRobotDataset.create("local/robots", fps=10, features=features, root=root, robot_type="stub", use_videos=False)
    for number, solved in enumerate(SOLVED):
        for at in range(FRAMES):
            made.add_frame(
                {
                    "task": TASKS[number % len(TASKS)],
                    "action": numpy.array([at % 2, 0.5 * number], dtype=numpy.float32),
                    "observation.state": numpy.array([at, number], dtype=numpy.float32),
                    "observation.image": numpy.full((8, 8, 3), 10 * at, dtype=numpy.uint8),
                    "next.reward": numpy.array([at / 10], dtype=numpy.float32),
                    "next.success": numpy.array([at == solved]),
                    "next.done": numpy.array([at + 1 == FRAMES]),
                }
            )
        made.save_episode()
    made.finalize()
    read = LeRobotDataset("local/robots", root=root)
    assert (read.num_episodes, read.num_frames) == (len(SOLVED), len(SOLVED) * FRAMES)


def check_data_set(folder):
    data_set(folder / "robots")
    words = ["--definitions", DEFINITIONS, "--set", "model=stub", "--set", "experiment=table", "--set", "seed=1"]
    run(folder, "import", "robots", "-o", "robots.parquet", *words)
    found = scores(folder, "robots.parquet")
    assert [one["run"] for one in found] == list(range(1, len(SOLVED) + 1)), found
    assert [one["SUCCESS"] for one in found] == [int(solved is not None) for solved in SOLVED], found
    # Frames are counted from 0, steps from 1.
    assert [one["TIME"] for one in found] == [None if solved is None else solved + 1 for solved in SOLVED], found
    # Each frame but the first has another action than the one before it.
    assert {one["JERKS"] for one in found} == {FRAMES - 1}, found
    rows = query(folder, "robots.parquet", "SELECT task, count(*) AS n FROM steps GROUP BY task ORDER BY task")
    assert rows.split() == ["task,n", f"lift,{2 * FRAMES}", f"push,{4 * FRAMES}"], rows
    run(folder, "report", "robots.parquet", "--definitions", DEFINITIONS)
    run(folder, "stats", "robots.parquet", "--definitions", DEFINITIONS)


class Push(gymnasium.Env):
    """Solved at the third step where the seed is even; at most five steps."""

    metadata = {"render_fps": 10, "render_modes": ["rgb_array"]}
    observation_space = gymnasium.spaces.Dict({"agent_pos": gymnasium.spaces.Box(-1, 1, (2,), numpy.float32)})
    action_space = gymnasium.spaces.Box(-1, 1, (2,), numpy.float32)
    _max_episode_steps = 5
    task = "push"
    task_description = "push"

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.seed = getattr(self, "seed", 0) if seed is None else seed
        self.at = 0
        return self.observation_space.sample(), {"is_success": False}

    def step(self, action):
        self.at += 1
        is_solved = self.seed % 2 == 0 and self.at == 3
        return self.observation_space.sample(), float(is_solved), is_solved, False, {"is_success": is_solved}


@PreTrainedConfig.register_subclass("stub")
class StubConfig(PreTrainedConfig):
    observation_delta_indices = action_delta_indices = reward_delta_indices = None

    def get_optimizer_preset(self):
        return None

    def get_scheduler_preset(self):
        return None

    def validate_features(self):
        pass


class Stub(PreTrainedPolicy):
    config_class, name = StubConfig, "stub"

    def get_optim_params(self):
        return {}

    def reset(self):
        pass

    def forward(self, batch):
        return None, None

    def predict_action_chunk(self, batch, **options):
        return self.select_action(batch)[:, None]

    def select_action(self, batch, **options):
        return torch.zeros((batch["observation.state"].shape[0], 2))


def check_evaluation(folder):
    same = lambda value: value
    made = eval_policy_all(
        {"bench": {at: gymnasium.vector.SyncVectorEnv([Push, Push], autoreset_mode=gymnasium.vector.AutoresetMode.SAME_STEP) for at in (0, 1)}},
        Stub(StubConfig(device="cpu")),
        same, same, same, same,
        n_episodes=4,
        start_seed=1000,
    )
    (folder / "eval_info.json").write_text(json.dumps(made, indent=2))
    run(folder, "import", "eval_info.json", "-o", "evaluation.parquet", "--set", "model=stub", "--set", "experiment=bench", "--set", "seed=1", "--definitions", DEFINITIONS)
    rows = query(folder, "evaluation.parquet", "SELECT count(*) AS n, avg(CAST(success AS INT)) * 100 AS percent FROM steps")
    count, percent = rows.split()[1].split(",")
    assert (int(count), float(percent)) == (8, made["overall"]["pc_success"]) == (8, 50.0), (rows, made["overall"])


with tempfile.TemporaryDirectory() as made_in:
    place = pathlib.Path(made_in)
    said = io.StringIO()
    with contextlib.redirect_stderr(said):
        check_data_set(place)
        check_evaluation(place)
print("LeRobot's data set and evaluation are read as LeRobot reads them")
