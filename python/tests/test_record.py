"""Recordings: a Python function beside the same agent as a program."""

import asyncio
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time
import tomllib

import agent
import mirrorstats as ms
import pyarrow.parquet
import pytest

# What differs between a function and a program: how long a reply took, and what the agent is.
OWN = ["latency_ms", "fingerprint", "episode_hash"]
SHORT = {"experiment": "E1,E4", "seeds": 1, "runs": 2, "model": "walker"}


def rows(folder, experiment):
    table = pyarrow.parquet.read_table(pathlib.Path(folder) / f"{experiment}-walker.parquet")
    return table.drop_columns([name for name in OWN if name in table.column_names]).to_pylist()


@pytest.mark.parametrize("images", ["path", "base64"])
def test_a_function_and_the_same_program_record_the_same(images, tmp_path):
    program = f"exec:{sys.executable} {agent.__file__}"
    by_program = ms.record(program, **SHORT, exec_images=images, out=tmp_path / "program")
    by_function = ms.record(agent.decide, **SHORT, images=images, out=tmp_path / "function")
    assert by_program["recorded"] == by_function["recorded"] == 4
    assert by_program["steps"] == by_function["steps"] == 48
    for experiment in ["E1", "E4"]:
        found = rows(tmp_path / "function", experiment)
        assert found == rows(tmp_path / "program", experiment)
        # The frames are the same too: the agent says their hashes, and not always the same one.
        assert len({row["view_description"] for row in found}) > 2
    assert by_function["traces"] and ms.validate(tmp_path / "function")["findings"] == []


def test_each_episode_has_its_own_instance_of_a_class(tmp_path):
    ms.record(agent.Counting, "E1", seeds=1, runs=3, out=tmp_path, model="walker", no_log=True)
    last = [row["reasoning"] for row in rows(tmp_path, "E1") if row["t"] == 12]
    assert last == ["task " + " ".join(["observation"] * 12)] * 3


def test_an_agent_that_raises_loses_its_episode_and_the_same_call_continues(tmp_path):
    def stumbles(message):
        if message["kind"] == "observation" and message["t"] == 3:
            raise RuntimeError("no legs")
        return agent.decide(message)

    def wrong(message):
        return 7

    with pytest.warns(RuntimeWarning, match="no legs"):
        answer = ms.record(stumbles, "E1", seeds=1, runs=1, out=tmp_path, model="walker", no_log=True, on_error="lose")
    reason = answer["lost"][0]["reason"]
    assert answer["recorded"] == 0 and reason.startswith("step 3: RuntimeError: no legs\nTraceback")
    assert "in stumbles" in reason
    with pytest.warns(RuntimeWarning, match="expected a reply, a dict or a text, found int"):
        ms.record(wrong, "E1", seeds=1, runs=1, out=tmp_path / "wrong", no_log=True, on_error="lose")


def test_unusable_replies_stop_a_recording_as_on_the_command_line(tmp_path):
    with pytest.raises(ms.RecordError, match="gave 5 replies in a row without a decision") as raised:
        ms.record(lambda message: "well", "E1", seeds=1, runs=1, out=tmp_path, model="walker", max_unusable=5)
    assert raised.value.hint.startswith("`max_unusable=N` allows more")


class Stumbles:
    def __call__(self, message):
        if message["kind"] == "observation" and message["t"] == 2:
            raise LookupError("no legs")
        return agent.decide(message)


def test_an_exception_ends_the_recording_with_its_type_and_traceback(tmp_path):
    with pytest.raises(LookupError, match="no legs") as raised:
        ms.record(Stumbles, "E1", seeds=1, runs=2, out=tmp_path, no_log=True)
    assert raised.traceback[-1].name == "__call__"
    assert not list(tmp_path.glob("*.parquet"))
    # The same folder can be recorded into again.
    assert ms.record(agent.decide, "E1", seeds=1, runs=1, out=tmp_path, no_log=True)["recorded"] == 1

    def stops(message):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ms.record(stops, "E1", seeds=1, runs=1, out=tmp_path, no_log=True, on_error="lose")


def test_invalid_arguments_are_refused_before_recording(tmp_path):
    out = tmp_path / "runs"
    with pytest.raises(TypeError, match="expected a name, a function or a class, found NoneType"):
        ms.record(None, out=out)
    with pytest.raises(TypeError, match="unexpected keyword argument 'repeat'; did you mean `repeats`"):
        ms.record("oracle", repeat=2, out=out)
    for words, arguments in [
        ("`repeats`: 0 is not in 1..=99", {"repeats": 0}),
        ("`repeats`: invalid digit found in string, found `x`", {"repeats": "x"}),
        ("`shard`: expected a share such as 3/16, from 1/16 to 16/16, found `3`", {"shard": "3"}),
        ("`keep_going=True` cannot be used with `max_unusable`", {"keep_going": True, "max_unusable": 3}),
        ("`no_log=True`: expected true or false, found `3`", {"no_log": 3}),
        ("`experiment`: expected experiments such as E1, E1..E5, E1,E3 or mine.toml, found `E9`", {"experiment": "E9"}),
    ]:
        with pytest.raises(ms.ArgumentError) as raised:
            ms.record("oracle", out=out, **arguments)
        assert str(raised.value) == words
    for words, arguments in [("runs", {"runs": 0}), ("seeds", {"seeds": 1.5}), ("images", {"images": "png"})]:
        with pytest.raises(ms.ArgumentError, match=f"{words}: expected"):
            ms.record("oracle", out=out, **arguments)
    assert not out.exists()


