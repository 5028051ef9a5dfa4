"""Paths as the native library takes them."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Union

Path = Union[str, "os.PathLike[str]"]
Paths = Union[Path, Iterable[Path]]


def texts(paths: Paths) -> list[str]:
    """One path or several, as texts."""
    several = [paths] if isinstance(paths, (str, os.PathLike)) else paths
    return [os.fspath(path) for path in several]
