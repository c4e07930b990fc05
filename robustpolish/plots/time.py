"""Two machines in one experiment: what drives them, what they do, and how far they are apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.signal import welch

from robustpolish.base.arrays import Vector
from robustpolish.base.results import prefix_power
from robustpolish.plots.charts import plot_bars
from robustpolish.plots.style import LINE_STYLES, log_axis, new_axes, si_axis

# Signals over time, drawn so that no peak gets lost.

_BINS = 2000
# A band has fewer bins, so that each holds some periods and the edges are smooth, and is drawn
# where the signal moves through this part of its range within a typical bin.
_BAND_BINS = 400
_QUICK = 0.05


def plot_time_series(
    signals: Mapping[str, xr.DataArray], ax: Axes | None = None, *, bands: bool = False
) -> Axes:
    """Draw signals over time.

    Long records are reduced to the smallest and largest value per bin, so that every peak stays
    visible and the file stays small.

    Parameters
    ----------
    signals : mapping of str to xarray.DataArray
        Signals over `time` by the name in the legend; the units come from their attributes.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    bands : bool, optional
        Draw oscillations that are too quick to be seen one by one as a pale band between their
        smallest and largest values, through which the other signals show.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    unit, banded = "", False
    for i, (label, signal) in enumerate(signals.items()):
        time, values = signal["time"].to_numpy(), signal.to_numpy()
        style = LINE_STYLES[(i if len(signals) > 1 else 1) % len(LINE_STYLES)]
        band = _band(time, values) if bands else None
        if band is None:
            ax.plot(*_envelope(time, values), label=label, linewidth=1.0, **style)
        else:
            banded, color = True, style["color"]
            ax.fill_between(*band, facecolor=color, alpha=0.35, label=label, linewidth=0)
            for edge in band[1:]:
                ax.plot(band[0], edge, color=color, linewidth=0.8)
        unit = signal.attrs.get("units", "")
    names = {str(signal.name or "") for signal in signals.values()}
    si_axis(ax.xaxis, "time", "s")
    si_axis(ax.yaxis, names.pop() if len(names) == 1 else "", unit)  # the legend names the others
    if len(signals) > 1 and banded:  # "best" does not see what lies within a band
        ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=min(len(signals), 3))
    elif len(signals) > 1:
        ax.legend(loc="best")
    return ax


def _band(time: Vector, values: Vector) -> tuple[Vector, Vector, Vector] | None:
    """Return time, smallest and largest value of bins; None for what a line can show."""
    size = values.size // _BAND_BINS
    if size < 4:
        return None
    whole = values[: size * _BAND_BINS].reshape(_BAND_BINS, size)
    low, high = whole.min(axis=1), whole.max(axis=1)
    turns = np.sum(np.diff(np.sign(np.diff(whole, axis=1)), axis=1) != 0, axis=1)
    # What moves little within a bin is a line; what turns less than twice is steep, not quick.
    if np.median(high - low) <= _QUICK * np.ptp(values) or np.median(turns) < 2:
        return None
    return time[: size * _BAND_BINS].reshape(_BAND_BINS, size).mean(axis=1), low, high


def _envelope(time: Vector, values: Vector) -> tuple[Vector, Vector]:
    """Keep the smallest and the largest sample of every bin, in their order in time."""
    size = values.size // _BINS
    if size < 4:
        return time, values
    whole = values[: size * _BINS].reshape(_BINS, size)
    ends = size * np.arange(_BINS)
    kept = [whole.argmin(axis=1) + ends, whole.argmax(axis=1) + ends]
    kept = np.unique(np.concatenate([*kept, np.arange(size * _BINS, values.size)]))
    return time[kept], values[kept]


# Signals before and after, one panel each, with a closer look where they oscillate.

# Periods of the slowest quick oscillation that the closer look shows, and how many the whole record
# must have to need one.
_SHOWN_PERIODS = 6
_TOO_MANY = 60


def plot_panels(
    responses: Mapping[str, xr.Dataset], signals: Sequence[str], width: float = 9.0
) -> Figure:
    """Draw every signal in a panel of its own, over a common time axis.

    Where signals oscillate too quickly to be seen they become bands, and a second column shows
    some periods from the middle of the record.

    Parameters
    ----------
    responses : mapping of str to xarray.Dataset
        Signals over `time`, by the name in the legend.
    signals : sequence of str
        Names of the variables; each response shows those that it has.
    width : float, optional
        Inches.

    Returns
    -------
    matplotlib.figure.Figure
    """
    shown = {name: {k: r[name] for k, r in responses.items() if name in r} for name in signals}
    closer = _closer([signal for found in shown.values() for signal in found.values()])
    figure, panels = plt.subplots(
        len(signals), 1 if closer is None else 2, sharex="col", sharey="row", squeeze=False,
        figsize=(width, 1.4 + 1.7 * len(signals)), layout="constrained",
        width_ratios=None if closer is None else (5, 3),
    )  # fmt: skip
    for row, found in zip(panels, shown.values(), strict=True):
        plot_time_series(found, row[0], bands=True)
        if closer is not None:
            part = {label: signal.sel(time=slice(*closer)) for label, signal in found.items()}
            plot_time_series(part, row[1])
            row[1].set_ylabel("")
            row[1].margins(x=0)
        for ax in row:
            ax.label_outer()
            if ax.get_legend():
                ax.get_legend().remove()
    if closer is not None:
        panels[-1, 1].xaxis.set_major_locator(MaxNLocator(2))
    # Panels of one unit have one prefix, that of the largest.
    units = [
        str(next(iter(found.values())).attrs.get("units", "")) if found else ""
        for found in shown.values()
    ]
    limits = [max(map(abs, ax.get_ylim())) for ax in panels[:, 0]]
    for ax, name, unit in zip(panels[:, 0], shown, units, strict=True):
        alike = [limit for limit, u in zip(limits, units, strict=True) if u == unit]
        si_axis(ax.yaxis, name, unit, prefix_power(max(alike)))
    handles, labels = panels[0, 0].get_legend_handles_labels()
    if len(labels) > 1:
        figure.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 3))
    return figure


