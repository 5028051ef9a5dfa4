"""Inputs for the native library: paths as text; data frames, text and dicts as files of this process."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal, Optional, Union

if TYPE_CHECKING:
    import tempfile

Path = Union[str, "os.PathLike[str]"]
# A definition file, a style or an experiment: a name, a path, TOML text, or a dict with the keys of the file.
Toml = Union[str, "os.PathLike[str]", Mapping[str, Any]]
# Lets type checkers complete the built-in names.
Definitions = Union[Literal["paper", "extended"], Toml]
Style = Union[Literal["default", "paper"], Toml]


class Spool:
    """A temporary folder for inputs without a file; it exists as long as this object."""

    def __init__(self, files: Optional[dict[str, bytes]] = None) -> None:
        self._folder: Optional[tempfile.TemporaryDirectory[str]] = None
        for name, content in (files or {}).items():
            self.keep(name, content)

    @property
    def path(self) -> str:
        if self._folder is None:
            import tempfile

            self._folder = tempfile.TemporaryDirectory(prefix="mirrorstats-", ignore_cleanup_errors=True)
        return self._folder.name

    def keep(self, name: str, content: bytes) -> str:
        """Writes a file and returns its path."""
        path = os.path.join(self.path, name)
        with open(path, "wb") as file:
            file.write(content)
        return path

    def clear(self) -> None:
        """Removes the folder."""
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    def new(self, name: str) -> str:
        """The path of a file that does not exist yet."""
        (stem, ending), at = os.path.splitext(name), 1
        while os.path.exists(os.path.join(self.path, name)):
            at += 1
            name = f"{stem}-{at}{ending}"
        return os.path.join(self.path, name)

    def files(self) -> dict[str, bytes]:
        found = sorted(os.scandir(self.path), key=lambda file: file.name) if self._folder else []
        files = {}
        for file in found:
            if file.is_file():
                with open(file.path, "rb") as content:
                    files[file.name] = content.read()
        return files


def text(path: Any, spool: Spool) -> str:
    """A path as text. Expands `~` and `file://`, and copies remote files that fsspec has opened."""
    filesystem, place = getattr(path, "fs", None), getattr(path, "path", None)
    if filesystem is not None and isinstance(place, str):
        protocol = filesystem.protocol if isinstance(filesystem.protocol, str) else filesystem.protocol[0]
        if protocol in ("file", "local"):
            return place
        copy = spool.new(os.path.basename(place))
        filesystem.get_file(place, copy)
        return copy
    path = os.fspath(path)
    named = str(os.fsdecode(path))
    if named.startswith("file://"):
        # Imported here since the module imports HTTP and TLS.
        import urllib.parse
        import urllib.request

        named = urllib.request.url2pathname(urllib.parse.urlsplit(named).path)
    return os.path.expanduser(named)


def is_frame(value: Any) -> bool:
    """Returns true for a data frame of Polars, pandas, Arrow or DuckDB."""
    if hasattr(value, "collect") and hasattr(value, "collect_schema"):
        return True
    # A series has a stream but no columns.
    has_columns = any(hasattr(value, name) for name in ("columns", "column_names", "schema"))
    return has_columns and hasattr(value, "__arrow_c_stream__")


def several(paths: Any) -> list[Any]:
    """One input or several; rows as dicts are one input."""
    is_one = isinstance(paths, (str, bytes, os.PathLike, Mapping)) or is_frame(paths)
    is_one = is_one or hasattr(paths, "fs") or hasattr(paths, "__arrow_c_stream__")
    if is_one or not isinstance(paths, Iterable):
        return [paths]
    found = list(paths)
    return [found] if found and all(isinstance(row, Mapping) for row in found) else found


def toml_file(value: Toml, noun: str, spool: Spool) -> str:
    """A name or path unchanged; TOML text or a dict as a file."""
    if isinstance(value, Mapping):
        return spool.keep(f"{noun}.toml", "\n".join(_tables(value)).encode())
    if not isinstance(value, (str, bytes, os.PathLike)) and not hasattr(value, "fs"):
        raise TypeError(f"{noun}: expected a name, a path, TOML text or a dict, found {type(value).__name__}")
    path = text(value, spool)
    is_toml = "\n" in path or ("=" in path and not path.endswith(".toml"))
    return spool.keep(f"{noun}.toml", path.encode()) if is_toml else path


def _tables(table: Mapping[str, Any], name: str = "") -> Iterable[str]:
    """The lines of a TOML table: values first, then the tables in it."""
    inner = {key: value for key, value in table.items() if isinstance(value, Mapping)}
    if name and (len(inner) < len(table) or not table):
        yield f"[{name}]"
    for key, value in table.items():
        if key not in inner and value is not None:
            yield f"{json.dumps(key)} = {_value(value)}"
    for key, value in inner.items():
        yield from _tables(value, f"{name}.{json.dumps(key)}" if name else json.dumps(key))


def _value(value: Any) -> str:
    """A TOML value: the same as in JSON, except tables in lists."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(key)} = {_value(one)}" for key, one in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, (str, bool, int, float)):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    raise TypeError(f"expected a text, a number, a truth value, a list or a dict, found {type(value).__name__}")
