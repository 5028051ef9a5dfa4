"""Recordings in the mirror world."""

from __future__ import annotations

import inspect
import json
import os
import textwrap
import warnings
from collections.abc import Callable
from typing import Any

from . import _native
from ._answer import Answer
from ._paths import Path

Message = dict[str, Any]


def record(
    agent: str | Callable[[Message], Any] | type,
    experiment: str = "E1..E5",
    *,
    seeds: int = 3,
    runs: int = 7,
    out: Path = "runs",
    model: str | None = None,
    images: str = "path",
    **options: Any,
) -> Answer:
    """Records episodes of an agent in the mirror world: step traces to be opened, logs with the frames.

    The same call again continues where it stopped. Ctrl-C ends a recording when the steps under way are done; whole
    episodes stay.

    Args:
        agent: what plays. A name as on the command line (`oracle`, `vlm`, `exec:CMD`), or a function that gets the messages
            that a program of `--agent exec:CMD` gets, as dicts, and returns the reply to each `observation`: a dict with
            the keys that the prompt asks for, or a text. What it returns for `task` and `end` is not looked at. Several
            episodes are under way at once and share the function; of a class each episode gets an instance of its own,
            made without arguments and called with the messages. An agent that raises loses its episode.
        experiment: `E1`, `E1..E5`, `E1,E3`, others that are built in, or a TOML file.
        seeds: seeds 1 to this for each experiment.
        runs: runs 1 to this for each seed.
        out: the folder for traces and logs.
        model: the name in tables; that of the function where none is given.
        images: how a function gets a frame, in `message["image"]`: `path`, a PNG file that is there until the episode
            ends, or `base64`, the same PNG as text.
        options: the other options of `mirrorstats record`, with `_` for `-`: `repeats=2`, `no_frames=True`.

    Returns:
        What became of the episodes: `recorded`, `found` (there before), `steps` (counts), `lost` (episodes without an answer,
        each with its `reason`; a warning names the first), `traces` and `logs` (files), and more.

    Raises:
        Error: an option, an agent or a configuration that cannot be used; an agent that could not go on.
    """
    arguments = ["--experiment", experiment, "--seeds", str(seeds), "--runs", str(runs), "--out", os.fspath(out)]
    for name, value in options.items():
        arguments += _option(name, value)
    if isinstance(agent, str):
        named = [] if model is None else ["--model", model]
        return _told(Answer(_native.record([*arguments, "--agent", agent, *named])))
    if images not in ("path", "base64"):
        raise ValueError(f"images: expected 'path' or 'base64', found {images!r}")
    function = {
        "model": model or getattr(agent, "__name__", type(agent).__name__),
        "source": _source(agent),
        "is_base64": images == "base64",
        "listeners": lambda: _listener(agent),
    }
    return _told(Answer(_native.record([*arguments, "--agent", "function"], function)))


def _option(name: str, value: Any) -> list[str]:
    """An option of the command line; False and None leave it out."""
    flag = "--" + name.replace("_", "-")
    if value is None or value is False:
        return []
    return [flag] if value is True else [flag, os.fspath(value) if isinstance(value, os.PathLike) else str(value)]


def _source(agent: Any) -> str | None:
    """The text of the agent, of which recordings carry the hash; None where Python does not know it."""
    plain = agent if inspect.isfunction(agent) or inspect.isclass(agent) else type(agent)
    try:
        return textwrap.dedent(inspect.getsource(plain))
    except (OSError, TypeError):
        return None


def _listener(agent: Any) -> Callable[[str], str]:
    """What the native library calls in one episode, with messages as JSON."""
    function = agent() if isinstance(agent, type) else agent

    def listen(line: str) -> str:
        message = json.loads(line)
        reply = function(message)
        if message["kind"] != "observation" or reply is None:
            return ""
        if isinstance(reply, (str, dict)):
            return reply if isinstance(reply, str) else json.dumps(reply)
        raise TypeError(f"expected a reply, a dict or a text, found {type(reply).__name__}")

    return listen


def _told(answer: Answer) -> Answer:
    lost = answer["lost"]
    if lost:
        words = f"{len(lost)} episodes are lost; first {lost[0]['episode_id']}: {lost[0]['reason']}"
        warnings.warn(words, RuntimeWarning, stacklevel=3)
    return answer
