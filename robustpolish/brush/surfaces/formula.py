"""Heights from a formula: read, never executed, and sampled until a spline keeps to it."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from robustpolish.brush.surfaces.polished_surface import Floats
from robustpolish.brush.surfaces.uniform_spline import coefficients
from robustpolish.effects.own.formula import FUNCTIONS, Formula
from robustpolish.effects.own.reading import read_formula
from robustpolish.validation import described, invalid, positive, spelled

_CLOSE = 1e-9  # m: about the roughness that polishing reaches
_CELLS = (32, 1024)  # along the longer side, first and last
_EDGED = frozenset({"abs", "sign", "min", "max"})
_SMOOTH = tuple(name for name in FUNCTIONS if name not in _EDGED)


def sampled(
    text: str,
    x: tuple[float, float],
    y: tuple[float, float],
    parameters: Mapping[str, float],
) -> tuple[Floats, Floats, Floats, float]:
    """Return places along x and y, heights, and how far a spline through them is off [m]."""
    formula = _read(text, parameters)
    sides = _interval("x", x), _interval("y", y)
    longest = max(high - low for low, high in sides)
    count = _CELLS[0]
    while True:
        # An even number: the middle, where many formulas are sharpest, is a place of the grid.
        cells = [max(8, 2 * round(0.5 * count * (high - low) / longest)) for low, high in sides]
        # Twice as fine as the spline: what lies between its places judges it.
        along, across = (
            np.linspace(low, high, 2 * n + 1) for (low, high), n in zip(sides, cells, strict=True)
        )
        heights = _heights(formula, along, across, parameters)
        error = _between(heights)
        if error <= _CLOSE:
            return along[::2], across[::2], heights[::2, ::2], error
        if count >= _CELLS[1]:
            raise invalid(
                "text", described(f"{text!r}, {error:.2g} m off on a grid of {count} cells"),
                f"a smooth height, so that a spline keeps to it within {_CLOSE:g} m",
                "Smooth its edges and waves, or take a smaller area.",
            )  # fmt: skip
        count *= 2


def _read(text: str, parameters: Mapping[str, float]) -> Formula:
    """Read the formula of a height by the reader of laws, which wants every name to be used."""
    if not isinstance(text, str):
        raise invalid("text", text, "a formula such as '0.5*x**2'", "Write it as text.")
    for name, value in parameters.items():
        if not np.isfinite(value):
            raise invalid(("parameters", name), value, "a finite number", "Correct it.")
    expression = text.split("=", 1)[1] if re.match(r"\s*[zf]\s*=", text) else text
    written = dict.fromkeys(re.findall(r"(?<![\w.])[A-Za-z_]\w*", expression))
    known = {"x", "y", "pi", *_SMOOTH, *parameters}
    for name in written:
        if name not in known:
            edge = " It has an edge, on which no curvature exists." if name in _EDGED else ""
            what = f"x, y, pi, one of {', '.join(_SMOOTH)}, or a name in parameters"
            remedy = spelled(name, known) + edge
            raise invalid("text", described(f"the name {name!r}"), what, remedy)
    for name in parameters:
        if name in ("q", "v", "t"):
            raise invalid("parameters", name, "a name other than q, v and t", "Rename it.")
    return read_formula(f"f = {expression}", [n for n in ("x", "y", *parameters) if n in written])


def _interval(name: str, ends: tuple[float, float]) -> tuple[float, float]:
    if len(ends) != 2 or not np.all(np.isfinite(ends)):
        raise invalid(name, ends, "where it begins and where it ends [m]", "Give two numbers.")
    positive(f"{name}[1] - {name}[0]", ends[1] - ends[0], "m")
    return float(ends[0]), float(ends[1])


def _heights(formula: Formula, x: Floats, y: Floats, parameters: Mapping[str, float]) -> Floats:
    values = {"x": x[:, None], "y": y[None, :], **parameters}
    heights = np.broadcast_to(formula.value(values), (x.size, y.size)).astype(float)
    wrong = np.argwhere(~np.isfinite(heights))
    if wrong.size:
        i, j = wrong[0]
        shown = described(f"{formula.text!r} without a value at x = {x[i]:g} m, y = {y[j]:g} m")
        raise invalid("text", shown, "a finite height everywhere", "Take another area.")
    return heights


def _between(heights: Floats) -> float:
    """Largest error of the spline through every second height at those between."""
    worst = 0.0
    for values in (heights[:, ::2], heights[::2].T):
        found = coefficients(values[::2])
        middle = (found[:-3] + 23 * found[1:-2] + 23 * found[2:-1] + found[3:]) / 48
        worst = max(worst, float(np.max(np.abs(middle - values[1::2]))))
    return worst
