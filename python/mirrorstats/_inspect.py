"""The mirror world as tasks of Inspect: `inspect eval mirrorstats/E1 --model openai/gpt-5`.

Each built-in experiment is a task, and `mirrorstats/paper` has the paper's five. A sample is a scene, and each step is one
generation with the paper's prompt and the frame. Scores are those of `mirrorstats score`. Needs `inspect-ai`:
`pip install 'mirrorstats[inspect]'`.
"""

from __future__ import annotations

import base64
import json
import math
import os
import time
from collections import defaultdict
from typing import Any, Optional

from inspect_ai import Task, task
from inspect_ai.dataset import MemoryDataset, Sample
from inspect_ai.log._samples import sample_active
from inspect_ai.model import ChatMessageSystem, ChatMessageUser, ContentImage, ContentText, get_model
from inspect_ai.scorer import Score, Scorer, Target, grouped, mean, scorer, stderr
from inspect_ai.solver import Generate, Solver, TaskState, solver

from . import _native

PAPER = ("E1", "E2", "E3", "E4", "E5")

# What a provider says of the end of a generation, in the words of a reply's ending.
_ENDINGS = {"max_tokens": "truncated", "model_length": "truncated", "content_filter": "refused"}

# Environments that no sample uses. A camera takes longer to make than a step.
_idle: defaultdict[str, list[_native.Environment]] = defaultdict(list)


def _task(experiments: tuple[str, ...], seeds: int, runs: int, record: Optional[str], config: Optional[str]) -> Task:
    scenes = [(name, seed, run) for name in experiments for seed in range(1, seeds + 1) for run in range(1, runs + 1)]
    samples = [
        Sample(
            id=f"{name}/s{seed}/r{run}",
            input=f"Play {name}, seed {seed}, run {run}.",
            metadata={"experiment": name, "seed": seed, "run": run},
        )
        for name, seed, run in scenes
    ]
    scoring = by_experiment() if len(experiments) > 1 else metrics()
    return Task(dataset=MemoryDataset(samples, name="mirrorstats"), solver=play(record, config), scorer=scoring)


@solver
def play(record: Optional[str] = None, config: Optional[str] = None) -> Solver:
    """Plays the scene of a sample: each step is one generation.

    Args:
        record: the folder for traces and logs; one beside Inspect's log if None.
        config: a configuration of the world, a TOML file.
    """

    async def solve(state: TaskState, generate: Generate) -> TaskState:
        scene = state.metadata
        options = {
            "experiment": scene["experiment"],
            "out": record or _beside_log(),
            "model": str(get_model()),
            "config": config,
        }
        kind = json.dumps(options)
        world = _idle[kind].pop() if _idle[kind] else _native.Environment(kind, False, True, False)
        try:
            message, frame = world.reset(scene["seed"], scene["run"])
            while frame is not None:
                told = json.loads(message)
                state.messages = _messages(told, world.png())
                start = time.monotonic()
                state = await generate(state)
                latency = int(1000 * (time.monotonic() - start))
                ending, usage = _ENDINGS.get(state.output.stop_reason, "whole"), state.output.usage
                tokens = (usage.input_tokens, usage.output_tokens) if usage else (None, None)
                message, frame = world.step(state.output.completion, latency, tokens, ending)
        finally:
            # An episode that was cut off is lost. Whole ones are in the trace after each sample.
            world.close()
            _idle[kind].append(world)
        state.metadata["ended"] = json.loads(message)
        return state

    return solve


def _messages(told: dict[str, Any], png: bytes) -> list[Any]:
    image = ContentImage(image="data:image/png;base64," + base64.b64encode(png).decode(), detail="auto")
    user = ChatMessageUser(content=[ContentText(text=told["user"]), image])
    return [ChatMessageSystem(content=told["system"]), user]


def _beside_log() -> str:
    active = sample_active()
    log = str(active.log_location) if active else ""
    log = log.removeprefix("file://")
    if not log or "://" in log:
        raise ValueError(f"record: expected a local folder for the trace, because the log is at {log or 'no file'!r}")
    return os.path.splitext(log)[0] + ".mirrorstats"


def _scorer() -> Scorer:
    async def score(state: TaskState, target: Target) -> Score:
        ended = state.metadata.get("ended")
        if ended is None:
            return Score.unscored(explanation="the episode was cut off before its end")
        values = {name: math.nan if value is None else value for name, value in ended["metrics"].items()}
        return Score(value=values, answer=state.output.completion, metadata={"episode_id": ended["episode_id"]})

    return score


@scorer(metrics={"*": [mean(), stderr()]})
def metrics() -> Scorer:
    """Every metric of the experiment's definitions; an episode counts only where the metric is defined."""
    return _scorer()


@scorer(metrics={"*": [grouped(mean(), "experiment"), grouped(stderr(), "experiment")]})
def by_experiment() -> Scorer:
    """The same, for each experiment."""
    return _scorer()


def _experiment(name: str) -> Any:
    def experiment(
        seeds: int = 3, runs: int = 7, record: Optional[str] = None, config: Optional[str] = None
    ) -> Task:
        return _task((name,), seeds, runs, record, config)

    experiment.__name__ = name
    experiment.__doc__ = f"Experiment {name}: a sample per scene."
    return task(name=name)(experiment)


for _name in _native.experiments():
    _experiment(_name)


@task(name="paper")
def paper(seeds: int = 3, runs: int = 7, record: Optional[str] = None, config: Optional[str] = None) -> Task:
    """The five experiments of the paper: 105 scenes."""
    return _task(PAPER, seeds, runs, record, config)
