"""The environment: Gymnasium's own checks, and the rows of the recorder."""

import json
import pathlib
import warnings

import gymnasium
import mirrorstats as ms
import numpy
import pyarrow.parquet
import pytest
from gymnasium.utils.env_checker import check_env
from mirrorstats.gym import DiscreteActions, MirrorEnv

SMALL = {"eye": {"width": 64, "height_px": 48, "samples": 0}}
# What differs between an environment and the recorder: how long a reply took, and what the agent is.
OWN = ["latency_ms", "fingerprint", "episode_hash"]
LETTERS = ["w", "s", "a", "d", "done"]


def spin(t, name):
    """A turn at each step, and a guess at the fifth."""
    done = t == 5
    cube = {"selected_cube": "red" if done else "none"} if name != "E5" else {}
    return cube | {
        "view-description": "",
        "reasoning": "",
        "action": "done" if done else "d",
        "summary": "",
        "identification": "red" if done else "unknown",
    }


def rows(path):
    table = pyarrow.parquet.read_table(path)
    return table.drop_columns([name for name in OWN if name in table.column_names]).to_pylist()


@pytest.mark.parametrize("name", ["E1", "E3", "E5", "reach-scheme", "contingency"])
def test_gymnasiums_own_check_has_no_warning(name):
    env = gymnasium.make(f"mirrorstats/{name}-v0", config=SMALL, render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)
    env.close()


@pytest.mark.parametrize("visibility", ["each_step", "at_end"])
def test_an_environment_records_the_rows_of_the_recorder(visibility, tmp_path):
    for name in ["E1", "E5"]:
        ms.record(
            lambda message: spin(message["t"], name) if message["kind"] == "observation" else None,
            name, seeds=1, runs=2, out=tmp_path / "recorder", model="spin",
        )
        env = MirrorEnv(name, record=tmp_path / "env", model="spin", visibility=visibility)
        for run in (1, 2):
            _, info = env.reset(seed=1, options={"run": run})
            ended = False
            for t in range(1, 6):
                assert not ended
                *_, terminated, truncated, info = env.step(json.dumps(spin(t, name)))
                ended = terminated or truncated
            assert ended and info["scores"]["TTD"] == 5
        env.close()
        file = f"{name}-spin.parquet"
        assert rows(tmp_path / "env" / file) == rows(tmp_path / "recorder" / file)
    assert ms.validate(tmp_path / "env")["findings"] == []


def test_actions_become_replies_and_success_is_the_reward(tmp_path):
    env = gymnasium.make("mirrorstats/E1-v0", config=SMALL, record=tmp_path, model="knows", privileged=True)
    _, info = env.reset(seed=2, options={"run": 3})
    color = info["truth"]["body_color"]
    choices = env.unwrapped.choices
    named = {key: choices[key].index(color) for key in ("selected_cube", "identification")}
    _, reward, terminated, truncated, info = env.step({"action": LETTERS.index("done"), **named})
    assert (reward, terminated, truncated) == (1.0, True, False)
    env.close()
    trace = tmp_path / "E1-knows.parquet"
    row = rows(trace)[0]
    assert (row["body_color"], row["selected_cube"], row["self_color"], row["seed"], row["run"]) == (color,) * 3 + (2, 3)
    footer = json.loads(pyarrow.parquet.read_metadata(trace).metadata[b"mirrorstats.recording"])
    assert footer["agent"]["privileged"] is True
    assert ms.open(trace).episodes.to_polars()["TSA"].to_list() == [1]


def test_ground_truth_needs_a_privilege():
    env = MirrorEnv(config=SMALL)
    _, info = env.reset()
    assert "truth" not in info
    assert set(info["world"]) == {"fov_y", "eye_height", "step_length", "turn", "room_size", "palette"}
    env.close()


def test_an_episode_that_is_cut_off_is_lost(tmp_path):
    env = MirrorEnv(config=SMALL, record=tmp_path, model="leaves")
    env.reset(seed=1)
    env.step(json.dumps(spin(1, "E1")))
    env.close()
    lost = [json.loads(line) for line in (tmp_path / "lost.jsonl").read_text().splitlines()]
    assert [(one["episode_id"], one["step"]) for one in lost] == [("E1/leaves/s1/r1", 2)]
    assert "before its decision" in lost[0]["reason"]


def test_a_scene_that_is_played_again_is_a_repetition(tmp_path):
    env = DiscreteActions(MirrorEnv(config=SMALL, record=tmp_path, model="again", visibility="at_end"))
    done = next(at for at, text in enumerate(env.texts) if text["action"] == "done")
    for _ in range(2):
        env.reset(seed=1)
        assert env.step(done)[2]
    env.close()
    assert [row["repetition"] for row in rows(tmp_path / "E1-again.parquet")] == [1, 2]


