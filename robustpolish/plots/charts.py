"""Maps over a plane, and surfaces in space."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from robustpolish.plots.style import (
    BAD,
    GOOD,
    LEVEL,
    LINE_STYLES,
    MARKER_STYLES,
    in_styles,
    legend,
    log_axis,
    new_axes,
    quantity_axis,
    si_axis,
)

# A positive number for each of several things.


def plot_bars(
    values: xr.DataArray, bad: xr.DataArray | None = None, ax: Axes | None = None, *,
    meaning: tuple[str, str] = ("good", "bad"),
) -> Axes:  # fmt: skip
    """Draw horizontal bars on a logarithmic axis, the first on top.

    Parameters
    ----------
    values : xarray.DataArray
        Over one dimension with labels; named, with units. What is zero or not finite gets no bar.
    bad : xarray.DataArray of bool, optional
        Which bars to draw as bad.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    meaning : (str, str), optional
        Names of the good and the bad bars in the legend.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    labels = [str(label) for label in values[values.dims[0]].values]
    numbers = np.asarray(values.values, dtype=float)
    flags = np.zeros(numbers.size, bool) if bad is None else np.asarray(bad.values, bool)
    places = np.arange(numbers.size)
    usable = np.isfinite(numbers) & (numbers > 0)
    shown = numbers[usable] if usable.any() else np.ones(1)
    for style, chosen in ((GOOD, ~flags), (BAD, flags)):
        ax.barh(places[chosen], np.where(usable, numbers, 0.0)[chosen], height=0.7, **style)
    ax.set_yticks(places, labels)
    ax.invert_yaxis()
    ax.set_xlim(shown.min() / 3, shown.max() * 3)
    log_axis(ax, "x", str(values.name or ""), str(values.attrs.get("units", "")))
    ax.set_ylabel(str(values.dims[0]))
    if bad is not None:
        good, worse = meaning
        ax.legend(handles=[Patch(label=good, **GOOD), Patch(label=worse, **BAD)], loc="best")
    return ax


# How a number scatters, and where reference values lie.

# Values that hardly scatter have long numbers at their ticks.
_TICKS = 4


def plot_distribution(
    values: xr.DataArray,
    marks: Mapping[str, float] | None = None,
    ax: Axes | None = None,
    *,
    note: str = "",
) -> Axes:
    """Draw a histogram with reference values as vertical lines.

    Parameters
    ----------
    values : xarray.DataArray
        Over one dimension; named, with units. None at all gives an empty picture with its marks.
    marks : mapping of str to float, optional
        Reference values by their name in the legend.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    note : str, optional
        A remark for the upper edge.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    numbers = np.asarray(values.values, dtype=float)
    if numbers.size:
        ax.hist(numbers, bins=min(30, max(5, numbers.size // 8)), **LEVEL)
    for style, (name, value) in zip(LINE_STYLES[1:], (marks or {}).items(), strict=False):
        ax.axvline(value, label=name, **style)
    quantity_axis(ax.xaxis, values)
    ax.xaxis.set_major_locator(MaxNLocator(_TICKS))
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_ylabel(f"number per bin ({values.dims[0]})")
    if note:
        ax.set_title(note, fontsize="medium")
    legend(ax, least=1 if marks else 2)
    return ax


# Values with bars of uncertainty over a positive quantity.


def plot_error_bars(
    curves: Mapping[str, xr.DataArray], name: str, unit: str, ax: Axes | None = None, *, over: str
) -> Axes:
    """Draw values with error bars over a logarithmic axis.

    Parameters
    ----------
    curves : mapping of str to xarray.DataArray
        Over the dimension `over`, with the coordinate ``bar``: half the length of each bar.
    name, unit : str
        Of the values.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    over : str
        Name of the dimension, positive numbers.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    for style, label, curve in in_styles(curves, 0, MARKER_STYLES):
        ax.errorbar(
            curve[over].values, curve.values, curve["bar"].values, label=label, capsize=3, **style
        )
    ax.set_xscale("log")
    ax.set_xlabel(over)
    si_axis(ax.yaxis, name, unit)
    legend(ax, least=1)
    return ax


# What a controller achieves against what it costs.


