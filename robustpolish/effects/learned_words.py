"""What a learned curve resembles, in words with numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from robustpolish.arrays import Array
from robustpolish.effects.formula import Formula


@dataclass(frozen=True)
class WordPolicy:
    """When a word is used of a curve.

    Attributes
    ----------
    mostly : float
        Share of its square that has to be odd, or even, for the curve to be called so.
    side : float
        Share of the force on one side of zero below which the other is the only one.
    harder, softer : float
        Slope at the ends over the slope about rest from which a spring hardens, and below which
        it softens.
    flat : float
        The same below which it saturates.
    dead : float
        Share of the largest force below which there is none, and `zone` the share of the range
        over which it has to be so small.
    grows : float
        Greatest ratio of the slope at the very ends to that just outside of a dead zone: a cube
        is small about rest too, but its slope goes on growing.
    feeds : float
        Share of the largest power from which a force that pushes counts.
    dry : float
        Range of the force beyond a quarter of the largest speed, as a share of its mean, below
        which it is called dry.
    sure : float
        Standard errors beyond which a force has a sign.
    back : float
        Share of the way up that what varies with time may come down and still be called rising.
    """

    mostly: float = 0.9
    side: float = 0.1
    harder: float = 1.5
    softer: float = 0.67
    flat: float = 0.2
    dead: float = 0.05
    zone: float = 0.2
    grows: float = 1.25
    feeds: float = 0.01
    dry: float = 0.3
    sure: float = 2.0
    back: float = 0.1


WORDS = WordPolicy()
"""What :meth:`LearnedLaw.describe` goes by."""


def in_words(curve: xr.Dataset, place: str, formula: Formula | None) -> str:
    """Return sentences on a learned curve or surface.

    Parameters
    ----------
    curve : xarray.Dataset
        ``force`` and ``stderr`` over ``displacement``, ``velocity`` or both, or ``stiffness`` or
        ``damping`` over ``time``.
    place : str
    formula : Formula or None

    Returns
    -------
    str
        The first line says what it is a curve of, how far it was seen and how large it is.
    """
    quantity = next(str(name) for name in curve.data_vars if name != "stderr")
    found = curve[quantity]
    dims = [str(name) for name in found.dims]
    ranges = " and ".join(
        f"{float(curve[d][0]):.3g} to {float(curve[d][-1]):.3g} {curve[d].attrs['units']}"
        for d in dims
    )
    largest = float(np.max(np.abs(found.values)))
    unit = found.attrs["units"]
    lines = [
        f"{quantity.capitalize()} over {' and '.join(dims)} at {place}, seen from {ranges}: "
        f"up to {largest:.3g} {unit}."
    ]
    stderr = curve["stderr"].values
    if np.isfinite(stderr).all() and largest > 0:
        share = 100 * float(np.median(stderr)) / largest
        lines.append(f"Its standard error is {share:.2g} % of that in the middle of all points.")
    if largest > 0:
        if dims == ["displacement"]:
            lines += _spring(curve)
        elif dims == ["velocity"]:
            lines += _damper(curve)
        elif dims == ["time"]:
            lines.append(_along_time(found))
        else:
            lines += _energy(curve)
    if formula is None:
        lines.append("No simple formula lies within its band.")
    else:
        lines.append(f"The simplest formula within its band: {formula}.")
    return "\n".join(lines)


def _spring(curve: xr.Dataset) -> list[str]:
    x, g = curve["displacement"].values, curve["force"].values
    unit, length = curve["force"].attrs["units"], curve["displacement"].attrs["units"]
    lines = _symmetry(x, g, "the displacement")
    side = _one_sided(x, g)
    if side:
        return [*lines, f"It acts on one side only, at {side} displacements."]
    if any("even" in line and "neither" not in line for line in lines):
        return lines
    slope = np.gradient(g, x)
    zone = _dead_zone(x, g, slope)
    if zone is not None:
        low, high = zone
        return [*lines, f"It has a dead zone from {low:.3g} to {high:.3g} {length}."]
    middle, ends = _slopes(x, slope)
    told = f"slope {middle:.3g} {unit}/{length} about the middle and {ends:.3g} at the ends"
    return [*lines, f"It {_bend(middle, ends, *_OF_SPRINGS)}: {told}."]


def _damper(curve: xr.Dataset) -> list[str]:
    v, g = curve["velocity"].values, curve["force"].values
    unit, length = curve["force"].attrs["units"], curve["velocity"].attrs["units"]
    lines = _symmetry(v, g, "the velocity")
    side = _one_sided(v, g)
    if side:
        lines.append(f"It acts in one direction only, at {side} velocities.")
    lines += _energy(curve)
    outer = np.abs(v) > 0.25 * np.max(np.abs(v))
    sizes = np.abs(g[outer])
    turns = np.sign(g[v < 0][:1]) != np.sign(g[v > 0][-1:])
    if not side and turns.all() and np.ptp(sizes) < WORDS.dry * np.mean(sizes):
        mean = float(np.mean(sizes))
        lines.append(f"It hardly depends on the speed, as dry friction of {mean:.3g} {unit}.")
        return lines
    slope = np.gradient(g, v)
    middle, ends = _slopes(v, slope)
    told = f"slope {middle:.3g} {unit}/({length}) about rest and {ends:.3g} at the ends"
    return [*lines, f"It {_bend(middle, ends, *_OF_DAMPERS)}: {told}."]


def _along_time(found: xr.DataArray) -> str:
    """Say how far a stiffness or damping goes along the record, and whether it turns back."""
    values, unit = found.values, found.attrs["units"]
    steps = np.diff(values)
    up, down = float(steps[steps > 0].sum()), float(-steps[steps < 0].sum())
    way = "rises" if up > down else "falls"
    if min(up, down) > WORDS.back * max(up, down):
        way = "goes up and down"
    return (
        f"It comes on top of what the model was given, and {way} along the record: from "
        f"{values[0]:.3g} to {values[-1]:.3g}, between {values.min():.3g} and {values.max():.3g} "
        f"{unit}."
    )


_OF_SPRINGS = "hardens", "softens", "is nearly straight"
_OF_DAMPERS = (
    "grows faster than the velocity", "grows more slowly than the velocity", "is nearly viscous",
)  # fmt: skip


def _bend(middle: float, ends: float, more: str, less: str, straight: str) -> str:
    """Say what becomes of a slope from the middle to the ends."""
    if abs(ends) <= WORDS.flat * abs(middle):
        return "saturates"
    if ends > WORDS.harder * middle and ends > 0:
        return more
    return less if ends < WORDS.softer * middle else straight


def _symmetry(x: Array, g: Array, what: str) -> list[str]:
    """Say whether a curve changes its sign with x, as far as both signs of x were seen."""
    reach = min(-x[0], x[-1])
    if reach < 0.3 * max(abs(x[0]), abs(x[-1])):
        return []
    grid = np.linspace(0.0, reach, 61)
    ahead, behind = np.interp(grid, x, g), np.interp(-grid, x, g)
    odd, even = np.mean((ahead - behind) ** 2), np.mean((ahead + behind) ** 2)
    share = float(odd / max(odd + even, 1e-300))
    if share >= WORDS.mostly:
        return [f"It is odd, {100 * share:.0f} % of its square: it changes its sign with {what}."]
    if share <= 1 - WORDS.mostly:
        return [f"It is even, {100 * (1 - share):.0f} % of its square: it keeps its sign."]
    return [f"It is neither odd nor even: {100 * share:.0f} % of its square is odd."]


def _one_sided(x: Array, g: Array) -> str:
    """Return "positive" or "negative" if a curve is as good as zero on the other side."""
    if x[0] >= 0 or x[-1] <= 0:
        return ""
    negative, positive = (float(np.sqrt(np.mean(g[s] ** 2))) for s in (x < 0, x > 0))
    if negative < WORDS.side * positive:
        return "positive"
    return "negative" if positive < WORDS.side * negative else ""


def _dead_zone(x: Array, g: Array, slope: Array) -> tuple[float, float] | None:
    """Return the ends of a stretch without force beyond which the slope is nearly constant."""
    small = np.abs(g) < WORDS.dead * np.max(np.abs(g))
    middle = int(np.argmin(np.abs(x)))
    if not small[middle]:
        return None
    first, last = middle, middle
    while first > 0 and small[first - 1]:
        first -= 1
    while last + 1 < x.size and small[last + 1]:
        last += 1
    if x[last] - x[first] < WORDS.zone * (x[-1] - x[0]) or first == 0 or last == x.size - 1:
        return None
    ends = []
    for at, outside in ((first, slice(first - 1, None, -1)), (last, slice(last + 1, None))):
        steep = slope[outside]
        third = max(steep.size // 3, 1)
        near, far = float(np.mean(steep[third : 2 * third])), float(np.mean(steep[2 * third :]))
        if steep.size < 6 or far > WORDS.grows * near or not near:
            return None
        begin = outside.start + (third if at == last else -third)
        ends.append(float(x[begin] - g[begin] / near))  # where the straight part would begin
    return ends[0], ends[1]


def _slopes(x: Array, slope: Array) -> tuple[float, float]:
    """Return the slope about the middle of a range, and the mean slope at its ends."""
    share = (x - x[0]) / (x[-1] - x[0])
    middle = slope[(share > 0.4) & (share < 0.6)]
    ends = np.concatenate([slope[share < 0.12], slope[share > 0.88]])
    return float(np.mean(middle)), float(np.mean(ends))


def _energy(curve: xr.Dataset) -> list[str]:
    """Say whether a force takes energy out or feeds it, and where, as far as that is sure."""
    v = curve["velocity"].values
    force, stderr = curve["force"].values, np.nan_to_num(curve["stderr"].values, nan=0.0)
    if force.ndim == 2:  # what depends on the displacement alone stores energy
        still = np.array([np.interp(0.0, v, row) for row in force])
        force = force - still[:, None]
    power = force * v
    feeds = (power < 0) & (np.abs(force) > WORDS.sure * stderr)
    little = WORDS.feeds * np.max(np.abs(power))
    feeds &= np.abs(power) > little
    if not feeds.any():
        return ["It takes energy out at every speed that was seen."]
    speeds = v[feeds.any(axis=0) if force.ndim == 2 else feeds]
    unit = curve["velocity"].attrs["units"]
    if np.all(feeds | (np.abs(power) <= little)):
        return ["It feeds energy at every speed that was seen."]
    return [f"It feeds energy at speeds from {speeds.min():.3g} to {speeds.max():.3g} {unit}."]