def test_seeds_and_runs_beyond_those_of_the_recorder_are_recorded(tmp_path):
    most = 2**31 - 1
    env = DiscreteActions(MirrorEnv(config=SMALL, record=tmp_path, model="far"))
    for seed, run in [(most, most), (1, 1000), (2, 1)]:
        env.reset(seed=seed, options={"run": run})
        env.step(0)
        assert env.step(len(env.texts) - 1)[2]
    env.close()
    found = rows(tmp_path / "E1-far.parquet")
    assert {(row["seed"], row["run"]) for row in found} == {(most, most), (1, 1000), (2, 1)}
    assert len({row["frame_time"] for row in found}) == len(found) == 6
    assert ms.validate(tmp_path)["findings"] == []


def test_an_environment_without_a_folder_keeps_nothing():
    env = DiscreteActions(MirrorEnv(config=SMALL, visibility="at_end"))
    ids = set()
    for _ in range(3):
        env.reset(seed=1)
        env.step(0)
        env.reset(seed=1)
        ids.add(env.step(len(env.texts) - 1)[4]["episode_id"])
    assert ids == {"E1/harness/s1/r1"}
    env.close()


def test_the_budget_truncates():
    env = DiscreteActions(MirrorEnv(config={**SMALL, "episode": {"steps": 40}}))
    env.reset(seed=1)
    ends = [env.step(2)[2:4] for _ in range(40)]
    assert ends == [(False, False)] * 39 + [(False, True)]
    env.close()


@pytest.mark.parametrize(("vector", "kwargs"), [("sync", {}), ("async", {"context": "spawn"})])
def test_vectors_of_environments_play_whole_episodes(vector, kwargs):
    config = {**SMALL, "episode": {"steps": 40}}
    envs = gymnasium.make_vec(
        "mirrorstats/E1-v0", num_envs=8, vectorization_mode=vector, vector_kwargs=kwargs, config=config
    )
    observation, _ = envs.reset(seed=5)
    assert observation["image"].shape == (8, 48, 64, 3)
    alone = MirrorEnv(config=config)
    assert numpy.array_equal(alone.reset(seed=6)[0]["image"], observation["image"][1])
    turns = {key: numpy.full(8, space.n - 1) for key, space in envs.single_action_space.items()}
    turns["action"] = numpy.full(8, LETTERS.index("d"))
    ends = [envs.step(turns)[2:4] for _ in range(40)]
    assert not any(terminated.any() for terminated, _ in ends)
    assert [truncated.sum() for _, truncated in ends] == [0] * 39 + [8]
    # The next step begins the next episode of each.
    assert (envs.step(turns)[0]["steps_left"] == 40).all()
    envs.close()
    alone.close()


def test_a_forked_process_plays_before_its_parent_draws_and_is_refused_after():
    import subprocess
    import sys

    program = """
import gymnasium, mirrorstats.gym
config = {"eye": {"width": 64, "height_px": 48}}
def vector():
    return gymnasium.make_vec("mirrorstats/E1-v0", num_envs=2, vectorization_mode="async",
                              vector_kwargs={"context": "fork"}, config=config)
envs = vector()
print(envs.reset(seed=1)[0]["image"].shape)
envs.close()
gymnasium.make("mirrorstats/E1-v0", config=config).reset(seed=1)
vector().reset(seed=1)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300)
    assert done.stdout.strip() == "(2, 48, 64, 3)"
    assert done.returncode and "forked from one that draws" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"experiment": "E6"}, "E6"),
        ({"experiment": "E1..E2"}, "one experiment"),
        ({"visibility": "never"}, "each_step or at_end"),
        ({"seed": -1}, "from 0"),
        ({"config": {"eye": {"width": 3}}}, "width"),
    ],
)
def test_a_wrong_argument_is_refused_by_name(arguments, words):
    with pytest.raises((ValueError, ms.Error), match=words):
        MirrorEnv(**arguments)


def test_an_action_out_of_range_is_refused():
    env = MirrorEnv(config=SMALL)
    env.reset()
    with pytest.raises(ValueError, match="selected_cube"):
        env.step({"action": 0, "selected_cube": 99, "identification": 0})
    with pytest.raises(ValueError, match="keys"):
        env.step({"action": 0})
    env.close()


def test_a_folder_that_records_already_is_refused(tmp_path):
    import subprocess
    import sys

    env = MirrorEnv(config=SMALL, record=tmp_path)
    program = f"from mirrorstats.gym import MirrorEnv; MirrorEnv(record={str(tmp_path)!r})"
    other = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert other.returncode and "another process records into" in other.stderr
    env.close()
    assert not pathlib.Path(tmp_path, ".lock").exists()