def _closer(signals: Sequence[xr.DataArray]) -> tuple[float, float] | None:
    """Return from when to when some periods show; None where no oscillation is too quick."""
    periods = [period for signal in signals if (period := _period(signal)) is not None]
    if not periods:
        return None
    time = signals[0]["time"].to_numpy()
    middle = float(time[0] + time[-1]) / 2
    return middle, middle + _SHOWN_PERIODS * max(periods)


def _period(signal: xr.DataArray) -> float | None:
    """Return the period that dominates a signal, if the record holds too many to be seen."""
    time, values = signal["time"].to_numpy(), signal.to_numpy()
    if values.size < 4 * _TOO_MANY or not np.isfinite(values).all():
        return None
    content = np.abs(np.fft.rfft(values - values.mean()))
    strongest = int(content.argmax())
    if strongest < _TOO_MANY:
        return None
    return float(time[-1] - time[0]) / strongest


# A measured signal and two models of it, before and after a step, with what is left of both.


def plot_before_and_after(
    measured: xr.DataArray,
    before: xr.DataArray | None,
    after: xr.DataArray,
    stretch: slice | None = None,
    width: float = 9.0,
) -> Figure:
    """Draw a signal with two models of it, and below what each leaves.

    Parameters
    ----------
    measured, before, after : xarray.DataArray
        Over the same ``time``, with units; `before` may be missing.
    stretch : slice of float, optional
        Times between which single swings are shown, in s; the third panel shows the residuals of
        the whole record then.
    width : float, optional
        Inches.

    Returns
    -------
    matplotlib.figure.Figure
        Axes: signals, residuals, and residuals of the whole record.
    """
    models = {"before": before, "after": after}
    given = {label: signal for label, signal in models.items() if signal is not None}
    rest = {
        label: (measured - signal).assign_attrs(measured.attrs).rename("residual")
        for label, signal in given.items()
    }
    rows = 2 if stretch is None else 3
    figure, axes = plt.subplots(rows, 1, figsize=(width, 1.0 + 2.1 * rows), layout="constrained")
    shown = {"measured": measured, **given}
    for ax, signals in zip(axes[:2], (shown, rest), strict=True):
        inside = {k: s if stretch is None else s.sel(time=stretch) for k, s in signals.items()}
        _plot_alike(inside, ax)
    axes[0].set_xlabel("")
    if stretch is not None:
        whole = axes[2]
        _plot_alike(rest, whole)
        whole.axvspan(stretch.start, stretch.stop, color="#333333", alpha=0.15)
        whole.set_title("the whole record; shaded: shown above")
    # Swings fill every panel: there is no place for names but above them all.
    figure.legend(handles=axes[0].lines, loc="outside upper center", ncols=len(shown))
    return figure


def _plot_alike(signals: Mapping[str, xr.DataArray], ax: Axes) -> None:
    """Draw signals without a legend, with one look for one thing in every panel."""
    plot_time_series(signals, ax)
    for line in ax.lines:
        line.set(**_STYLES[str(line.get_label())])
    if ax.get_legend() is not None:
        ax.get_legend().remove()  # pyright: ignore[reportOptionalMemberAccess]


_STYLES = {
    "measured": {**LINE_STYLES[0], "linewidth": 3.0},
    "before": LINE_STYLES[2],
    "after": LINE_STYLES[1],
}


# Measured and simulated signals, what is left over, and the spectra of both.


def plot_overlay(
    measured: xr.Dataset, simulated: xr.Dataset, band: xr.Dataset | None = None
) -> Figure:
    """Draw a row of three panels for each signal: overlay, residual, spectra.

    Parameters
    ----------
    measured, simulated : xarray.Dataset
        Signals over uniform ``time`` by the same names, with units; NaN is not drawn.
    band : xarray.Dataset, optional
        Half width of the simulated signals' confidence band.

    Returns
    -------
    matplotlib.figure.Figure
    """
    names = [str(name) for name in measured.data_vars]
    figure, panels = plt.subplots(
        len(names), 3, squeeze=False, figsize=(14, 0.8 + 2.4 * len(names)), layout="constrained"
    )
    for (overlay, rest, spectra), name in zip(panels, names, strict=True):
        own = None if band is None else band[name]
        plot_response(measured[name], simulated[name], own, overlay)
        residual = (measured[name] - simulated[name]).assign_attrs(simulated[name].attrs)
        plot_time_series({"residual": residual}, rest)
        plot_spectra({"measured": measured[name], "residual": residual}, spectra)
        for ax, title in ((overlay, name), (rest, "residual"), (spectra, "spectra")):
            ax.set_title(title)
    return figure


