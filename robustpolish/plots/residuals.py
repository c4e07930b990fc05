"""Pictures of where a residual is and how it tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter
from scipy.signal import ShortTimeFFT

from robustpolish.plots.style import LINE_STYLES, legend, log_axis, new_axes, quantity_axis, si_axis

# A force over what it depends on, with its band.


def plot_force_curve(
    force: xr.DataArray, band: xr.DataArray | None = None, ax: Axes | None = None
) -> Axes:
    """Draw a force over a displacement or a velocity, or what else its name says over time.

    Parameters
    ----------
    force : xarray.DataArray
        Over one dimension, both with units; its name stands at the axis.
    band : xarray.DataArray, optional
        Half width of the 95 % band; where it is not finite, none is drawn.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    name = str(force.dims[0])
    x, y = force[name].values, force.values
    ax.axhline(0.0, **{**LINE_STYLES[0], "linewidth": 0.8})
    ax.plot(x, y, label="learned", **LINE_STYLES[1])
    if band is not None:
        # a band of many times the force would flatten the curve
        half = np.minimum(np.nan_to_num(band.values, posinf=np.inf), np.ptp(y))
        shade = {"alpha": 0.3, "color": LINE_STYLES[2]["color"], "label": "95 % band"}
        ax.fill_between(x, y - half, y + half, **shade)
    quantity_axis(ax.xaxis, force[name])
    quantity_axis(ax.yaxis, force, force.name or "force")
    legend(ax)
    return ax


# Where in time and at which frequency a residual is.

# Steps of the colour scale; further below the largest density nothing is of interest.
_DYNAMICS = 1e3
_SEGMENTS = 40


