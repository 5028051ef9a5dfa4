"""Recordings in the mirror world."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, Literal, Optional, Union

from . import _native
from ._answer import Recorded
from ._error import check_name, check_number
from ._paths import Path, Spool, Toml, text, toml_file

Message = dict[str, Any]


def record(
    agent: Union[str, Callable[[Message], Any], type],
    experiment: Toml = "E1..E5",
    *,
    seeds: int = 3,
    runs: int = 7,
    out: Path = "runs",
    model: Optional[str] = None,
    images: Literal["path", "base64", "array"] = "path",
    on_error: Literal["raise", "lose"] = "raise",
    **options: Any,
) -> Recorded:
    """Records episodes of an agent in the mirror world: step traces to be opened, logs with the frames.

    The same call again continues where it stopped. Ctrl-C ends a recording: a function is not waited for, an agent of another
    kind ends the steps under way. Whole episodes stay.

    Args:
        agent: what plays. A name as on the command line (`oracle`, `vlm`, `exec:CMD`), or a function that gets the messages
            that a program of `exec:CMD` gets, as dicts, and returns the reply to each `observation`: a dict with the keys
            that the prompt asks for, or a text. It may be `async`. What it returns for `task` and `end` is not looked at.
            Of a class each episode gets an instance of its own, made without arguments and called with the messages.
        experiment: `E1`, `E1..E5`, `E1,E3`, others that are built in, a TOML file, TOML text, or a dict.
        seeds: seeds 1 to this for each experiment.
        runs: runs 1 to this for each seed.
        out: the folder for traces and logs.
        model: the name in tables; that of the function if None.
        images: how a function gets a frame, in `message["image"]`: `path`, a PNG file that is there until the episode ends;
            `base64`, the same PNG as text; `array`, a NumPy array of uint8 with the shape (height, width, 3).
        on_error: what becomes of an exception of a function: `raise` stops the recording and raises it here, `lose` loses the
            episode and goes on; `lost` of the answer and `lost.jsonl` of the folder then have its traceback.
        options: the other options of `mirrorstats record`, with `_` for `-`: `repeats=2`, `no_frames=True`, or
            `in_flight=8`, the number of episodes under way at once. Settings of `mirrorstats.toml` do not apply.

    Returns:
        What became of the episodes: `recorded`, `found` (there before), `steps` (counts), `lost` (episodes without an answer,
        each with its `reason`; a warning names the first), `traces` and `logs` (files), and more.

    Raises:
        ArgumentError: an option with a value that it cannot have.
        RecordError: an agent or a configuration that cannot be used; an agent that could not go on.
        TypeError: an agent that is no name and cannot be called; a keyword that is no option.
        Exception: what the agent raised, with its traceback.

    Example:
        >>> import mirrorstats as ms
        >>> print(ms.record("frozen", "E1", seeds=1, runs=2, out="frozen", no_log=True))
        recorded 2 of 2 episodes of frozen (200 steps), 0 there before, 0 lost
    """
    if not isinstance(agent, str) and not callable(agent):
        raise TypeError(f"agent: expected a name, a function or a class, found {type(agent).__name__}")
    check_number("seeds", seeds, 1)
    check_number("runs", runs, 1)
    check_name("images", images, ("path", "base64", "array"))
    check_name("on_error", on_error, ("raise", "lose"))
    _check_options(options)
    spool = Spool()
    asked = {name.replace("_", "-"): _plain(value, spool) for name, value in options.items()}
    asked.update(experiment=toml_file(experiment, "experiment", spool), seeds=seeds, runs=runs, out=text(out, spool))
    if isinstance(agent, str):
        return _told(Recorded(_native.record(json.dumps({**asked, "agent": agent, "model": model}))))
    playing: set[int] = set()
    function = {
        "model": model or getattr(agent, "__name__", type(agent).__name__),
        "source": _source(agent),
        "is_base64": images != "path",
        "is_lost": on_error == "lose",
        "listeners": lambda: _listener(agent, images == "array", playing),
    }
    try:
        return _told(Recorded(_native.record(json.dumps({**asked, "agent": "function"}), function)))
    finally:
        _interrupt(playing.copy())


def _interrupt(threads: set[int]) -> None:
    """Ends running functions: the interpreter aborts on exit if a thread of the native library is still inside it.

    Threads sleeping outside the interpreter are ignored: they do not return before the exit.
    """
    import ctypes
    import sys
    import time

    for thread in threads:
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(KeyboardInterrupt))
    end = time.monotonic() + 0.3
    while threads & sys._current_frames().keys() and time.monotonic() < end:
        time.sleep(0.005)


def _check_options(options: dict[str, Any]) -> None:
    import difflib

    known = sorted({name.replace("-", "_") for name in _native.record_options()} - {"agent", "json", "dry_run"})
    for name in options:
        if name not in known:
            near = difflib.get_close_matches(name, known, 1)
            hint = f"; did you mean `{near[0]}`?" if near else f"; options are {', '.join(known)}"
            raise TypeError(f"record() got an unexpected keyword argument {name!r}{hint}")


def _plain(value: Any, spool: Spool) -> Any:
    if isinstance(value, (list, tuple)):
        return [_plain(one, spool) for one in value]
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    return text(value, spool) if hasattr(value, "__fspath__") else str(value)


def _source(agent: Any) -> Optional[str]:
    """The source text of the agent, whose hash is in recordings; None if Python does not know it."""
    import inspect
    import textwrap

    plain = agent if inspect.isfunction(agent) or inspect.isclass(agent) else type(agent)
    try:
        return textwrap.dedent(inspect.getsource(plain))
    except (OSError, TypeError):
        return None


def _listener(agent: Any, is_array: bool, playing: set[int]) -> Callable[[str], str]:
    """The function that the native library calls for one episode, with JSON messages; its thread is then in `playing`."""
    import inspect
    import threading

    function = agent() if isinstance(agent, type) else agent
    loop: Any = None

    def listen(line: str) -> str:
        playing.add(threading.get_ident())
        try:
            return heard(line)
        finally:
            playing.discard(threading.get_ident())

    def heard(line: str) -> str:
        nonlocal loop
        message = json.loads(line)
        if is_array and "image" in message:
            message["image"] = _array(message["image"]["base64"])
        reply = function(message)
        if inspect.isawaitable(reply):
            import asyncio

            loop = loop or asyncio.new_event_loop()
            reply = loop.run_until_complete(reply)
        if loop and message["kind"] == "end":
            loop.close()
        if message["kind"] != "observation" or reply is None:
            return ""
        if isinstance(reply, (str, dict)):
            return reply if isinstance(reply, str) else json.dumps(reply)
        raise TypeError(f"expected a reply, a dict or a text, found {type(reply).__name__}")

    return listen


def _array(png: str) -> Any:
    import base64

    import numpy

    height, width, pixels = _native.pixels(base64.b64decode(png))
    return numpy.frombuffer(pixels, numpy.uint8).reshape(height, width, 3)


def _told(answer: Recorded) -> Recorded:
    lost, recorded = answer["lost"], answer["recorded"]
    answer.text = (
        f"recorded {recorded} of {answer['asked']} episodes of {answer['model']} ({answer['steps']} steps), "
        f"{answer['found']} there before, {len(lost)} lost"
    )
    if lost:
        import warnings

        reason = lost[0]["reason"].splitlines()[0]
        warnings.warn(f"{len(lost)} episodes are lost; first {lost[0]['episode_id']}: {reason}", RuntimeWarning, stacklevel=3)
    return answer
