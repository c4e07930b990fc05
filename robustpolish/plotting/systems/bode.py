"""Complex responses over frequency: magnitude and phase, and in the complex plane."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.plotting.style import LINE_STYLES, legend, log_axis, new_axes, si_axis


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
    upper, below = _two_axes() if ax is None else (ax, phase)
    for i, (label, response) in enumerate(responses.items()):
        style: dict[str, Any] = {**LINE_STYLES[(i + 1) % len(LINE_STYLES)]}
        style["linewidth"] = 1.2 if i else 2.5
        frequency, values = response["frequency"].values, response.values
        size = np.abs(values)
        upper.plot(frequency, np.where(size > 0, size, np.nan), label=label, **style)
        if below is not None:
            below.plot(frequency, _degrees(values), **style)
    if spread is not None:
        floor = np.where(spread.values > 0, spread.values, np.nan)
        upper.plot(
            spread["frequency"].values, floor, label="noise", linewidth=0.8, **LINE_STYLES[0]
        )
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
    for i, (label, response) in enumerate(responses.items()):
        style: dict[str, Any] = {**LINE_STYLES[(i + 1) % len(LINE_STYLES)]}
        if not i:
            style |= {"linestyle": "none", "marker": "o", "markersize": 3}
        ax.plot(np.real(response.values), np.imag(response.values), label=label, **style)
    ax.axhline(0.0, color="black", linewidth=0.5)
    ax.axvline(0.0, color="black", linewidth=0.5)
    ax.set_aspect("equal", adjustable="datalim")
    si_axis(ax.xaxis, f"real part of {name}", unit)
    si_axis(ax.yaxis, f"imaginary part of {name}", unit)
    legend(ax, least=1)
    return ax


def _two_axes() -> tuple[Axes, Axes]:
    figure = plt.figure(layout="constrained")
    upper, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    return upper, below


def _degrees(values: np.ndarray) -> np.ndarray:
    """Return the phase in degrees, with gaps instead of lines where it jumps by a turn."""
    phase = np.degrees(np.angle(values))
    jumps = np.flatnonzero(np.abs(np.diff(phase)) > 180)
    phase[jumps] = np.nan
    return phase
