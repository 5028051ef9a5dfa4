"""The traces that the package carries."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pathlib


def example_runs() -> pathlib.Path:
    """The folder of the traces that the package carries: those of the paper's 840 episodes.

    They are reconstructed from the paper's published tables, and are not the original recordings. On the command line,
    `mirrorstats report "$(mirrorstats-example-runs)"` reports on them.

    Example:
        >>> import mirrorstats as ms
        >>> len(sorted(ms.example_runs().glob("*.parquet")))
        40

    Raises:
        FileNotFoundError: in a package that was not built by `make wheel`.
    """
    import pathlib

    folder = pathlib.Path(__file__).parent / "runs"
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: this build carries no traces; `make wheel` builds one that does")
    return folder


def main() -> int:
    """Prints the folder; the command `mirrorstats-example-runs`."""
    try:
        print(example_runs())
    except FileNotFoundError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0
