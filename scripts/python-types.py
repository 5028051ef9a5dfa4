#!/usr/bin/env python3
"""Writes python/mirrorstats/types.py: the shapes of Python's answers, from schemas/. `--check` only looks whether it is current."""

import json
import re
import pathlib
import sys

ROOT = pathlib.Path(__file__).parent.parent
TARGET = ROOT / "python/mirrorstats/types.py"
# The class of each answer, and the schema of what it holds.
ANSWERS = {
    "Changes": "diff",
    "Explanation": "score-explain",
    "Gate": "gate",
    "Imported": "import",
    "Manifest": "manifest",
    "Recorded": "record",
    "Statistics": "stats",
    "Validation": "validation",
}
HEAD = '''"""The shapes of answers, for type checkers: dicts as JSON has them. Written by scripts/python-types.py from schemas/."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, Optional, TypedDict, Union, overload

if TYPE_CHECKING:
    from . import _dict
'''
PLAIN = {"string": "str", "integer": "int", "number": "float", "boolean": "bool", "object": "dict[str, Any]", "null": "None"}


class Shapes:
    """All definitions under names of their own."""

    def __init__(self):
        self.known = {}

    def add(self, answer, document):
        """Takes the definitions of a schema; one that differs from another of the same name is named after its answer."""
        names = {}
        for name, shape in document.get("$defs", {}).items():
            taken = self.known.get(name)
            names[name] = name if taken in (None, (shape, names)) or taken[0] == shape else answer + name
        for name, shape in document.get("$defs", {}).items():
            # stubtest takes no alias of several literals: their values are in its place.
            if literals(shape):
                names[name] = literals(shape)
            else:
                self.known.setdefault(names[name], (shape, names))
        return names


def union(kinds):
    kinds = list(dict.fromkeys(kinds))
    others = [kind for kind in kinds if kind != "None"]
    both = others[0] if len(others) == 1 else f"Union[{', '.join(others)}]" if others else "Any"
    return f"Optional[{both}]" if "None" in kinds and both != "Any" else both


def literals(shape):
    """The values of an enumeration of texts, else None."""
    parts = shape.get("oneOf", [shape])
    values = [value for part in parts for value in part.get("enum", [part["const"]] if "const" in part else [None])]
    return None if None in values else f"Literal[{', '.join(map(json.dumps, values))}]"


def kind(shape, names):
    if not isinstance(shape, dict):
        return "Any"
    if "$ref" in shape:
        return names[shape["$ref"].rsplit("/", 1)[1]]
    if literals(shape):
        return literals(shape)
    for word in ("anyOf", "oneOf", "allOf"):
        if word in shape:
            return union(kind(part, names) for part in shape[word])
    types = shape.get("type", [])
    if isinstance(types, list):
        return union(kind({**shape, "type": one}, names) for one in types) if types else "Any"
    if types == "array":
        parts = shape.get("prefixItems", [shape.get("items", True)])
        return f"list[{union(kind(part, names) for part in parts)}]"
    if types == "object" and isinstance(shape.get("additionalProperties"), dict):
        return f"dict[str, {kind(shape['additionalProperties'], names)}]"
    return PLAIN[types]


def words(shape):
    return " ".join(shape.get("description", "").split()).replace("\\", "\\\\").replace('"""', "'''")


def typed_dict(name, shape, names):
    fields = {key: kind(field, names) for key, field in shape["properties"].items()}
    required = set(shape.get("required", []))
    parts = [[key for key in fields if key in required], [key for key in fields if key not in required]]
    if parts[0] and parts[1]:
        yield f"\n\nclass _{name}(TypedDict):"
        yield from (f"    {key}: {fields[key]}" for key in parts[0])
    base = f"_{name}, total=False" if parts[0] and parts[1] else "TypedDict" if parts[0] else "TypedDict, total=False"
    yield f'\n\nclass {name}({base}):\n    """{words(shape)}"""'
    yield from (f"    {key}: {fields[key]}" for key in parts[1] or parts[0])


def keys(answer, document, names):
    by_kind = {}
    for key, field in document["properties"].items():
        by_kind.setdefault(kind(field, names), []).append(json.dumps(key))
    yield f"\n    class _{answer}Keys(_dict.Answer):"
    for at, (value, keys_of_kind) in enumerate(by_kind.items()):
        ignored = "  # type: ignore[override]" if at == 0 else ""
        yield f"        @overload{ignored}"
        yield f"        def __getitem__(self, key: Literal[{', '.join(keys_of_kind)}], /) -> {value}: ..."
    yield "        def __getitem__(self, key: str, /) -> Any: ..."


def written():
    shapes, documents = Shapes(), {}
    for answer, schema in ANSWERS.items():
        document = json.loads((ROOT / f"schemas/{schema}.schema.json").read_text())
        documents[answer] = (document, shapes.add(answer, document))
    known = sorted(shapes.known.items())
    lines = []
    objects = [(name, shape, names) for name, (shape, names) in known if "properties" in shape and "oneOf" not in shape]
    for name, shape, names in objects:
        lines += typed_dict(name, shape, names)
    done = {name for name, *_ in objects}
    others = {name: kind(shape, names) for name, (shape, names) in known if name not in done}
    # An alias is evaluated where it is written, so those that name another one follow it.
    names_another = lambda name: any(re.search(rf"\b{other}\b", others[name]) for other in others)
    lines += ["\n"] + [f"{name} = {others[name]}" for name in sorted(others, key=lambda name: (names_another(name), name))]
    lines.append("\nif TYPE_CHECKING:")
    for answer, (document, names) in documents.items():
        lines += keys(answer, document, names)
    return HEAD + "\n".join(lines) + "\n"


if __name__ == "__main__":
    if sys.argv[1:] == ["--check"]:
        sys.exit(TARGET.read_text() != written() and f"{TARGET} is not current; {sys.argv[0]} writes it")
    TARGET.write_text(written())
