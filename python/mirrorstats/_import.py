"""Steps of any harness as a trace."""

from __future__ import annotations

import atexit
import json
import os
import pathlib
import shutil
import tempfile
from collections.abc import Iterable, Mapping
from typing import Any

from . import _native
from ._answer import Answer
from ._paths import Path


def import_steps(
    rows: Iterable[Mapping[str, Any]] | Any,
    out: Path | None = None,
    *,
    definitions: Path = "paper",
    palette: str | Iterable[str] | None = None,
    cluster: str | None = None,
    reconstruction: bool = False,
) -> Answer:
    """Makes a trace of steps, so that episodes of any harness can be scored.

    Args:
        rows: one row per step, with the columns of the schema (`mirrorstats trace schema step`): an iterable of dicts, or a
            data frame of any library that gives Arrow streams (`__arrow_c_stream__`: Polars, pandas, pyarrow, DuckDB).
            None and null stand for a value that is not there. Other columns are kept. Rows may be in any order.
        out: the trace to write, a name that ends in .parquet. Where none is given, the trace is a temporary file until
            the interpreter ends.
        definitions: the definitions whose experiments are known: `paper`, `extended`, or a TOML file.
        palette: the colours that there are, which the trace then declares: names, or `default`, the ten of the study.
        cluster: `seed` where episodes of one seed are more alike than chance.
        reconstruction: whether the steps are rebuilt from published numbers, so that statistics take no pairs from them.

    Returns:
        `out` (the trace), `episodes` and `steps` (how many), `columns` (those of the schema), `own_columns` (others).

    Raises:
        Error: every row that is no step and every episode that is not whole, by row; nothing is written then.
        TypeError: a value that JSON does not have, such as a date.
        ValueError: a number that is not finite; another `cluster`, or one with `reconstruction`.
    """
    out = os.fspath(out) if out is not None else _temporary()
    if cluster not in (None, "seed"):
        raise ValueError(f"cluster: expected 'seed' or None, found {cluster!r}")
    if cluster is not None and reconstruction:
        raise ValueError("cluster and reconstruction exclude each other")
    if palette is not None and not isinstance(palette, str):
        # With a comma it is no name of a file.
        palette = ",".join([*palette, ""])
    asked = {
        "out": out,
        "definitions": os.fspath(definitions),
        "palette": palette,
        "clusters_by_seed": cluster == "seed",
        "reconstruction": reconstruction,
    }
    answer = Answer(_native.import_text("rows", _lines(rows), asked))
    # Where it is, not how messages call it.
    answer["out"] = out
    return answer


def _lines(rows: Any) -> bytes:
    """The rows as lines of JSON."""
    if hasattr(rows, "__arrow_c_stream__"):
        return _native.lines_of(rows.__arrow_c_stream__())
    lines = (json.dumps(dict(row), allow_nan=False, ensure_ascii=False, default=_plain) for row in rows)
    return "".join(f"{line}\n" for line in lines).encode()


def _plain(value: Any) -> Any:
    """A number or a truth value of NumPy as one of Python."""
    if hasattr(value, "item") and getattr(value, "ndim", None) == 0:
        return value.item()
    raise TypeError(f"expected text, a number, a truth value or None, found {type(value).__name__}")


def _temporary() -> str:
    folder = tempfile.mkdtemp(prefix="mirrorstats-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return str(pathlib.Path(folder) / "steps.parquet")