def plot_response(
    measured: xr.DataArray,
    simulated: xr.DataArray,
    band: xr.DataArray | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw one signal as measured and as simulated.

    Parameters
    ----------
    measured, simulated : xarray.DataArray
        Over ``time``, with units; NaN is not drawn.
    band : xarray.DataArray, optional
        Half width of the simulated signal's confidence band.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = plot_time_series({"measured": measured, "simulated": simulated}, ax)
    ax.lines[-2].set_linewidth(2.5)  # so that it shows beneath a model that fits
    if band is not None:
        low, high = simulated - band, simulated + band
        shade = {"alpha": 0.3, "color": "#d55e00", "label": "95 % band"}
        ax.fill_between(simulated["time"].values, low.values, high.values, **shade)
        ax.legend(loc="best")
    return ax


def plot_spectra(signals: dict[str, xr.DataArray], ax: Axes) -> Axes:
    """Draw amplitude spectral densities (Welch) over frequency.

    Parameters
    ----------
    signals : dict of str to xarray.DataArray
        Signals over uniform ``time``; samples that are NaN are left out.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
    """
    unit = ""
    for style, (label, signal) in zip(LINE_STYLES[1:], signals.items(), strict=False):
        values = np.asarray(signal.values, dtype=float)
        values = values[np.isfinite(values)]
        if values.size < 8:
            continue
        time = signal["time"].values
        rate = (time.size - 1) / float(time[-1] - time[0])
        frequency, density = welch(values, rate, nperseg=min(values.size, 4096))
        ax.plot(frequency[1:], np.sqrt(density[1:]), label=label, **style)
        unit = str(signal.attrs.get("units", ""))
    ax.set_ylabel(f"amplitude density [{unit or '1'}/sqrt(Hz)]")
    if ax.lines:
        log_axis(ax, "x", "frequency", "Hz")
        ax.set_yscale("log")
        ax.legend(loc="best")
    return ax


def plot_two_machines(
    drive: xr.DataArray | None,
    responses: Sequence[xr.DataArray],
    names: Sequence[str],
    noise: float,
    width: float = 9.0,
) -> Figure:
    """Draw an experiment on two machines, and their difference against the noise.

    Parameters
    ----------
    drive : xarray.DataArray or None
        What is driven, over ``time``; None for a free decay.
    responses : sequence of xarray.DataArray
        One output of both machines, and of the second after it took after the first.
    names : sequence of str
        Of the two machines.
    noise : float
        Standard deviation of the output's noise.
    width : float, optional
        Inches.

    Returns
    -------
    matplotlib.figure.Figure
        Axes: the drive if there is one, the outputs, the differences.
    """
    first, second, adapted = responses
    rows = 2 + (drive is not None)
    figure, axes = plt.subplots(
        rows, 1, sharex=True, figsize=(width, 1.0 + 2.1 * rows), layout="constrained"
    )
    if drive is not None:
        plot_time_series({"drive": drive}, axes[0])
        axes[0].set_xlabel("")
    both, apart = axes[-2:]
    plot_time_series(dict(zip(names, (first, second), strict=True)), both)
    both.lines[0].set(linewidth=2.5)
    both.set_xlabel("")
    rest = {"as they are": first - second, "second fitted anew": first - adapted}
    unit = {"units": first.attrs.get("units", "")}
    plot_time_series({k: d.rename("difference").assign_attrs(unit) for k, d in rest.items()}, apart)
    for line, style in zip(apart.lines, (LINE_STYLES[2], LINE_STYLES[1]), strict=True):
        line.set(**style)
    band = "noise, twice its standard deviation"
    apart.axhspan(-2 * noise, 2 * noise, color="#333333", alpha=0.25, label=band)
    apart.legend(loc="best")
    return figure


def plot_distances(ratios: xr.DataArray, clear: float, ax: Axes | None = None) -> Axes:
    """Draw how far each experiment takes two machines apart, the largest on top.

    Parameters
    ----------
    ratios : xarray.DataArray
        Differences over the noise, over one dimension with labels.
    clear : float
        From where they are told apart.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
    """
    values = ratios.copy(data=np.maximum(np.asarray(ratios.values, dtype=float), 1e-3))
    ax = plot_bars(values, values < clear, ax)
    ax.get_legend().remove()  # pyright: ignore[reportOptionalMemberAccess]
    ax.axvline(clear, color="black", linestyle="--", linewidth=1, label="told apart from here")
    ax.set_xlim(min(float(values.min()), clear) / 2, max(float(values.max()), clear) * 2)
    log_axis(ax, "x", str(ratios.name or "difference over noise"), "")
    ax.set_ylabel("")
    ax.legend(loc="best")
    return ax
