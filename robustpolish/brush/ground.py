"""Whether the physical simulator may be believed on a surface, along the path of the tool."""

from __future__ import annotations

import numpy as np

from robustpolish.brush.parameters import BrushParameters
from robustpolish.brush.surfaces.mould import Mould
from robustpolish.brush.surfaces.polished_surface import Floats, PolishedSurface
from robustpolish.brush.tool_path import tool_position
from robustpolish.validation import described, invalid

_PER_RADIUS = 8  # places along the path per radius of the brush
_BULGE = 1e-6  # m, and
_SHARE_OF_DEPTH = 0.02  # what the middle of the disc may stand in the mould, by its penetration


def check_ground(parameters: BrushParameters, duration: float) -> None:
    """Refuse a path that ends too soon or leads the rim off the mould, and moulds that bulge.

    The simulator knows contact along the rim. It is there as long as the surface is hollow, or
    straight, in some direction at least: the depth of the disc's face in it is then largest at
    the end of a chord. Only where it bulges in all directions the face would touch first.
    """
    path, mould = parameters.path, parameters.surface
    if path is not None and path.duration < duration * (1 - 1e-9):
        shown = described(f"a path of {path.duration:.4g} s")
        remedy = "Shorten the duration, or go slower."
        raise invalid("path", shown, f"at least the duration, {duration:g} s", remedy)
    if not isinstance(mould, Mould):
        return
    places = visited(parameters, duration)
    reach = parameters.rim_distance
    spare = mould.distance_to_edge(*places) - reach
    if spare.min() < 0:
        where = _told(places[:, int(np.argmin(spare))])
        away = f"{-1e3 * spare.min():.3g} mm"
        shown = described(f"a path whose rim leaves the mould by {away} around {where}")
        wanted = f"the mould to reach {1e3 * reach:.3g} mm around the path"
        raise invalid("path", shown, wanted, "Move or shrink the path, or give a larger mould.")
    _check_bulges(mould, places, parameters)


def visited(parameters: BrushParameters, duration: float) -> Floats:
    """Places of the tool's centre, an eighth of a radius apart at most, shape (2, n) [m]."""
    rough = tool_position(np.linspace(0.0, duration, 2001), parameters)
    length = float(np.sum(np.hypot(*np.diff(rough, axis=1))))
    count = max(32, int(np.ceil(1.5 * length * _PER_RADIUS / parameters.radius)))
    return tool_position(np.linspace(0.0, duration, count), parameters)


def under_disc(surface: PolishedSurface, places: Floats, radius: float) -> tuple[Floats, Floats]:
    """Largest second derivative in any direction at places on and within the rim [1/m].

    Returns
    -------
    least, most : ndarray, shape (n,)
        Under the disc at each place of the path.
    """
    angle = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)])
    spots = np.concatenate([np.zeros((2, 1)), 0.5 * radius * ring, radius * ring], axis=1)
    x, y = (places[k][:, None] + spots[k] for k in (0, 1))
    r, s, t = surface.bends(x, y)
    largest = 0.5 * (r + t) + np.hypot(0.5 * (r - t), s)
    return largest.min(axis=1), largest.max(axis=1)


def _told(place: Floats) -> str:
    x, y = (round(1e3 * float(part), 2) + 0.0 for part in place)
    return f"x = {x:g} mm, y = {y:g} mm"


def _check_bulges(mould: Mould, places: Floats, parameters: BrushParameters) -> None:
    least, _ = under_disc(mould, places, parameters.radius)
    bulge = -0.5 * float(least.min()) * parameters.radius**2
    depth = parameters.polishing_force / parameters.contact_stiffness
    if bulge > max(_BULGE, _SHARE_OF_DEPTH * depth):
        where = _told(places[:, int(np.argmin(least))])
        much = f"{1e6 * bulge:.3g} µm"
        raise invalid(
            "surface",
            described(f"{mould.name}, which bulges by {much} under the disc around {where}"),
            "a surface that is hollow in some direction, where the disc touches with its rim",
            "Lead the path round the bulge; the simulator knows no contact of the disc's face.",
        )