def plot_residual_map(
    residual: xr.DataArray, marks: Mapping[str, ArrayLike] | None = None, ax: Axes | None = None
) -> Axes:
    """Draw the amplitude density of a signal over time and frequency.

    Parameters
    ----------
    residual : xarray.DataArray
        Over uniform ``time`` in s, with units.
    marks : mapping of str to array_like, optional
        Frequencies in Hz to mark, by what they are.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
        Dark is little, light is much, so that a print in grey tells the same.
    """
    ax = new_axes(ax)
    time = residual["time"].values
    values = np.asarray(residual.values, dtype=float)
    rate = (time.size - 1) / float(time[-1] - time[0])
    length = min(max(16, min(1024, time.size // _SEGMENTS * 4)), time.size)
    window = np.hanning(length + 2)[1:-1]
    transform = ShortTimeFFT(window, max(1, length // 4), rate, scale_to="psd")
    density = np.abs(transform.stft(values - values.mean()))
    moments, frequency = transform.t(time.size) + time[0], transform.f
    inside = (moments >= time[0]) & (moments <= time[-1])
    density, moments = density[1:, inside], moments[inside]
    top = float(density.max(initial=0.0)) or 1.0
    shown = moments, frequency[1:], np.maximum(density, top / _DYNAMICS)
    scale = LogNorm(top / _DYNAMICS, top)
    image = ax.pcolormesh(*shown, norm=scale, cmap="cividis", shading="nearest", rasterized=True)
    unit = str(residual.attrs.get("units", "")) or "1"
    bar = ax.figure.colorbar(image, ax=ax)
    bar.set_label(f"amplitude density [{unit}/sqrt(Hz)]")
    white = {"color": "white", "linewidth": 1.0}
    _mark(ax.axhline, marks or {}, lambda line: line < frequency[-1], white)
    si_axis(ax.xaxis, "time", "s")
    log_axis(ax, "y", "frequency", "Hz")
    ax.set_ylim(frequency[1], frequency[-1])
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc="best", facecolor="#333333", labelcolor="white")
    return ax


def _mark(
    draw: Callable[..., Any],
    marks: Mapping[str, ArrayLike],
    inside: Callable[[float], bool],
    look: Mapping[str, Any],
) -> None:
    """Draw a line at every frequency to be marked; the first of a kind has its name."""
    for style, (what, frequencies) in zip(LINE_STYLES[2:], marks.items(), strict=False):
        for i, at in enumerate(filter(inside, np.ravel(np.asarray(frequencies, dtype=float)))):
            draw(at, label=what if i == 0 else None, **{**style, **look})


_LAGS = 200
# Cells over which the line of a surface is smoothed: as wide as the noise of one, no wider than a
# dead zone.
_NEIGHBOURS = 1.0
Banded = tuple[xr.DataArray, xr.DataArray]


def plot_residual_analysis(
    name: str,
    windows: xr.DataArray,
    bands: xr.DataArray,
    marks: Mapping[str, ArrayLike],
    autocorrelation: Banded,
    cross_correlations: Mapping[str, Banded],
    coherences: Mapping[str, tuple[xr.DataArray, float]],
    surfaces: Mapping[str, xr.Dataset],
) -> Figure:
    """Draw shares, tests and restoring-force surfaces of one output's residual.

    Parameters
    ----------
    name : str
        Of the output.
    windows, bands : xarray.DataArray
        Shares over ``window`` (``begin``, ``end`` in s) and ``band`` (``low``, ``high`` in Hz).
    marks : mapping of str to array_like
        Frequencies in Hz to mark, by what they are.
    autocorrelation : (xarray.DataArray, xarray.DataArray)
        Coefficients and half width of their band, over ``lag``.
    cross_correlations : mapping of str to (xarray.DataArray, xarray.DataArray)
        Likewise, by input.
    coherences : mapping of str to (xarray.DataArray, float)
        Over ``frequency``, and the threshold, by input.
    surfaces : mapping of str to xarray.Dataset
        ``force`` over ``displacement`` and ``velocity``, by place.

    Returns
    -------
    matplotlib.figure.Figure
    """
    panels = 3 + len(cross_correlations) + len(coherences) + len(surfaces)
    rows = -(-panels // 3)
    figure, grid = plt.subplots(rows, 3, figsize=(15, 3.3 * rows), layout="constrained")
    figure.suptitle(f"Where the error of {name} is")
    axes = iter(np.ravel(grid))
    plot_window_shares(windows, next(axes))
    plot_band_shares(bands, marks, next(axes))
    plot_correlation(*autocorrelation, next(axes)).set_title("autocorrelation")
    for source, (value, band) in cross_correlations.items():
        plot_correlation(value, band, next(axes)).set_title(f"correlation with {source}")
    for source, (value, threshold) in coherences.items():
        plot_coherence(value, threshold, next(axes)).set_title(f"coherence with {source}")
    for place, shown in surfaces.items():
        plot_surface(shown, next(axes)).set_title(f"missing force at {place}")
    for ax in axes:
        ax.set_axis_off()
    return figure


def plot_window_shares(shares: xr.DataArray, ax: Axes | None = None) -> Axes:
    """Draw the share of the error over time, from ``begin`` and ``end`` in s.

    Parameters
    ----------
    shares : xarray.DataArray
        Over windows from ``begin`` to ``end`` in s.
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    begin, end = shares["begin"].values, shares["end"].values
    ax.bar(begin, 100 * shares.values, width=end - begin, align="edge", color="#0072b2")
    si_axis(ax.xaxis, "time", "s")
    ax.set_ylabel("share of the error [%]")
    return ax


def plot_band_shares(
    shares: xr.DataArray, marks: Mapping[str, ArrayLike], ax: Axes | None = None
) -> Axes:
    """Draw the share of the error over frequency, with some frequencies marked.

    Parameters
    ----------
    shares : xarray.DataArray
        Over bands from ``low`` to ``high`` in Hz.
    marks : mapping of str to array_like
        Frequencies in Hz by what they are.
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    low, high = shares["low"].values.copy(), shares["high"].values
    low[0] = max(low[0], high[0] / 2)  # the axis is logarithmic
    ax.bar(low, 100 * shares.values, width=high - low, align="edge", color="#0072b2", alpha=0.7)
    _mark(ax.axvline, marks, lambda _: True, {})
    ax.set_xlim(low[0], high[-1])
    log_axis(ax, "x", "frequency", "Hz")
    ax.set_ylabel("share of the error [%]")
    legend(ax, least=1)
    return ax


def plot_correlation(value: xr.DataArray, band: xr.DataArray, ax: Axes | None = None) -> Axes:
    """Draw correlation coefficients over ``lag`` in s, the smallest lags only, with their band.

    Parameters
    ----------
    value, band : xarray.DataArray
        Coefficients and half width of their band, over ``lag`` in s.
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    near = np.sort(np.argsort(np.abs(value["lag"].values), kind="stable")[: 2 * _LAGS])
    lag = value["lag"].values[near]
    ax.fill_between(lag, -band.values[near], band.values[near], color="#999999", alpha=0.5)
    ax.plot(lag, value.values[near], color="#0072b2", linewidth=0.8)
    si_axis(ax.xaxis, "lag", "s")
    ax.set_ylabel("coefficient (band: 99 %)")
    return ax


def plot_coherence(value: xr.DataArray, threshold: float, ax: Axes | None = None) -> Axes:
    """Draw the coherence over ``frequency`` in Hz with the threshold of chance.

    Parameters
    ----------
    value : xarray.DataArray
        Over ``frequency`` in Hz.
    threshold : float
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    shown = value[value["frequency"].values > 0]
    line = {"color": "#0072b2", "linewidth": 0.8, "label": "coherence"}
    ax.plot(shown["frequency"].values, shown.values, **line)
    ax.axhline(threshold, color="#333333", linestyle="--", label="chance")
    ax.set_ylim(0, 1)
    log_axis(ax, "x", "frequency", "Hz")
    ax.set_ylabel("coherence")
    ax.legend(loc="best")
    return ax


def _smoothed(shown: xr.Dataset) -> NDArray[np.float64]:
    """Return forces without the noise of cells that few samples visited, NaN where none did."""
    force = np.asarray(shown["force"].values, dtype=float)
    if "samples" not in shown:
        return force
    weight = np.where(np.isfinite(force), shown["samples"].values, 0.0)
    total, share = (
        gaussian_filter(part, _NEIGHBOURS, mode="constant")
        for part in (np.nan_to_num(force) * weight, weight)
    )
    return np.where(weight > 0, total / np.where(share > 0, share, 1.0), np.nan)


def plot_surface(shown: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw a restoring-force surface: ``force`` over ``displacement`` and ``velocity``.

    A white line shows where the force turns: across the displacement a spring is missing, across
    the velocity a damper or friction.

    Parameters
    ----------
    shown : xarray.Dataset
        ``force`` over ``displacement`` and ``velocity``, with units. Where ``samples`` (the share
        of the record in each cell) are known the line follows means over neighbouring cells.
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    force = shown["force"]
    sides = shown["displacement"].values, shown["velocity"].values
    known = force.values[np.isfinite(force.values)]
    largest = float(np.abs(known).max()) if known.size else 1.0
    image = ax.pcolormesh(*sides, force.values.T, cmap="cividis", vmin=-largest, vmax=largest)
    if known.size > 1 and known.min() < 0 < known.max() and min(force.shape) > 1:
        # Dark pushes one way, light the other, in grey too; the line is where the force turns.
        ax.contour(*sides, _smoothed(shown).T, levels=[0.0], colors="white", linewidths=1.5)
        line = Line2D([], [], color="white", linewidth=1.5, label="no force")
        # off the map, in the room below the bar of its colours: titles stand above
        ax.legend(
            handles=[line], loc="upper left", bbox_to_anchor=(1.0, -0.02),
            facecolor="#333333", labelcolor="white", fontsize="small",
        ).set_in_layout(False)  # fmt: skip
    colorbar = ax.figure.colorbar(image, ax=ax)
    quantity_axis(colorbar.ax.yaxis, force)
    quantity_axis(ax.xaxis, shown["displacement"])
    quantity_axis(ax.yaxis, shown["velocity"])
    return ax