def test_an_experiment_is_text_or_a_dict(command, tmp_path):
    text = command("experiments", "show", "E1").stdout.replace("experiment.E1", "experiment.Mine")
    folders = [tmp_path / "text", tmp_path / "dict"]
    for experiment, out in zip([text, tomllib.loads(text)], folders):
        ms.record("frozen", experiment, seeds=1, runs=1, out=out, no_log=True)
    traces = [pyarrow.parquet.read_table(out / "Mine-frozen.parquet") for out in folders]
    assert traces[0].equals(traces[1]) and set(traces[0]["experiment"].to_pylist()) == {"Mine"}
    with pytest.raises(ms.Error, match="unknown key `titel`(?s:.)*did you mean `title`"):
        ms.record("frozen", {"experiment": {"Mine": {"titel": "x"}}}, out=tmp_path / "wrong")


def test_settings_of_the_command_line_do_not_apply(command, paper, tmp_path, monkeypatch):
    (tmp_path / "mirrorstats.toml").write_text('definitions = "extended"\n[record]\nruns = 3\nno-log = true\n')
    monkeypatch.chdir(tmp_path)
    assert "[default: extended]" in command("report", "--help").stdout
    assert len(ms.open(paper).episodes) == 840 and ms.open(paper).episodes.column_names == ms.open(
        paper, definitions="paper"
    ).episodes.column_names
    found = ms.record("frozen", "E1", seeds=1, runs=1, out="runs")
    assert found["recorded"] == 1 and found["logs"]


def test_async_agents_of_several_episodes_wait_at_once(tmp_path):
    under_way, most = set(), []

    async def waits(message):
        if message["kind"] != "observation":
            return None
        under_way.add(id(asyncio.current_task()))
        most.append(len(under_way))
        await asyncio.sleep(0.2)
        under_way.discard(id(asyncio.current_task()))
        return {**agent.decide({**message, "t": 12}), "action": "done"}

    answer = ms.record(waits, "E1", seeds=1, runs=4, out=tmp_path, no_log=True, images="base64", in_flight=4)
    assert answer["recorded"] == 4 and max(most) > 1
    assert str(answer) == "recorded 4 of 4 episodes of waits (4 steps), 0 there before, 0 lost"


def test_a_frame_is_an_array_of_its_pixels(tmp_path):
    shapes = []

    def looks(message):
        if message["kind"] == "observation":
            shapes.append((message["image"].shape, str(message["image"].dtype), message["image"].std() > 0))
        return {"action": "done", "selected_cube": "red"}

    ms.record(looks, "E1", seeds=1, runs=1, out=tmp_path, no_log=True, images="array", keep_going=True)
    assert shapes[0] == ((480, 640, 3), "uint8", True)


SLOW = """
import sys, time, mirrorstats as ms
def slow(message):
    if message["kind"] == "observation":
        print(message["t"], flush=True)
        time.sleep(60)
    return {}
try:
    ms.record(slow, "E1", seeds=1, runs=1, out=sys.argv[1], keep_going=True, no_log=True, model="slow")
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


def test_an_interrupt_ends_a_recording(tmp_path):
    started = subprocess.Popen([sys.executable, "-c", SLOW, tmp_path], stdout=subprocess.PIPE, text=True)
    assert started.stdout.readline() == "1\n"
    started.send_signal(signal.SIGINT)
    since = time.monotonic()
    assert started.stdout.readline() == "interrupted\n"
    assert time.monotonic() - since < 1, "the agent sleeps for a minute, and is not waited for"
    said, _ = started.communicate(timeout=60)
    assert said == "" and started.returncode == 0


def test_an_interrupt_ends_an_agent_that_never_returns(tmp_path):
    turns = 0

    def loops(message):
        nonlocal turns
        while True:
            turns += 1

    threading.Timer(1, signal.raise_signal, [signal.SIGINT]).start()
    since = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        ms.record(loops, "E1", seeds=1, runs=2, out=tmp_path, in_flight=2, no_log=True, on_error="lose")
    before = turns
    assert before > 0 and time.monotonic() - since < 2
    time.sleep(0.1)
    assert turns == before, "a thread that still runs aborts the interpreter when it exits"


def test_an_interrupt_ends_the_installed_command(tmp_path):
    command = pathlib.Path(sys.executable).parent / "mirrorstats"
    # A command that listens ends with a code of its own, another one by the signal.
    words = ["record", "--agent", "exec:sleep 60", "--experiment", "E1", "--seeds", "1", "--runs", "1", "--out", "runs"]
    for arguments, code in [(words, 130), (["score", "-"], -signal.SIGINT)]:
        started = subprocess.Popen([command, *arguments], cwd=tmp_path, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
        # What is waited for is that it has begun; that takes some time on a machine that is busy.
        time.sleep(5)
        started.send_signal(signal.SIGINT)
        if code == 130:
            time.sleep(1)
            started.send_signal(signal.SIGINT)
        assert started.wait(timeout=60) == code, os.fsdecode(started.stderr.read())
        started.stdin.close()
