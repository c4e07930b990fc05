"""Run every notebook in full and say how long each took; `make notebooks` calls it.

Each text, `NAME.md`, is where changes are made and read; its pair, `NAME.ipynb`, carries the
outputs and opens in JupyterLab or on a forge. Here the pair is written, once the text has run.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import jupytext
import nbclient
from nbformat import NotebookNode

FOLDER = Path(__file__).parent
LIMIT = 120.0  # seconds that a notebook may take on two idle cores


def main(names: list[str]) -> int:
    """Run all notebooks, or those whose names contain one of `names`; count the failures."""
    os.environ["TQDM_DISABLE"] = "1"  # progress bars belong on a screen, not in a file
    failures = 0
    for path in sorted(FOLDER.glob("*.md")):
        if names and not any(name in path.stem for name in names):
            continue
        notebook, start, remark = jupytext.read(path), time.perf_counter(), ""
        try:
            nbclient.NotebookClient(
                notebook,
                timeout=900,
                kernel_name="python3",
                resources={"metadata": {"path": str(FOLDER)}},
            ).execute()
        except nbclient.exceptions.CellExecutionError as error:
            failures += 1
            remark = f"FAILED, {path.stem}.ipynb is left as it was: {error.ename}: {error.evalue}"
        else:
            jupytext.write(as_pair(notebook), path.with_suffix(".ipynb"))
        seconds = time.perf_counter() - start
        if not remark and seconds > LIMIT:
            remark = f"slower than {LIMIT:.0f} s"
        print(f"{path.stem:28s} {seconds:6.1f} s  {remark}", flush=True)
    return failures


def as_pair(notebook: NotebookNode) -> NotebookNode:
    """Return the notebook as it is kept: no times, no random names, code that is hidden folded."""
    notebook.metadata = {
        "jupytext": {"cell_metadata_filter": notebook.metadata["jupytext"]["cell_metadata_filter"]},
        "kernelspec": dict(notebook.metadata["kernelspec"]),
        "language_info": {"name": "python", "pygments_lexer": "ipython3"},
    }
    for number, cell in enumerate(notebook.cells):
        cell["id"] = f"cell-{number}"
        cell.metadata.pop("execution", None)
        if "hide-input" in cell.metadata.get("tags", ()):
            cell.metadata["jupyter"] = {"source_hidden": True}
    return notebook


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
