"""Loop transfer functions in the complex plane and in Nichols's, with disks they stay out of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.arrays import AnyVector
from robustpolish.plotting.style import LINE_STYLES, legend, new_axes, si_axis

# What of a Nyquist curve is drawn: beyond it lie integrators, and nothing that matters.
_FAR = 4.0
_LOWEST_DB, _HIGHEST_DB = -40.0, 40.0


def plot_nyquist_disks(
    loops: Mapping[str, xr.DataArray],
    disks: Mapping[str, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw loop transfer functions around the point -1.

    Parameters
    ----------
    loops : mapping of str to xarray.DataArray
        Complex, over ``frequency``, by the name in the legend: L with S = 1/(1 + L).
    disks : mapping of str to float, optional
        Disk margin alpha of a loop by its name; the largest disk around -1 that it stays out of
        is drawn in its colour.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
        For positive frequencies; the curve of the negative ones is the mirror image.
    """
    ax = new_axes(ax)
    for i, (label, loop) in enumerate(loops.items(), 1):
        style: dict[str, Any] = LINE_STYLES[i % len(LINE_STYLES)]
        values: Any = np.where(np.isfinite(loop.values), loop.values, np.nan)
        ax.plot(values.real, values.imag, label=label, **style)
        alpha = (disks or {}).get(label)
        if alpha is not None and 0 < alpha < 2:
            edge: Any = _disk(alpha)
            ax.fill(edge.real, edge.imag, color=style["color"], alpha=0.15, linewidth=0)
    ax.plot([-1], [0], marker="+", color="black", markersize=10, linestyle="", label="-1")
    _limits(ax, loops)
    ax.axhline(0.0, color="black", linewidth=0.5)
    ax.axvline(0.0, color="black", linewidth=0.5)
    ax.set_aspect("equal")
    si_axis(ax.xaxis, "real part of L", "")
    si_axis(ax.yaxis, "imaginary part of L", "")
    legend(ax)
    return ax


def plot_nichols(
    loops: Mapping[str, xr.DataArray],
    disks: Mapping[str, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the gain of loop transfer functions over their phase.

    Parameters
    ----------
    loops, disks, ax
        As for :func:`plot_nyquist_disks`.

    Returns
    -------
    matplotlib.axes.Axes
        The critical points are those at 0 dB and odd multiples of 180 degrees.
    """
    ax = new_axes(ax)
    shown: list[float] = [-180.0]
    for i, (label, loop) in enumerate(loops.items(), 1):
        style: dict[str, Any] = LINE_STYLES[i % len(LINE_STYLES)]
        values = loop.values[np.isfinite(loop.values) & (np.abs(loop.values) > 0)]
        phase = np.degrees(np.unwrap(np.angle(values)))
        phase -= 360 * np.round((phase[0] + 90) / 360) if phase.size else 0
        decibels = 20 * np.log10(np.abs(values))
        ax.plot(phase, decibels, label=label, **style)
        near = (decibels > _LOWEST_DB) & (decibels < _HIGHEST_DB)
        shown += [float(phase[near].min()), float(phase[near].max())] if near.any() else []
        alpha = (disks or {}).get(label)
        if alpha is not None and 0 < alpha < 2:
            edge = _disk(alpha)
            turned = np.degrees(np.mod(np.angle(edge), 2 * np.pi)) - 360
            ax.fill(
                turned, 20 * np.log10(np.abs(edge)), color=style["color"], alpha=0.15, linewidth=0
            )
    low = 180 * np.floor((min(shown) - 1) / 180)
    high = 180 * np.ceil((max(shown) + 1) / 180)
    critical = [angle for angle in np.arange(low, high + 1, 180) if (angle / 180) % 2 == 1]
    ax.plot(
        critical, [0] * len(critical), marker="+", color="black", markersize=10, linestyle="",
        label="-1",
    )  # fmt: skip
    ax.set_xlim(low, high)
    ax.set_ylim(_LOWEST_DB, _HIGHEST_DB)
    ax.set_xticks(np.arange(low, high + 1, 90 if high - low <= 720 else 180))
    ax.set_xlabel("phase of L [deg]")
    ax.set_ylabel("gain of L [dB]")
    legend(ax)
    return ax


def _disk(alpha: float) -> AnyVector:
    """Return the edge of the disk of L that a balanced disk margin alpha excludes."""
    # 1 + f L = 0 for a factor f = (1 + d alpha/2) / (1 - d alpha/2) with |d| = 1
    turn = np.exp(1j * np.linspace(0, 2 * np.pi, 361)) * alpha / 2
    return -(1 - turn) / (1 + turn)


def _limits(ax: Axes, loops: Mapping[str, xr.DataArray]) -> None:
    """Show what lies around -1, whatever integrators do."""
    values: Any = np.concatenate([loop.values.ravel() for loop in loops.values()])
    near: Any = values[np.isfinite(values) & (np.abs(values) < _FAR)]
    across, up = [-1.5, 0.5, *near.real], [-1.0, 1.0, *near.imag]
    middles = (min(across) + max(across)) / 2, (min(up) + max(up)) / 2
    half = 0.55 * max(max(across) - min(across), max(up) - min(up))
    ax.set_xlim(middles[0] - half, middles[0] + half)
    ax.set_ylim(middles[1] - half, middles[1] + half)
