"""The rules of traces."""

from __future__ import annotations

import os

from . import _native
from ._answer import Answer
from ._paths import Path, Paths, texts


def validate(paths: Paths, *, definitions: Path = "paper", threads: int | None = None) -> Answer:
    """Checks traces against every rule of the schema, as `mirrorstats trace validate --json`.

    Args:
        paths: files, folders or globs, one or several.
        definitions: the definitions whose experiments are known: `paper`, `extended`, or a TOML file.
        threads: how many threads to use; all cores if None.

    Returns:
        `files`, and `findings`: each with `severity` (`error`, `note`), `code`, the place, `expected`, `found` and `help`. No
        rule is broken where none of them is an error.

    Raises:
        Error: no such file.
    """
    return Answer(_native.validate(texts(paths), os.fspath(definitions), threads))
