"""Places of a path as they come: checked, read from files, and brought to even times."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from robustpolish.brush.surfaces.grid import FILE, scale_of
from robustpolish.brush.surfaces.polished_surface import Floats
from robustpolish.files import Wanted, text
from robustpolish.validation import described, invalid

Unit = Literal["m", "mm", "um"]
_FINER = 4  # times per shortest interval of a file
_MOST = 400_000


def checked_places(places: ArrayLike) -> Floats:
    """Return corners of a path, shape (n, 2), without repetitions."""
    corners = np.array(places, dtype=float)
    if corners.ndim != 2 or corners.shape[1] != 2 or not np.all(np.isfinite(corners)):
        shown = described(f"shape {corners.shape}, or numbers that are not finite")
        raise invalid("places", shown, "finite x and y, shape (n, 2)", "Correct them.")
    moved = np.concatenate([[True], np.any(np.diff(corners, axis=0) != 0, axis=1)])
    if np.sum(moved) < 2:
        raise invalid("places", described("a single place"), "at least two", "Give more.")
    return corners[moved]


def read_csv(path: str | Path, unit: str, file: Wanted = FILE) -> tuple[Floats, Floats | None]:
    """Return x and y [m], shape (n, 2), and the times [s] if the file has a column t."""
    lines, path = io.StringIO(text(path, file, "utf-8-sig"), newline=""), Path(path)
    try:
        rows = list(csv.DictReader(lines, skipinitialspace=True))
    except csv.Error as error:
        shown = described(f"{path} ({error})")
        raise invalid("path", shown, "a CSV file that can be read", "Check it.") from None
    names = {(name or "").strip().lower(): name for name in (rows[0] if rows else {})}
    if not {"x", "y"} <= set(names):
        shown = described(f"columns {', '.join(names) or 'none'} in {path.name}")
        raise invalid(
            "path", shown, "columns x and y, and perhaps t", "Name them in its first row."
        )
    wanted = [names[key] for key in ("x", "y", "t") if key in names]
    try:
        table = np.array([[float(row[name]) for name in wanted] for row in rows])
    except (TypeError, ValueError) as error:
        shown = described(f"{path.name} ({error})")
        raise invalid("path", shown, "numbers in every row", "Correct the file.") from None
    places = scale_of(unit) * table[:, :2]
    return (places, table[:, 2]) if "t" in names else (checked_places(places), None)


def at_even_times(places: Floats, time: Floats) -> tuple[Floats, float]:
    """Return a smooth path through places at their times, at even times, and the interval [s]."""
    steps = np.diff(time)
    if len(time) < 4 or not np.isfinite(places).all() or not np.all(steps > 0):
        shown = described("times that do not rise, numbers missing, or fewer than 4 places")
        raise invalid("path", shown, "rising times with a place each", "Correct the file.")
    with np.errstate(over="ignore"):
        shortest = (time[-1] - time[0]) / steps.min()
    if not shortest * _FINER < _MOST:
        shown = described(f"times between {steps.min():g} and {steps.max():g} s apart")
        raise invalid("path", shown, "times of about equal distance", "Resample the path.")
    even = np.linspace(time[0], time[-1], int(np.ceil(shortest)) * _FINER + 1)
    return CubicSpline(time, places)(even), float(even[1] - even[0])
