"""Maps of heights as they come: checked, and read from CSV files."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from robustpolish.brush.surfaces.polished_surface import Floats
from robustpolish.brush.surfaces.uniform_spline import FEWEST
from robustpolish.files import Wanted, text
from robustpolish.validation import described, invalid, one_of, positive

_METRES = {"m": 1.0, "mm": 1e-3, "um": 1e-6}
FILE = Wanted("path", "a file that can be read", "Check the path.", 100_000_000)
"""What the files of this room are."""

_ATOM, _TOWN = 1e-10, 1e4  # m; squares and their ratios stay far from the ends of doubles
_EVEN = 1e-4  # steps may differ by this share: files round their numbers


def scale_of(unit: str) -> float:
    """Return how many metres a unit is."""
    return _METRES[one_of("unit", unit, _METRES)]


def check_size(argument: str, places: Floats) -> None:
    """Refuse what is no mould's size: smaller than an atom, larger or further away than a town."""
    largest, wide = float(np.max(np.abs(places))), float(np.max(np.ptp(places, axis=0)))
    if not (largest < _TOWN and wide > _ATOM):
        shown = described(f"places up to {largest:.3g} m, over {wide:.3g} m")
        want = f"a size in metres from {_ATOM:g} to {_TOWN:g}"
        raise invalid(argument, shown, want, "Check the unit.")


def checked(heights: ArrayLike, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Return places along x and y and the heights, or say what is wrong with them."""
    along, across = _places("x", x), _places("y", y)
    found = np.array(heights, dtype=float)
    if found.shape != (along.size, across.size):
        raise invalid(
            "heights", described(f"shape {found.shape}"), f"shape {(along.size, across.size)}",
            "One row per place of x, one column per place of y.",
        )  # fmt: skip
    missing = np.argwhere(~np.isfinite(found))
    if missing.size:
        i, j = missing[0]
        raise invalid(
            "heights",
            described(f"{len(missing)} that are no number, the first at x[{i}], y[{j}]"),
            "finite heights everywhere",
            "Fill the holes, or cut the map down to where it was measured.",
        )
    return along, across, found


def _places(name: str, values: ArrayLike) -> Floats:
    places = np.array(values, dtype=float)
    if places.ndim != 1 or places.size < FEWEST or not np.all(np.isfinite(places)):
        shown = described(f"shape {places.shape}")
        raise invalid(name, shown, f"at least {FEWEST} finite numbers in a row", "Give more.")
    steps = np.diff(places)
    if not steps.min() > 0 or np.ptp(steps) > _EVEN * steps.mean():
        shown = described(f"steps from {steps.min():g} to {steps.max():g}")
        raise invalid(
            name, shown, "rising, equally spaced places", "Resample the map on an even grid."
        )
    return np.linspace(places[0], places[-1], places.size)


def read_csv(
    path: str | Path, spacing: float | None, wanted: Wanted = FILE
) -> tuple[Floats, Floats, Floats]:
    """Return heights, x and y of a file; with a spacing, the file holds heights alone."""
    lines = io.StringIO(text(path, wanted, "utf-8-sig"), newline="")
    path = Path(path)
    try:
        rows = [row for row in csv.reader(lines) if any(cell.strip() for cell in row)]
    except csv.Error as error:
        shown = described(f"{path} ({error})")
        raise invalid("path", shown, "a CSV file that can be read", "Check it.") from None
    if len({len(row) for row in rows}) != 1:
        shown = described(f"{path.name} with {len(rows)} rows of unequal lengths or none")
        raise invalid("path", shown, "rows of the same length", "Check the file.")
    if spacing is None:
        rows[0][0] = ""  # the corner, which may have a name
    table = np.array(
        [[_number(path, text, i, j) for j, text in enumerate(row)] for i, row in enumerate(rows)]
    )
    if spacing is None:
        return table[1:, 1:], table[1:, 0], table[0, 1:]
    step = positive("spacing", spacing)
    return table, step * np.arange(table.shape[0]), step * np.arange(table.shape[1])


def _number(path: Path, text: str, row: int, column: int) -> float:
    if text.strip().lower() in ("", "nan"):
        return math.nan
    try:
        return float(text)
    except ValueError:
        shown = described(f"{text!r} in row {row + 1}, column {column + 1} of {path.name}")
        raise invalid("path", shown, "a number", "Correct the file.") from None
