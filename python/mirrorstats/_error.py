"""The one exception of the package."""

from __future__ import annotations

import json
from typing import Any


class Error(Exception):
    """What the command line says of an input, a definition or an option that is not as it must be.

    `str(error)` is all of it.

    Attributes:
        message: what, where, expected and found, without the remedy.
        hint: what to do about it; None where there is nothing to add.
        code: the code that the command would end with.
        faults: each fault of a definition file or a condition with its place, as dicts with the keys `file`, `line`,
            `column` (both from 1), `text`, `message`, `label` and `help`; empty for other errors.
    """

    message: str
    hint: str | None
    code: int
    faults: list[dict[str, Any]]

    def __init__(self, words: str, code: int = 2, faults: list[dict[str, Any]] | None = None) -> None:
        super().__init__(words)
        message, _, hint = words.partition("\n  help: ")
        self.message = message
        self.hint = hint or next((fault["help"] for fault in faults or [] if fault["help"]), None)
        self.code = code
        self.faults = faults or []


def of_words(words: str, code: int, faults: str) -> Error:
    """The error that the native library raises; `faults` is JSON."""
    return Error(words, code, json.loads(faults))
