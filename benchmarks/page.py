"""The page docs/benchmarks.md, made of docs/benchmarks.json.

``python -m benchmarks.page`` writes it anew without timing anything.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[1] / "docs"
HEAD = "| task | ours | ms | peer | ms | ratio | asked | answers | why slower, or why no time |"
RULE = "|---|---|---:|---|---:|---:|---:|---|---|"

INTRODUCTION = """\
# Benchmarks

Written by `make bench`, as is [benchmarks.json](benchmarks.json) with the same figures; the code is
in `benchmarks/`, a file per table. All times but those of sweeps are of the processor, on one
thread, without what is compiled once. They depend on the machine, so look at the ratios: our time
over the peer's in the same run, below one where ours is quicker. *asked* is the largest ratio, or
the longest time, that is aimed at; a cross marks what is not reached. Where a peer is quicker, the
last column says why.
"""


def unexplained(row: Mapping[str, Any]) -> bool:
    """Whether a line lacks the reason that it needs."""
    missing = row["our_ms"] is None or (bool(row["peer"]) and row["peer_ms"] is None)
    return (missing or (row["ratio"] or 0) > 1) and not row["reason"].strip()


def line(row: Mapping[str, Any]) -> str:
    """Return one line of a table."""
    asked = ""
    if row["asked"] is not None:
        asked = f"{row['asked']:g} s" if row["seconds"] else f"{row['asked']:g}"
        asked += {True: "", False: " ✗", None: " ?"}[row["met"]]
    ours = row["ours"] if row["ours"] != row["task"] else ""
    cells = [
        row["task"], ours, _number(row["our_ms"]), row["peer"], _number(row["peer_ms"]),
        _number(row["ratio"]), asked, row["answers"], row["reason"],
    ]  # fmt: skip
    return "| " + " | ".join(cells) + " |"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def page(found: Mapping[str, Any]) -> str:
    """Return the whole page."""
    machine = found["machine"]
    peers = ", ".join(f"{name} {number}" for name, number in machine["peers"].items())
    load = machine["load at the start"]
    lines = [
        INTRODUCTION,
        f"Measured on {found['date']}: {machine['processor']}, {machine['cores']} cores, "
        f"{machine['system']}, Python {machine['python']}, robustpolish {machine['robustpolish']}, "
        f"{peers}. The load of the machine at the start was {load}. {found['note']}".strip(),
        "",
    ]
    for family, rows in groupby(found["rows"], key=lambda row: row["family"]):
        lines += [
            f"## {family.capitalize()}",
            "",
            HEAD,
            "|---|---|---:|---|---:|---:|---:|---|---|",
        ]
        lines += [*map(line, rows), ""]
    return "\n".join(lines)


def main() -> None:
    """Write the page."""
    found = json.loads((DOCS / "benchmarks.json").read_text(encoding="utf-8"))
    (DOCS / "benchmarks.md").write_text(page(found), encoding="utf-8")


if __name__ == "__main__":
    main()
