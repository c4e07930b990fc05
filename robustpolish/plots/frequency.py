"""Loop transfer functions in the complex plane and in Nichols's, with disks they stay out of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.base.arrays import AnyVector
from robustpolish.plots.style import LINE_STYLES, in_styles, legend, log_axis, new_axes, si_axis

# Complex responses over frequency: magnitude and phase, and in the complex plane.


def plot_bode(
    responses: Mapping[str, xr.DataArray],
    ax: Axes | None = None,
    *,
    name: str = "magnitude",
    unit: str = "",
    spread: xr.DataArray | None = None,
    phase: Axes | None = None,
) -> Axes:
    """Draw the magnitude of complex responses over frequency, and their phase below it.

    Parameters
    ----------
    responses : mapping of str to xarray.DataArray
        Complex, over ``frequency`` in Hz, by the name in the legend; the first is drawn broad,
        so that it shows beneath others.
    ax : matplotlib.axes.Axes, optional
        Where to draw the magnitude; by default a new figure, which has the phase below it.
    name, unit : str, optional
        Of the response.
    spread : xarray.DataArray, optional
        Standard deviation of the first response's noise, in the same unit.
    phase : matplotlib.axes.Axes, optional
        Where to draw the phase if `ax` is given.

    Returns
    -------
    matplotlib.axes.Axes
        Of the magnitude; the phase's follow in its figure.
    """
    upper, below = ax, phase
    if upper is None:
        figure = plt.figure(layout="constrained")
        upper, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for i, (style, label, response) in enumerate(in_styles(responses)):
        style["linewidth"] = 1.2 if i else 2.5
        frequency, values = response["frequency"].values, response.values
        upper.plot(frequency, _positive(np.abs(values)), label=label, **style)
        if below is not None:
            angle = np.degrees(np.angle(values))
            # with gaps instead of lines where it jumps by a turn
            angle[np.flatnonzero(np.abs(np.diff(angle)) > 180)] = np.nan
            below.plot(frequency, angle, **style)
    if spread is not None:
        style = {**LINE_STYLES[0], "linewidth": 0.8, "label": "noise"}
        upper.plot(spread["frequency"].values, _positive(spread.values), **style)
    log_axis(upper, "y", name, unit)
    log_axis(upper, "x", "frequency", "Hz")
    legend(upper, least=1)
    if below is not None:
        log_axis(below, "x", "frequency", "Hz")
        upper.set_xlabel("")
        below.set_yticks(range(-180, 181, 90))
        below.set_ylim(-200, 200)
        below.set_ylabel("phase [deg]")
    return upper


def _positive(sizes: np.ndarray) -> np.ndarray:
    """Return what a logarithmic axis can show."""
    return np.where(sizes > 0, sizes, np.nan)


def plot_nyquist(
    responses: Mapping[str, xr.DataArray],
    ax: Axes | None = None,
    *,
    name: str = "response",
    unit: str = "",
) -> Axes:
    """Draw complex responses in the complex plane, where each mode is nearly a circle.

    Parameters
    ----------
    responses : mapping of str to xarray.DataArray
        Complex, over ``frequency``, by the name in the legend; the first by its points.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    name, unit : str, optional
        Of the response.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    for i, (style, label, response) in enumerate(in_styles(responses)):
        if not i:
            style |= {"linestyle": "none", "marker": "o", "markersize": 3}
        ax.plot(np.real(response.values), np.imag(response.values), label=label, **style)
    _complex_plane(ax, name, unit)
    ax.set_aspect("equal", adjustable="datalim")
    legend(ax, least=1)
    return ax


def _complex_plane(ax: Axes, name: str, unit: str) -> None:
    """Draw both axes through zero, and name them."""
    ax.axhline(0.0, color="black", linewidth=0.5)
    ax.axvline(0.0, color="black", linewidth=0.5)
    si_axis(ax.xaxis, f"real part of {name}", unit)
    si_axis(ax.yaxis, f"imaginary part of {name}", unit)


# Gains over frequency.


