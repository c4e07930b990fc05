"""Poles in the complex plane, and the region that they were to lie in."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import Formatter
from numpy.typing import ArrayLike, NDArray

from robustpolish.plots.style import MARKER_STYLES, in_styles, legend, new_axes, si_axis

# Whirl frequencies of a rotor over its speed.

_WAYS: dict[str, dict[str, Any]] = {
    "forward": {"color": "#0072b2", "linestyle": "-"},
    "backward": {"color": "#d55e00", "linestyle": "--"},
    "neither": {"color": "#009e73", "linestyle": "-."},
}
_CLEAR = 0.05
"""Below this roundness a whirl is drawn as going neither way."""


def plot_campbell(
    speeds: ArrayLike,
    frequencies: ArrayLike,
    whirl: ArrayLike,
    critical: ArrayLike = (),
    ax: Axes | None = None,
) -> Axes:
    """Draw a Campbell diagram: frequencies over speed by the way round, and the line of the spin.

    Parameters
    ----------
    speeds : array_like, shape (speeds,)
        In rad/s.
    frequencies : array_like, shape (speeds, modes)
        In Hz.
    whirl : array_like, shape (speeds, modes)
        From -1, backward, to 1, forward.
    critical : array_like, optional
        Critical speeds in rad/s, marked where the line of the spin meets the curves.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
        Speed in rev/min across, frequency upwards.
    """
    ax = new_axes(ax)
    turns: np.ndarray = np.asarray(speeds, dtype=float) * 30 / math.pi
    heights, ways = np.asarray(frequencies, dtype=float), np.asarray(whirl, dtype=float)
    used: set[str] = set()
    for height, way in zip(heights.T, ways.T, strict=True):
        # At rest nothing goes round: the rest of the curve says which one it is.
        mean = float(way[np.abs(way).argmax()])
        name = "neither" if abs(mean) < _CLEAR else "forward" if mean > 0 else "backward"
        used.add(name)
        ax.plot(turns, height, **_WAYS[name])
    spin: dict[str, Any] = {"color": "#999999", "linewidth": 0.8}
    ring: dict[str, Any] = {"marker": "o", "color": "black", "fillstyle": "none", "linestyle": ""}
    handles = [Line2D([], [], label=name, **way) for name, way in _WAYS.items() if name in used]
    handles.append(Line2D([], [], label="once per turn", **spin))
    ax.plot(turns, turns / 60, **spin)
    where = np.asarray(critical, dtype=float) * 30 / math.pi
    if where.size:
        ax.plot(where, where / 60, **ring)
        handles.append(Line2D([], [], label="critical speed", **ring))
    ax.set_xlim(float(turns.min()), float(turns.max()))
    ax.set_ylim(0.0, float(np.nanmax(heights, initial=0.0)) * 1.05 or 1.0)
    ax.set_xlabel("speed [rev/min]")
    si_axis(ax.yaxis, "whirl frequency", "Hz")
    ax.legend(handles=handles, loc="best")
    return ax


_GRID = 301
_HATCHES = ("//", "\\\\", "..", "xx")
# Beyond this ratio of the largest to the smallest part the axis becomes logarithmic.
_LUMPED = 100

# Rounding splits a double pole by half the digits: a part of this share is none.
_SPLIT = 1e-6

# Labels that a logarithmic axis through zero has room for, in the large type of a report too.
_TICKS = 9


def plot_poles(
    poles: Mapping[str, ArrayLike],
    regions: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    ax: Axes | None = None,
    *,
    discrete: bool = False,
) -> Axes:
    """Draw poles, the boundary of stability, and the regions that they were to lie in.

    Parameters
    ----------
    poles : mapping of str to array_like of complex
        By the name in the legend: in rad/s, or in discrete time without unit.
    regions : mapping of str to (L, M), optional
        Regions {s : L + s M + conj(s) M' < 0} by name; what lies outside is hatched.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    discrete : bool, optional
        Whether the unit circle bounds the stable poles.

    Returns
    -------
    matplotlib.axes.Axes
        In continuous time the real part is drawn in 1/s (a rate of growth), the imaginary part
        over 2 pi in Hz.
    """
    ax = new_axes(ax)
    scale = 1.0 if discrete else 2 * np.pi
    drawn: dict[str, Any] = {
        label: np.ravel(np.asarray(values, dtype=complex)) for label, values in poles.items()
    }
    for style, label, values in in_styles(drawn, 0, MARKER_STYLES):
        height = values.imag / scale
        ax.plot(values.real, height, linestyle="", fillstyle="none", label=label, **style)
    if discrete:
        circle: Any = np.exp(1j * np.linspace(0, 2 * np.pi, 400))
        ax.plot(circle.real, circle.imag, color="black", linewidth=0.8)
        ax.set_aspect("equal")
    else:
        ax.axvline(0.0, color="black", linewidth=0.8)
    ax.axhline(0.0, color="#999999", linewidth=0.5)
    if not discrete:
        everything: Any = np.concatenate([np.zeros(0, complex), *drawn.values()])
        _spread(ax, "x", everything.real)
        swings = np.abs(everything.imag) > _SPLIT * np.abs(everything)
        _spread(ax, "y", everything.imag[swings] / scale)
    ax.margins(0.08)
    handles = list(ax.get_legend_handles_labels()[0])
    for (name, (L, M)), hatch in zip((regions or {}).items(), cycle(_HATCHES), strict=False):
        _hatch_outside(ax, np.asarray(L, dtype=float), np.asarray(M, dtype=float), scale, hatch)
        handles.append(Patch(facecolor="none", edgecolor="#333333", hatch=hatch, label=name))
    si_axis(ax.xaxis, "real part", "" if discrete else "1/s")
    si_axis(ax.yaxis, "imaginary part" if discrete else "frequency", "" if discrete else "Hz")
    if handles:
        handles.append(Line2D([], [], color="black", linewidth=0.8, label="boundary of stability"))
        ax.legend(handles=handles, loc="best")
    return ax


def _spread(ax: Axes, which: str, values: NDArray) -> None:
    """Make an axis logarithmic on both sides of zero where linear ticks would lump the poles."""
    size = np.abs(values)
    # Rounding leaves poles that are real by nature a little beside the axis.
    size = size[size > 1e-9 * size.max(initial=0.0)]
    if size.size and size.max() > _LUMPED * size.min():
        # Next to zero a decade takes as much room as elsewhere; a whole one, for ticks at its ends.
        threshold = 10.0 ** np.floor(np.log10(max(size.min(), 1e-6 * size.max())))
        (ax.set_xscale if which == "x" else ax.set_yscale)("symlog", linthresh=threshold)
        axis: Any = ax.xaxis if which == "x" else ax.yaxis
        axis.get_major_locator().set_params(numticks=_TICKS)
        axis.set_major_formatter(_decade)


def _decade(value: float, _: int | None = None) -> str:
    """Write zero or a power of ten short: -0.1, -1, 1000, and from 10^4 on with an exponent."""
    if value == 0 or 1e-3 <= abs(value) < 1e4:
        return Formatter.fix_minus(f"{value:g}")
    sign = "-" if value < 0 else ""
    return f"${sign}10^{{{round(np.log10(abs(value)))}}}$"


def _hatch_outside(ax: Axes, L: NDArray, M: NDArray, scale: float, hatch: str) -> None:
    """Hatch what lies outside a region, up to the axes' limits, also when these change."""
    drawn: list[Any] = []

    def draw(_: Any = None) -> None:
        while drawn:
            drawn.pop().remove()
        (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
        x, y = _grid(ax.xaxis, left, right), _grid(ax.yaxis, low, high)
        s = x[None, :] + 1j * scale * y[:, None]
        matrices = L + s[..., None, None] * M + np.conj(s)[..., None, None] * M.T
        excess = np.linalg.eigvalsh(matrices)[..., -1]
        kept = ax.get_autoscalex_on(), ax.get_autoscaley_on()
        ax.autoscale(False)  # what is drawn here follows the limits and must not move them
        if (excess >= 0).any():
            top = max(float(excess.max()), 1e-300)
            levels = [0.0, 1.01 * top]
            outside: Any = ax.contourf(x, y, excess, levels=levels, colors="none", hatches=[hatch])
            outside.set_edgecolor("#bbbbbb")
            outside.set_linewidth(0.0)
            drawn.append(outside)
        if (excess >= 0).any() and (excess < 0).any():
            drawn.append(ax.contour(x, y, excess, levels=[0.0], colors="#666666", linewidths=0.8))
        ax.set_autoscalex_on(kept[0])
        ax.set_autoscaley_on(kept[1])

    ax.set_xlim(*ax.get_xlim())
    ax.set_ylim(*ax.get_ylim())
    draw()
    ax.callbacks.connect("xlim_changed", draw)
    ax.callbacks.connect("ylim_changed", draw)


def _grid(axis: Axis, low: float, high: float) -> NDArray:
    """Return points that are evenly spread as the axis shows them."""
    transform: Any = axis.get_transform()
    ends: Any = transform.transform(np.array([low, high]))
    return np.asarray(transform.inverted().transform(np.linspace(ends[0], ends[1], _GRID)))


# Shapes of a rotor's whirl modes along its shaft.


def plot_whirl_shapes(
    nodes: ArrayLike, shapes: Mapping[str, ArrayLike], ax: Axes | None = None
) -> Axes:
    """Draw how far each mode deflects along the shaft, at the moment at which it is largest.

    Parameters
    ----------
    nodes : array_like, shape (nodes,)
        In m.
    shapes : mapping of str to array_like of complex, shape (2, nodes)
        Amplitudes in x and y by the name in the legend. The axis with the larger ones is drawn.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    for style, label, shape in in_styles(shapes):
        both = np.asarray(shape)
        larger = both[np.abs(both).max(axis=1).argmax()]
        largest = larger[np.abs(larger).argmax()]
        # Turned so that the largest deflection is real, and drawn upwards where the shaft ends.
        drawn = (larger / largest).real
        ax.plot(np.asarray(nodes), drawn * (1 if drawn[-1] >= 0 else -1), label=label, **style)
    ax.axhline(0.0, color="#999999", linewidth=0.5)
    si_axis(ax.xaxis, "along the shaft", "m")
    ax.set_ylabel("deflection over the largest")
    legend(ax, least=1)
    return ax
