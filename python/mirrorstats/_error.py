"""The exceptions of the package: one class per kind of error, all of them `Error`."""

from __future__ import annotations

import json
import re
from typing import Any, Optional

# An option of the command line, and its value if it has one.
_OPTION = (
    r"""`?(?<![\w-])--([a-z][a-z-]+)(?:[ =]("[^"]*"|'[^']*'|[A-Z]+\b|\d+\b|[\w./-]+\.\w+|paper|extended|default|as-failure))?`?"""
)
_COMMAND = r"(`mirrorstats [^`]*`)"
# The folder of definitions, styles and frames without a file.
_SPOOLED = r"(?:[^\s`]*/)?mirrorstats-[a-z0-9_]{8}/"
_FLAGS = {"full", "keep_going", "no_frames", "no_log", "pool", "tables"}


def in_python(words: str) -> str:
    """Replaces options of the command line in a text by arguments; whole commands stay."""
    words = re.sub(_SPOOLED, "", words).replace("--> --where", "--> where")

    def argument(option: re.Match[str]) -> str:
        name, value = option[1].replace("-", "_"), option[2]
        if name in _FLAGS:
            return f"`{name}=True`"
        if value is None:
            return f"`{name}`"
        is_plain = value[0] in "\"'" or value.isupper() or value.isdigit()
        return f"`{name}={value}`" if is_plain else f'`{name}="{value}"`'

    parts = re.split(_COMMAND, words)
    return "".join(part if at % 2 else re.sub(_OPTION, argument, part) for at, part in enumerate(parts))


class Error(Exception):
    """What is wrong with an argument, an input or a definition, in words for people; `str(error)` is all of it.

    Each kind has a class of its own: `ArgumentError`, `DefinitionError`, `InputError`, `OutputError`, `QueryError`,
    `RecordError`.

    Attributes:
        message: what, where, expected and found, without the remedy.
        hint: what to do about it; None if there is nothing to add.
        faults: each fault of a definition file, a condition or a query with its place, as dicts with the keys `file`,
            `line`, `column` (both from 1), `text`, `message`, `label` and `help`; empty for other errors.

    Example:
        >>> import mirrorstats as ms
        >>> study = ms.open(ms.example_runs())
        >>> try:
        ...     study.table("mian")
        ... except ms.Error as error:
        ...     print(type(error).__name__, "-", error.message)
        ArgumentError - no table of the style `default` is named `mian`; it has main, appendix; did you mean `main`?
    """

    message: str
    hint: Optional[str]
    faults: list[dict[str, Any]]

    def __init__(self, words: str, faults: Optional[list[dict[str, Any]]] = None) -> None:
        words = in_python(words)
        super().__init__(words)
        message, _, hint = words.partition("\n  help: ")
        self.message = message
        self.hint = hint or next((fault["help"] for fault in faults or [] if fault["help"]), None)
        self.faults = [{**fault, "file": in_python(fault["file"]).strip("`")} for fault in faults or []]


class ArgumentError(Error, ValueError):
    """An argument with a value that it cannot have: no such table, figure, metric, column or episode, a number out of range."""


class DefinitionError(Error):
    """Faults of definitions, a condition, a style or an experiment; `faults` has each with its place."""


class InputError(Error):
    """Files or frames that are missing, damaged, mixed, or changed while they were open."""


class OutputError(Error):
    """An output that cannot be written, or may not be written there."""


class QueryError(Error):
    """A query that cannot be run; `faults` has each fault with its place."""


class RecordError(Error):
    """A recording that could not begin, or could not go on."""


def of_words(kind: str, words: str, faults: str) -> Error:
    """The error that the native library raises; `faults` is JSON."""
    return next(each for each in Error.__subclasses__() if each.__name__ == kind)(words, json.loads(faults))


def check_number(name: str, value: Any, least: int) -> None:
    """Accepts integers of at least this size, and None."""
    if value is not None and (not isinstance(value, int) or isinstance(value, bool) or value < least):
        raise ArgumentError(f"{name}: expected an integer of at least {least}, found {value!r}")


def check_type(name: str, value: Any, wanted: type, words: str) -> None:
    """Accepts values of a type, and None."""
    if value is not None and not isinstance(value, wanted):
        raise TypeError(f"{name}: expected {words}, found {type(value).__name__}")


def is_number(value: Any) -> bool:
    """Returns true for an integer or a float, but not for a truth value."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def check_share(name: str, value: Any) -> None:
    """Accepts numbers strictly between 0 and 1."""
    if not is_number(value) or not 0 < value < 1:
        raise ArgumentError(f"{name}: expected a number between 0 and 1 such as 0.95, found {value!r}")


def check_margin(value: Any) -> None:
    """Accepts numbers above 0."""
    if not is_number(value) or not 0 < value < float("inf"):
        raise ArgumentError(f"margin: expected a number above 0 such as 0.1, found {value!r}")


def check_name(name: str, value: Any, known: tuple[str, ...]) -> None:
    if value not in known:
        raise ArgumentError(f"{name}: expected {', '.join(map(repr, known))}, found {value!r}")