def plot_gain_against_norm(points: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw one marker for each controller: its norm over its gain.

    Parameters
    ----------
    points : xarray.Dataset
        ``gain`` and ``norm`` over ``controller``; each with a ``long_name`` and ``units`` in its
        attributes. What is not finite is left out.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    known = points.where((points["gain"] > 0) & (points["norm"] > 0)).dropna("controller")
    single = {name: known.sel(controller=name) for name in known["controller"].values}
    for style, name, one in in_styles(single, 0, MARKER_STYLES):
        style |= {"linestyle": "", "markersize": 8, "fillstyle": "none"}
        ax.plot(float(one["gain"]), float(one["norm"]), label=name, **style)
    for which, key, axis, wide in (("x", "gain", ax.xaxis, 1.5), ("y", "norm", ax.yaxis, 10)):
        name, unit = (str(points[key].attrs.get(k, "")) for k in ("long_name", "units"))
        values = known[key].values
        if values.size and values.max() > wide * values.min():
            log_axis(ax, which, name, unit)
        else:
            si_axis(axis, name, unit)
    legend(ax, least=1)
    return ax


# Something over a plane.


def plot_over_plane(
    shown: xr.DataArray, ax: Axes | None = None, *, level: float | None = None
) -> Axes:
    """Draw a map over x and y: dark is little, light is much.

    Parameters
    ----------
    shown : xarray.DataArray
        Over ``x`` and ``y``, with units.
    ax : matplotlib.axes.Axes, optional
    level : float, optional
        Where to draw a line.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    x, y = shown["x"].values, shown["y"].values
    values = shown.transpose("y", "x").values
    image = ax.pcolormesh(x, y, values, cmap="cividis", rasterized=True)
    known = values[np.isfinite(values)]
    if level is not None and known.size and known.min() < level < known.max():
        ax.contour(x, y, values, levels=[level], colors="white", linewidths=1.5)
    colorbar = ax.figure.colorbar(image, ax=ax)
    quantity_axis(colorbar.ax.yaxis, shown)
    si_axis(ax.xaxis, "x", "m")
    si_axis(ax.yaxis, "y", "m")
    ax.set_aspect("equal")
    return ax


# A path above a surface in three dimensions.

_PIECES = 4000  # of a line; more are not seen
_ACROSS = 60  # lines of a surface


def plot_path_in_space(
    ground: xr.DataArray, place: tuple[xr.DataArray, ...], colour: xr.DataArray, ax: Any = None
) -> Any:
    """Draw a surface, and above it a path coloured by what was met along it.

    Parameters
    ----------
    ground : xarray.DataArray
        Heights over ``x`` and ``y`` [m]; nan where there is none.
    place : tuple of xarray.DataArray
        x, y and z of the path over time [m].
    colour : xarray.DataArray
        What colours the path, at the same times, with units.
    ax : mpl_toolkits.mplot3d.Axes3D, optional
        A new figure by default.

    Returns
    -------
    mpl_toolkits.mplot3d.Axes3D
        In mm, with heights drawn to the same scale.
    """
    if ax is None:
        figure = plt.figure(layout="constrained", figsize=(7, 5))
        ax = figure.add_subplot(projection="3d")
    rows, columns = (slice(None, None, max(1, n // _ACROSS)) for n in ground.shape)
    shown = 1e3 * ground.transpose("x", "y").values[rows, columns]
    sides = 1e3 * ground["x"].values[rows], 1e3 * ground["y"].values[columns]
    x, y = np.meshgrid(*sides, indexing="ij")
    ax.plot_surface(x, y, shown, color="#cccccc", alpha=0.4, linewidth=0, rstride=1, cstride=1)
    every = max(1, colour.size // _PIECES)
    points = 1e3 * np.stack([part.values[::every] for part in place], axis=1)
    pieces = Line3DCollection(list(np.stack([points[:-1], points[1:]], axis=1)), cmap="cividis")
    pieces.set_array(colour.values[::every][:-1])
    pieces.set(linewidth=2.0, zorder=2.5)
    ax.computed_zorder = False  # the path lies on the surface and has to be seen
    ax.add_collection(pieces)
    bar = ax.figure.colorbar(pieces, ax=ax, shrink=0.7)
    quantity_axis(bar.ax.yaxis, colour, colour.attrs.get("long_name"))
    ax.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]")
    heights = shown[np.isfinite(shown)]
    ax.set_box_aspect((np.ptp(x), np.ptp(y), max(np.ptp(heights), 0.15 * np.ptp(x))))
    return ax


# How an error fell step by step.


def plot_waterfall(
    levels: xr.DataArray, floor: float | None = None, ax: Axes | None = None
) -> Axes:
    """Draw levels after each step, and what each step took away or added.

    Parameters
    ----------
    levels : xarray.DataArray
        Over ``step``, with a name and units; the first is drawn as a whole.
    floor : float, optional
        The level that noise leaves, a line across.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = new_axes(ax)
    names = [str(step) for step in levels["step"].values]
    values = levels.values.astype(float)
    for i, (before, level) in enumerate(zip([0.0, *values], values, strict=False)):
        style = LEVEL if i == 0 else GOOD if level <= before else BAD
        ax.bar(i, abs(level - before), bottom=min(level, before), **style)
        arrow = ""
        if i:
            ax.plot([i - 1.4, i + 0.4], [before, before], color="#333333", linewidth=0.6)
            arrow = "↓ to " if level <= before else "↑ to "
        above: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "va": "bottom"}
        ax.annotate(f"{arrow}{level:.3g}", (i, max(level, before)), (0, 3), **above)
    handles: list[Any] = [Patch(label="start", **LEVEL), Patch(label="taken away", **GOOD)]
    if np.any(np.diff(values) > 0):
        handles.append(Patch(label="added", **BAD))
    if floor is not None and np.isfinite(floor):
        label = f"noise floor, {floor:.3g}"
        handles.append(ax.axhline(floor, color="black", linestyle="--", linewidth=1, label=label))
    # kinds in words, places as they are called
    parts = [[part.partition(" at ") for part in name.split(" and ")] for name in names]
    told = [[f"{k.replace('_', ' ')}\n{at.lstrip()}{of}" for k, at, of in each] for each in parts]
    ax.set_xticks(range(len(names)), ["\nand ".join(each).rstrip() for each in told])
    if len(names) > 3 or max(map(len, names), default=0) > 14:
        plt.setp(ax.get_xticklabels(), rotation=20, ha="right", rotation_mode="anchor")
    ax.set_xlabel("step")
    quantity_axis(ax.yaxis, levels, levels.name or "level")
    ax.margins(y=0.2)  # for the numbers on top of the bars
    # Bars fill the picture: there is no place for names but above it.
    ax.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return ax
