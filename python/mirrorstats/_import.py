"""Steps of any harness as a trace."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Mapping
from typing import Any, Optional, Union

from . import _native
from ._answer import Imported
from ._error import ArgumentError, OutputError, check_name
from ._paths import Definitions, Path, Spool, is_frame, text, toml_file

# Traces without a given name stay until the interpreter ends.
_unnamed = Spool()


def import_steps(
    rows: Union[Iterable[Mapping[str, Any]], Any],
    out: Optional[Path] = None,
    *,
    definitions: Definitions = "paper",
    palette: Union[str, Iterable[str], None] = None,
    cluster: Optional[str] = None,
    reconstruction: bool = False,
) -> Imported:
    """Makes a trace of steps, so that episodes of any harness can be scored.

    Args:
        rows: one row per step, with the columns of the schema (`mirrorstats trace schema step`): an iterable of dicts, or a
            data frame of Polars, pandas, pyarrow or DuckDB. None, NaN, NA and null stand for a value that is not there. A
            whole number is an integer, also where pandas made it a float. Other columns are kept. Rows may be in any order.
        out: the trace to write, a name that ends in .parquet; if None, a temporary file until the interpreter ends.
        definitions: the definitions whose experiments are known: `paper`, `extended`, a TOML file, TOML text or a dict.
        palette: the colours that there are, which the trace then declares: names, or `default`, the ten of the study.
        cluster: `seed` if episodes of one seed are more alike than chance.
        reconstruction: whether the steps are rebuilt from published numbers, so that statistics take no pairs from them.

    Returns:
        `out` (the trace), `episodes` and `steps` (how many), `columns` (those of the schema), `own_columns` (others).

    Raises:
        InputError: every column with a value that it cannot have, once, with the first row and the number of rows; every
            episode that is not whole. Nothing is written then.
        OutputError: an `out` that does not end in .parquet, or cannot be written.
        TypeError: a value that is no text, number, truth value or null, such as a date, with its row and column.

    Example:
        >>> import mirrorstats as ms
        >>> step = {"episode_id": "E1/me/s1/r1", "model": "me", "experiment": "E1", "seed": 1, "run": 1,
        ...         "body_color": "red", "self_color": "red", "selected_cube": "red", "mirror_visible": True}
        >>> steps = [{**step, "t": 1, "action": "turn_left"}, {**step, "t": 2, "action": "done"}]
        >>> print(ms.import_steps(steps))
        imported 1 episode, 2 steps into steps.parquet
        <BLANKLINE>
    """
    check_name("cluster", cluster, (None, "seed"))  # type: ignore[arg-type]
    if cluster is not None and reconstruction:
        raise ArgumentError("cluster and reconstruction exclude each other")
    if palette is not None and not isinstance(palette, str):
        # A text with a comma is not a file name.
        palette = ",".join([*palette, ""])
    spool = Spool()
    target = _unnamed.new("steps.parquet") if out is None else text(out, spool)
    if not target.endswith(".parquet"):
        raise OutputError(f"out: expected a name that ends in .parquet, found {target!r}\n  help: a trace is a Parquet file")
    known = toml_file(definitions, "definitions", spool)
    return trace_of(lines(rows)[1], target, known, palette, cluster == "seed", reconstruction)


def trace_of(
    rows: bytes,
    out: str,
    definitions: str,
    palette: Optional[str] = None,
    clusters_by_seed: bool = False,
    reconstruction: bool = False,
) -> Imported:
    asked = {
        "out": out,
        "definitions": definitions,
        "palette": palette,
        "clusters_by_seed": clusters_by_seed,
        "reconstruction": reconstruction,
    }
    answer = Imported(_native.import_text("rows", rows, asked))
    # The path of the file, not its name in messages.
    answer["out"] = out
    return answer


def lines(rows: Any) -> tuple[list[str], bytes]:
    """The columns of some rows, and the rows as JSON lines."""
    if not hasattr(rows, "__arrow_c_stream__") and is_frame(rows):
        rows = rows.collect()
    if hasattr(rows, "__arrow_c_stream__"):
        try:
            stream = rows.__arrow_c_stream__()
        except ImportError:
            # pandas without pyarrow.
            rows = rows.to_dict("records")
        else:
            columns, found = _native.lines_of(stream)
            return columns, found
    if isinstance(rows, (str, bytes, os.PathLike)) or not isinstance(rows, Iterable):
        raise TypeError(
            f"rows: expected dicts or a data frame, found {type(rows).__name__}; read a file first, as with polars.read_csv, "
            "or let `mirrorstats import FILE` read it"
        )
    names: dict[str, None] = {}
    texts = []
    for at, row in enumerate(rows):
        if not isinstance(row, Mapping):
            raise TypeError(f"row {at} (from 0): expected a dict, found {type(row).__name__}")
        names.update(dict.fromkeys(row))
        texts.append(json.dumps({key: _plain(value, at, key) for key, value in row.items()}, ensure_ascii=False) + "\n")
    return list(names), "".join(texts).encode()


def _plain(value: Any, at: int, key: str) -> Any:
    """A value for JSON; NaN, NA and NaT become null."""
    if value is None or type(value).__name__ in ("NAType", "NaTType"):
        return None
    if hasattr(value, "item") and getattr(value, "ndim", None) == 0:
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        if math.isnan(value):
            return None
        raise ValueError(f"row {at} (from 0), column `{key}`: expected a finite number, found {value}")
    if isinstance(value, (str, bool, int, float)):
        return value
    expected = "expected a text, a number, a truth value or None"
    raise TypeError(f"row {at} (from 0), column `{key}`: {expected}, found {type(value).__name__}")