def plot_gains(
    gains: Mapping[str, xr.DataArray],
    marks: Mapping[str, tuple[float, float]] | None = None,
    ax: Axes | None = None,
    *,
    name: str = "largest singular value",
    first_style: int = 1,
) -> Axes:
    """Draw gains over frequency on logarithmic axes.

    Parameters
    ----------
    gains : mapping of str to xarray.DataArray
        Over ``frequency`` in Hz by the name in the legend; the unit comes from the attributes, or
        several of them with commas between, if the gain mixes channels.
    marks : mapping of str to (float, float), optional
        Points to mark: frequency in Hz and gain. A frequency that is not positive and finite
        makes a level line.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    name : str, optional
        What the gain is.
    first_style : int, optional
        Where to begin in the list of line styles; 0 is grey, for a reference.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax, unit = new_axes(ax), ""
    for style, label, gain in in_styles(gains, first_style):
        style["linewidth"] = 1.2
        ax.plot(gain["frequency"].values, _positive(gain.values), label=label, **style)
        unit = str(gain.attrs.get("units", unit))
    for label, (frequency, value) in (marks or {}).items():
        if not 0 < value < np.inf:
            continue
        if 0 < frequency < np.inf:
            ax.plot([frequency], [value], "o", color="black", fillstyle="none", label=label)
        else:
            ax.axhline(value, color="black", linewidth=0.8, linestyle=":", label=label)
    log_axis(ax, "x", "frequency", "Hz")
    if "," in unit:  # no prefix suits all of them
        name, unit = f"{name} [{unit}]", ""
    log_axis(ax, "y", name, unit)
    legend(ax, least=1)
    return ax


def plot_over_frequency(
    curves: xr.Dataset, name: str, ax: Axes | None = None, *, unit: str = ""
) -> Axes:
    """Draw positive curves over ``frequency`` in Hz on logarithmic axes.

    Parameters
    ----------
    curves : xarray.Dataset
        One variable per curve, by the name in the legend.
    name, unit : str
        Of the vertical axis.
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    for style, label, curve in in_styles(curves.data_vars):
        ax.plot(curve["frequency"].values, curve.values, label=label, **style)
    log_axis(ax, "x", "frequency", "Hz")
    log_axis(ax, "y", name, unit)
    legend(ax)
    return ax


# What of a Nyquist curve is drawn: beyond it lie integrators, and nothing that matters.
_FAR = 4.0
_CRITICAL: dict[str, Any] = {"marker": "+", "color": "black", "markersize": 10, "linestyle": ""}
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
    # What lies around -1 is shown, whatever integrators do.
    across, up = [-1.5, 0.5], [-1.0, 1.0]
    for style, label, loop in in_styles(loops):
        values: Any = np.where(np.isfinite(loop.values), loop.values, np.nan)
        ax.plot(values.real, values.imag, label=label, **style)
        if (edge := _disk(disks, label)) is not None:
            ax.fill(np.real(edge), np.imag(edge), color=style["color"], alpha=0.15, linewidth=0)
        near = values[np.abs(values) < _FAR]
        across, up = [*across, *near.real], [*up, *near.imag]
    ax.plot([-1], [0], label="-1", **_CRITICAL)
    half = 0.55 * max(np.ptp(across), np.ptp(up))
    x, y = (min(across) + max(across)) / 2, (min(up) + max(up)) / 2
    ax.set(xlim=(x - half, x + half), ylim=(y - half, y + half))
    _complex_plane(ax, "L", "")
    ax.set_aspect("equal")
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
    for style, label, loop in in_styles(loops):
        values = loop.values[np.isfinite(loop.values) & (np.abs(loop.values) > 0)]
        phase = np.degrees(np.unwrap(np.angle(values)))
        phase -= 360 * np.round((phase[0] + 90) / 360) if phase.size else 0
        decibels = 20 * np.log10(np.abs(values))
        ax.plot(phase, decibels, label=label, **style)
        near = phase[(decibels > _LOWEST_DB) & (decibels < _HIGHEST_DB)]
        shown += [float(near.min()), float(near.max())] if near.size else []
        if (edge := _disk(disks, label)) is not None:
            turned = np.degrees(np.mod(np.angle(edge), 2 * np.pi)) - 360
            shade = {"color": style["color"], "alpha": 0.15, "linewidth": 0}
            ax.fill(turned, 20 * np.log10(np.abs(edge)), **shade)
    low = 180 * np.floor((min(shown) - 1) / 180)
    high = 180 * np.ceil((max(shown) + 1) / 180)
    critical = [angle for angle in np.arange(low, high + 1, 180) if (angle / 180) % 2 == 1]
    ax.plot(critical, [0] * len(critical), label="-1", **_CRITICAL)
    ax.set(xlim=(low, high), ylim=(_LOWEST_DB, _HIGHEST_DB))
    ax.set_xticks(np.arange(low, high + 1, 90 if high - low <= 720 else 180))
    ax.set(xlabel="phase of L [deg]", ylabel="gain of L [dB]")
    legend(ax)
    return ax


def _disk(disks: Mapping[str, float] | None, label: str) -> AnyVector | None:
    """Return the edge of the disk of L that a balanced disk margin excludes, if it has one."""
    alpha = (disks or {}).get(label, 0.0)
    if not 0 < alpha < 2:
        return None
    # 1 + f L = 0 for a factor f = (1 + d alpha/2) / (1 - d alpha/2) with |d| = 1
    turn = np.exp(1j * np.linspace(0, 2 * np.pi, 361)) * alpha / 2
    return -(1 - turn) / (1 + turn)
