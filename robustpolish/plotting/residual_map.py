"""Where in time and at which frequency a residual is."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from numpy.typing import ArrayLike
from scipy.signal import ShortTimeFFT

from robustpolish.plotting.style import LINE_STYLES, log_axis, new_axes, si_axis

# Steps of the colour scale; further below the largest density nothing is of interest.
_DYNAMICS = 1e3
_SEGMENTS = 40


def plot_residual_map(
    residual: xr.DataArray,
    marks: Mapping[str, ArrayLike] | None = None,
    ax: Axes | None = None,
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
    length = max(16, min(1024, time.size // _SEGMENTS * 4))
    length = min(length, time.size)
    window = np.hanning(length + 2)[1:-1]
    transform = ShortTimeFFT(window, max(1, length // 4), rate, scale_to="psd")
    density = np.abs(transform.stft(values - values.mean()))
    moments = transform.t(time.size) + time[0]
    frequency = transform.f
    inside = (moments >= time[0]) & (moments <= time[-1])
    density, moments = density[1:, inside], moments[inside]
    top = float(density.max()) if density.size and density.max() > 0 else 1.0
    image = ax.pcolormesh(
        moments,
        frequency[1:],
        np.maximum(density, top / _DYNAMICS),
        norm=LogNorm(top / _DYNAMICS, top),
        cmap="cividis",
        shading="nearest",
        rasterized=True,
    )
    unit = str(residual.attrs.get("units", "")) or "1"
    bar = ax.figure.colorbar(image, ax=ax)
    bar.set_label(f"amplitude density [{unit}/sqrt(Hz)]")
    for style, (what, frequencies) in zip(LINE_STYLES[2:], (marks or {}).items(), strict=False):
        near = [f for f in np.ravel(np.asarray(frequencies, dtype=float)) if f < frequency[-1]]
        for i, line in enumerate(near):
            shade = {**style, "color": "white", "linewidth": 1.0}
            ax.axhline(line, label=what if i == 0 else None, **shade)
    si_axis(ax.xaxis, "time", "s")
    log_axis(ax, "y", "frequency", "Hz")
    ax.set_ylim(frequency[1], frequency[-1])
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc="best", facecolor="#333333", labelcolor="white")
    return ax
