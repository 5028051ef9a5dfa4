"""The base of answers: a dict that shows itself as text."""

from __future__ import annotations

import json
from typing import Any

from ._error import in_python


class Answer(dict[str, Any]):
    """An answer with the keys that the command line prints with `--json`; what is undefined or unknown is None.

    `print(answer)` prints it for people; a notebook shows the same.

    Attributes:
        text: the answer for people.
    """

    text: str

    def __init__(self, parts: tuple[str, str]) -> None:
        super().__init__(json.loads(parts[0]))
        self.text = in_python(parts[1])

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), ((json.dumps(self), self.text),)

    def __str__(self) -> str:
        return self.text or super().__str__()

    def _repr_html_(self) -> str:
        # Imported here since most answers do not need it, and importing it takes time in a notebook.
        import html

        style = "font-family: monospace; white-space: pre; overflow-x: auto; max-height: 40em; line-height: 1.3"
        return f'<pre style="{style}">{html.escape(str(self))}</pre>'
