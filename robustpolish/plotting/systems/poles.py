"""Poles in the complex plane, and the region that they were to lie in."""

from __future__ import annotations

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

from robustpolish.plotting.style import MARKER_STYLES, new_axes, si_axis

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
    for i, (label, values) in enumerate(drawn.items()):
        style = MARKER_STYLES[i % len(MARKER_STYLES)]
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
