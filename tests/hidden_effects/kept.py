"""Rows on file, so that an interrupted examination goes on where it was.

One row of JSON a line. Its key holds the case and the sources of package and examination: after a
change of either, the case runs again.
"""

import hashlib
import json
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
KEPT = ROOT / ".hidden_effects_rows.jsonl"
"""Where `make hidden-effects` and the long tests keep theirs."""
_JUDGES = ("cases", "curves", "integrator", "intervals", "judge", "motion", "rows")


def key_of(case):
    """Return what a row of a case hangs on."""
    return hashlib.sha256(f"{_sources()} {case!r}".encode()).hexdigest()[:20]


def kept_rows(file):
    """Return the rows in a file by key; none if there is no file, or no file is given.

    A line that an interruption cut off is left out.
    """
    rows = {}
    if file is None or not Path(file).exists():
        return rows
    for line in Path(file).read_text(encoding="utf-8").splitlines():
        try:
            kept = json.loads(line)
        except json.JSONDecodeError:
            continue
        rows[kept["key"]] = kept["row"]
    return rows


def keep(file, case, row):
    """Append the row of a case to a file, if one is given."""
    if file is not None:
        with Path(file).open("a", encoding="utf-8") as out:
            out.write(json.dumps({"key": key_of(case), "row": row}) + "\n")


@cache
def _sources():
    files = sorted((ROOT / "robustpolish").rglob("*.py"))
    files += [Path(__file__).parent / f"{name}.py" for name in _JUDGES]
    content = b"".join(hashlib.sha256(file.read_bytes()).digest() for file in files)
    return hashlib.sha256(content).hexdigest()
