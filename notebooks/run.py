"""Run every notebook in full and say how long each took; `make notebooks` calls it.

The executed notebooks, pictures included, go to notebooks/executed/ (not kept in the repository).
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import jupytext
import nbclient

FOLDER = Path(__file__).parent
EXECUTED = FOLDER / "executed"
LIMIT = 120.0  # seconds that a notebook may take on two idle cores


def main(names: list[str]) -> int:
    """Run all notebooks, or those whose names contain one of `names`; count the failures."""
    EXECUTED.mkdir(exist_ok=True)
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
            remark = f"FAILED: {error.ename}: {error.evalue}"
        seconds = time.perf_counter() - start
        if not remark and seconds > LIMIT:
            remark = f"slower than {LIMIT:.0f} s"
        print(f"{path.stem:28s} {seconds:6.1f} s  {remark}", flush=True)
        jupytext.write(notebook, EXECUTED / f"{path.stem}.ipynb")
    return failures


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
