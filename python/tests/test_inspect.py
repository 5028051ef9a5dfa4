"""The tasks of Inspect, with its mock model: scores, trace and losses."""

import json
import math
import re
import subprocess
import sys

import mirrorstats as ms
import pytest
from conftest import FIXTURES
from inspect_ai import eval
from inspect_ai.model import ContentImage, ModelOutput, ModelUsage, get_model


def reply(action, color, keys):
    done = action == "done"
    known = {"action": action, "selected_cube": color if done else "none", "identification": color if done else "unknown"}
    return json.dumps({key: known.get(key, "seen") for key in keys})


def player(turns):
    """A model that turns this many times, says something else once, and guesses."""

    def answer(messages, *_):
        system, user = messages
        assert isinstance(user.content[1], ContentImage) and user.content[1].image.startswith("data:image/png;base64,")
        keys = ["view-description", "reasoning", "action", "summary"]
        keys += [key for key in ("selected_cube", "identification") if f'"{key}"' in system.content]
        left = int(re.search(r"(\d+)", user.text.split("Remaining steps")[1]).group(1))
        step = 101 - left
        text = "no JSON" if step == turns + 1 else reply("d" if step <= turns else "done", "red", keys)
        output = ModelOutput.from_content("mockllm/model", text)
        # Without counts, the mock model would fetch a tokenizer.
        output.usage = ModelUsage(input_tokens=10, output_tokens=5, total_tokens=15)
        return output

    return get_model("mockllm/model", custom_outputs=answer)


def play(task, model, log_dir, args, **options):
    [log] = eval(task, model=model, task_args=args, log_dir=str(log_dir), display="none", **options)
    return log


def test_scores_of_inspect_are_those_of_the_trace(tmp_path):
    log = play("mirrorstats/E1", player(1), tmp_path, {"seeds": 2, "runs": 2})
    assert log.status == "success" and len(log.samples) == 4
    [folder] = tmp_path.glob("*.mirrorstats")
    scored = {row["episode_id"]: row for row in ms.open(folder).episodes.to_polars().to_dicts()}
    assert len(scored) == 4
    for sample in log.samples:
        score = sample.scores["metrics"]
        row = scored[score.metadata["episode_id"]]
        assert len(score.value) >= 10
        for name, value in score.value.items():
            assert row[name] == value or (row[name] is None and math.isnan(value)), name
        # One generation per step.
        assert sum(event.event == "model" for event in sample.events) == row["TTD"] == 3
    steps = ms.open(folder).steps(["reply_status", "prompt_tokens"]).to_polars()
    assert set(steps["reply_status"]) == {"ok", "parse_failed"}
    means = {score.name: score.metrics["mean"].value for score in log.results.scores}
    assert means["TTD"] == 3
    assert {finding["severity"] for finding in ms.validate(folder)["findings"]} <= {"note"}


def test_all_experiments_of_the_paper_are_one_task(tmp_path):
    log = play("mirrorstats/paper", player(0), tmp_path, {"seeds": 1, "runs": 1, "record": str(tmp_path / "runs")})
    assert log.status == "success"
    assert set(ms.open(tmp_path / "runs").episodes.to_polars()["experiment"]) == {"E1", "E2", "E3", "E4", "E5"}
    [tsa] = [score for score in log.results.scores if score.name == "TSA"]
    assert {"E1", "E5"} <= {metric.name for metric in tsa.metrics.values()}


def test_a_sample_that_a_limit_ends_is_lost(tmp_path):
    args = {"seeds": 1, "runs": 1, "record": str(tmp_path / "runs")}
    log = play("mirrorstats/E1", player(50), tmp_path, args, token_limit=1)
    lost = (tmp_path / "runs" / "lost.jsonl").read_text()
    assert "E1/mockllm-model/s1/r1" in lost
    assert math.isnan(log.samples[0].scores["metrics"].value)


@pytest.fixture
def seeing():
    """The address of the example that sees, an agent without a provider."""
    program = FIXTURES.parent / "examples/agents/seeing.py"
    with subprocess.Popen([sys.executable, "-B", program, "--port", "0"], stdout=subprocess.PIPE, text=True) as server:
        yield re.search(r"http://\S+", server.stdout.readline()).group(0)
        server.kill()


def test_an_agent_that_sees_succeeds_through_the_provider_of_openai(seeing, tmp_path):
    model = get_model("openai/seeing", base_url=seeing, api_key="none", responses_api=False)
    log = play("mirrorstats/E1", model, tmp_path, {"seeds": 1, "runs": 3, "record": str(tmp_path / "runs")})
    assert log.status == "success", log.error
    scores = ms.open(tmp_path / "runs").episodes.to_polars()
    assert scores["TSA"].to_list() == [1, 1, 1] == [sample.scores["metrics"].value["TSA"] for sample in log.samples]
    assert scores["MCR"].sum() == 3
