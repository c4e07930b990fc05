"""Lines and spirals as corners."""

from __future__ import annotations

import numpy as np

from robustpolish.brush.surfaces.polished_surface import Floats
from robustpolish.validation import described, invalid


def raster(x: tuple[float, float], y: tuple[float, float], step: float) -> Floats:
    """Return the corners of lines along x, to and fro, shape (n, 2) [m]."""
    for name, ends in (("x", x), ("y", y)):
        if len(ends) != 2 or not np.all(np.isfinite(ends)) or not ends[1] > ends[0]:
            raise invalid(name, ends, "where it begins and where it ends [m]", "Give two numbers.")
    count = int(np.ceil((y[1] - y[0]) / step * (1 - 1e-9))) + 1
    lines = np.linspace(y[0], y[1], count)
    ends = np.where(np.arange(count)[:, None] % 2 == 0, [x], [x[::-1]])
    return np.stack([ends.ravel(), np.repeat(lines, 2)], axis=1)


def spiral(centre: tuple[float, float], radius: float, pitch: float) -> Floats:
    """Return places of an Archimedean spiral, from the outside in, shape (n, 2) [m]."""
    middle = np.asarray(centre, dtype=float)
    if middle.shape != (2,) or not np.all(np.isfinite(middle)):
        raise invalid("centre", centre, "x and y [m]", "Give two numbers.")
    end = pitch / 3
    if radius <= 2 * end:
        shown = described(f"{pitch:g} m at a radius of {radius:g} m")
        raise invalid("pitch", shown, "less than 1.5 times the radius", "Lower it.")
    angle = np.linspace(
        0.0, 2 * np.pi * (radius - end) / pitch, max(200, int(720 * radius / pitch))
    )
    far = radius - pitch * angle / (2 * np.pi)
    return middle + np.stack([far * np.cos(angle), far * np.sin(angle)], axis=1)
