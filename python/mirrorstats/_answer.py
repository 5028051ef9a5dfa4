"""Answers: what a command prints as JSON, and what it prints for people."""

from __future__ import annotations

import html
import json
from typing import Any


class Answer(dict[str, Any]):
    """An answer with the keys that `--json` has; what is undefined or unknown is None.

    `print(answer)` prints what the command prints; a notebook shows the same.

    Attributes:
        text: what the command prints for people.
    """

    text: str

    def __init__(self, parts: tuple[str, str]) -> None:
        super().__init__(json.loads(parts[0]))
        self.text = parts[1]

    def __str__(self) -> str:
        return self.text or super().__str__()

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"
