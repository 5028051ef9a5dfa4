"""The rules of traces."""

from __future__ import annotations

import os
from typing import Any, Optional

from . import _native
from ._answer import Validation
from ._error import ArgumentError, check_number
from ._paths import Definitions, Spool, several, text, toml_file


def validate(inputs: Any, *, definitions: Optional[Definitions] = None, threads: Optional[int] = None) -> Validation:
    """Checks traces against every rule of the schema, as `mirrorstats trace validate --json`.

    Args:
        inputs: files, folders or globs, one or several.
        definitions: the definitions whose experiments are known: `paper`, `extended`, a TOML file, TOML text or a dict.
            If None, those that the traces carry, else `paper`.
        threads: how many threads to use; all cores if None.

    Returns:
        `files`, and `findings`: each with `severity` (`error`, `note`), `code`, the place, `expected`, `found` and `help`. No
        rule is broken where none of them is an error.

    Raises:
        InputError: no such file.

    Example:
        >>> import mirrorstats as ms
        >>> [finding["code"] for finding in ms.validate(ms.example_runs())["findings"] if finding["severity"] == "error"]
        []
    """
    check_number("threads", threads, 1)
    given, spool = several(inputs), Spool()
    if not given:
        raise ArgumentError("inputs: expected at least one file or folder, found none")
    for one in given:
        if not isinstance(one, (str, bytes, os.PathLike)) and not hasattr(one, "fs"):
            raise TypeError(f"inputs: expected a path, found {type(one).__name__}; `import_steps` checks a data frame")
    paths = [text(one, spool) for one in given]
    named = None if definitions is None else toml_file(definitions, "definitions", spool)
    return Validation(_native.validate(paths, named, threads))
