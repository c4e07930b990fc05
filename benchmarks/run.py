"""Time everything, write docs/benchmarks.json, and make docs/benchmarks.md of it.

Run with ``make bench``, or ``python -m benchmarks.run --quick`` for a look (which writes nothing
unless ``--out`` says where). ``--only`` names families. Times are of the processor, on one thread;
what counts are ratios, of two times in the same run. The files are written after each line.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
import warnings
from collections.abc import Iterator
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

import robustpolish as rp
from benchmarks import page
from benchmarks.row import Row

ROOT = Path(__file__).parents[1]
PEERS = ("numpy", "scipy", "numba", "control", "slycot", "cvxpy", "clarabel")


FAMILIES = {
    "start-up": "start_up",
    "norms": "norms",
    "synthesis": "synthesis",
    "growth": "growth",
    "closed loops": "closed_loop",
    "sweeps": "sweeps",
    "brush": "brush",
    "diagnosis": "diagnosis",
    "robust analysis": "robust",
}
"""What yields the lines of each family, in the order of the page, by the name of its module."""


def lines(family: str, quick: bool, python: Path | None) -> Iterator[Row]:
    """Return the lines of a family; only its module is loaded, for workers of a sweep load this."""
    rows = import_module(f"benchmarks.{FAMILIES[family]}").rows
    return rows(quick, python) if family == "diagnosis" else rows(quick)


def machine() -> dict[str, object]:
    """Say on what, and how busy it is."""
    names = Path("/proc/cpuinfo")
    lines = names.read_text().splitlines() if names.exists() else []
    model = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    return {
        "processor": model[0] if model else platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "robustpolish": rp.__version__,
        "peers": {name: version(name) for name in PEERS},
        "load at the start": round(load, 1),
    }


def _kept(out: Path | None) -> list[dict[str, Any]]:
    """Return the lines that are there already, for a run of some families only."""
    path = None if out is None else out / "benchmarks.json"
    return json.loads(path.read_text(encoding="utf-8"))["rows"] if path and path.exists() else []


def _keep(out: Path, found: dict[str, Any]) -> None:
    """Write both files."""
    out.mkdir(parents=True, exist_ok=True)
    text = json.dumps(found, indent=1, ensure_ascii=False)
    (out / "benchmarks.json").write_text(text + "\n", encoding="utf-8")
    (out / "benchmarks.md").write_text(page.page(found), encoding="utf-8")


def main() -> None:
    """Run what is asked for and keep it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="small sizes; keeps nothing")
    parser.add_argument("--only", nargs="+", default=[], help="families, by name; others stay")
    parser.add_argument("--out", type=Path, help="another folder for benchmarks.json and .md")
    parser.add_argument("--pysindy", type=Path, help="an interpreter that has pysindy")
    parser.add_argument("--note", default="", help="what else is to be known about this run")
    given = parser.parse_args()
    if unknown := set(given.only) - set(FAMILIES):
        known = ", ".join(FAMILIES)
        parser.error(f"no such family: {', '.join(sorted(unknown))}; there are {known}")
    if given.quick and given.out and given.out.resolve() == ROOT / "docs":
        parser.error("--quick is for a look: the page of the documentation holds the full sizes")
    # Plants that are nearly beyond control, and peers' programs, say so; the table is what counts.
    warnings.simplefilter("ignore")
    found = {"machine": machine(), "date": time.strftime("%Y-%m-%d"), "note": given.note}
    out = given.out or (None if given.quick or given.only else ROOT / "docs")
    kept = _kept(out) if given.only else []
    new: list[dict[str, Any]] = []
    for family in given.only or FAMILIES:
        for row in lines(family, given.quick, given.pysindy):
            new.append(row.as_json())
            print(page.line(new[-1]), flush=True)
            if out is not None:  # after each, for a run that ends early
                others = [row for row in kept if row["family"] not in {r["family"] for r in new}]
                rows = sorted(others + new, key=lambda row: list(FAMILIES).index(row["family"]))
                _keep(out, found | {"rows": rows})
    print(f"{sum(os.times()[:4]) / 60:.1f} minutes of the processor")
    if silent := [row["task"] for row in new if page.unexplained(row)]:
        parser.exit(1, f"Slower than the peer, or without a time, and no reason: {silent}\n")


if __name__ == "__main__":
    with threadpool_limits(1):
        main()
