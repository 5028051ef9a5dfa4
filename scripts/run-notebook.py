"""run-notebook.py NOTEBOOK FOLDER: executes a notebook in a new folder; fails as its first failing cell does."""

import pathlib
import sys

import nbformat
from nbclient import NotebookClient

source, folder = map(pathlib.Path, sys.argv[1:])
folder.mkdir()
notebook = nbformat.read(source, as_version=4)
NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(folder)}}).execute()
shown = [output for cell in notebook.cells for output in cell.get("outputs", [])]
kinds = {kind for output in shown for kind in output.get("data", {})}
for kind in ("text/html", "image/svg+xml"):
    if kind not in kinds:
        sys.exit(f"run-notebook: expected a cell that shows {kind}, found {sorted(kinds)}")
print(f"run-notebook: {len(notebook.cells)} cells")
