"""The tutorials as notebooks with their results and pictures, made from the scripts beside them.

python -m benchmarks.documentation.tutorials docs/tutorials [NAME ...]
"""

import os
import sys
from pathlib import Path
from typing import Any

import jupytext
from nbclient import NotebookClient

from chaosgym.files import write_atomically

SECONDS = 600
"""Longest time of a cell; the first one may have to compile kernels."""

INLINE = "module://matplotlib_inline.backend_inline"
"""What draws pictures into a notebook, whatever draws elsewhere."""


def executed(script: Path) -> Any:
    """Return the notebook of a script, run in the script's folder."""
    notebook = jupytext.read(script)
    for number, cell in enumerate(notebook.cells):
        cell.id = f"cell-{number}"
    client = NotebookClient(
        notebook,
        timeout=SECONDS,
        record_timing=False,
        coalesce_streams=True,
        resources={"metadata": {"path": script.parent}},
    )
    client.execute(env={**os.environ, "MPLBACKEND": INLINE})
    return notebook


def texts(notebook: Any) -> list[str]:
    """Return what the cells of a notebook printed on standard output."""
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    return [output["text"] for output in outputs if output.get("name") == "stdout"]


def write(script: Path) -> None:
    """Write the notebook of a script beside it."""
    notebook = executed(script)
    for cell in notebook.cells:  # progress and warnings are of no interest to a reader
        if "outputs" in cell:
            cell.outputs = [output for output in cell.outputs if output.get("name") != "stderr"]
    text = jupytext.writes(notebook, fmt="ipynb")
    write_atomically(script.with_suffix(".ipynb"), lambda file: file.write_text(text, encoding="utf-8"))


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    for chosen in [folder / name for name in sys.argv[2:]] or sorted(folder.glob("*.py")):
        print(chosen, file=sys.stderr, flush=True)
        write(chosen)
