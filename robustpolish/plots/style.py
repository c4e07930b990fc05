"""What all plots share: colours that the colour-blind tell apart, and axes with SI prefixes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeVar

import matplotlib.pyplot as plt
import xarray as xr
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import EngFormatter, Formatter, LogLocator, NullFormatter

from robustpolish.base.results import bears_prefix, prefix_power, prefixed

T = TypeVar("T")

# Okabe and Ito's colours, dark to light, with line styles for a print in grey.
_COLOURS = ["#999999", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#000000", "#56b4e9"]
LINE_STYLES: tuple[dict[str, Any], ...] = tuple(
    cycler(color=_COLOURS[:6], linestyle=["-", "-", "--", "-.", ":", "--"])
)
# The same for points and for areas.
MARKER_STYLES: tuple[dict[str, Any], ...] = tuple(cycler(color=_COLOURS[1:], marker="os^DvP"))
LEVEL: dict[str, Any] = {"facecolor": "#999999", "edgecolor": "#333333"}
GOOD: dict[str, Any] = {"facecolor": "#56b4e9", "edgecolor": "#333333", "hatch": "//"}
BAD: dict[str, Any] = {"facecolor": "#d55e00", "edgecolor": "#333333", "hatch": "xx"}

_FEW_DECADES = 2.0


def new_axes(ax: Axes | None) -> Axes:
    """Return `ax`, or the axes of a new figure.

    Parameters
    ----------
    ax : matplotlib.axes.Axes or None

    Returns
    -------
    matplotlib.axes.Axes
    """
    return plt.subplots(layout="constrained")[1] if ax is None else ax


def si_axis(axis: Axis, name: str, unit: str, power: int | None = None) -> None:
    """Label an axis with its unit, with the SI prefix that suits what is shown, such as [um].

    Units that bear no prefix (none at all, %, 1/s, m^2, kg) stay as they are. The label follows
    when the limits change, unless it was changed by hand.

    Parameters
    ----------
    axis : matplotlib.axis.Axis
    name, unit : str
    power : int, optional
        The prefix's power of ten, where several axes share one; otherwise it follows the limits.
    """
    if bears_prefix(unit):
        axis.set_major_formatter(_Prefixed(axis, name, unit, power))
    else:
        axis.set_label_text(_label(name, unit))


class _Prefixed(Formatter):
    """Plain numbers at the ticks; the prefix that they share goes into the label."""

    def __init__(self, axis: Axis, name: str, unit: str, power: int | None) -> None:
        self.set_axis(axis)
        self._name, self._unit, self._power = name, unit, power
        self._written: str | None = None
        self._exponent()

    def __call__(self, x: float, pos: int | None = None) -> str:
        return self.fix_minus(f"{x / 10 ** self._exponent():.{self._digits()}g}")

    def format_data_short(self, value: float) -> str:
        return EngFormatter(unit=self._unit)(value)

    def _digits(self) -> int:
        """Return how many digits tell the ticks apart."""
        axis: Any = self.axis
        low, high = sorted(axis.get_view_interval())
        largest = max(abs(low), abs(high))
        needed = math.log10(largest / (high - low)) + 3 if low < high else 0
        return min(max(6, math.ceil(needed)), 15)

    def _exponent(self) -> int:
        """Return the exponent that suits the axis's limits, and write it into the label."""
        axis: Any = self.axis
        power = self._power
        if power is None:
            power = prefix_power(max(abs(limit) for limit in axis.get_view_interval()))
        if self._written is None or axis.get_label_text() == self._written:
            self._written = _label(self._name, prefixed(self._unit, power))
            axis.set_label_text(self._written)
        return power


def _label(name: str, unit: str) -> str:
    return name if unit in ("", "1") else f"{name} [{unit}]".lstrip()


def log_axis(ax: Axes, which: str, name: str, unit: str) -> None:
    """Make an axis logarithmic; its ticks carry unit and SI prefix. Call it when data is drawn.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    which : {"x", "y"}
    name, unit : str
        As for :func:`si_axis`.
    """
    axis = ax.xaxis if which == "x" else ax.yaxis
    (ax.set_xscale if which == "x" else ax.set_yscale)("log")
    low, high = ax.get_xlim() if which == "x" else ax.get_ylim()
    if math.log10(high / low) <= _FEW_DECADES:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    elif which == "x":
        axis.set_major_locator(LogLocator(numticks=6))  # "100 kHz" needs room
    if bears_prefix(unit):
        axis.set_major_formatter(EngFormatter(unit=unit))
        axis.set_label_text(name)
    else:
        axis.set_major_formatter(lambda value, _: f"{value:.3g}")
        axis.set_label_text(_label(name, unit))
    axis.set_minor_formatter(NullFormatter())


def legend(ax: Axes, least: int = 2) -> None:
    """Add a legend where at least so many things have a name."""
    if len(ax.get_legend_handles_labels()[0]) >= least:
        ax.legend(loc="best")


def quantity_axis(axis: Axis, shown: xr.DataArray, name: object = None) -> None:
    """Label an axis with the name and the unit of a labelled array; see :func:`si_axis`.

    Parameters
    ----------
    axis : matplotlib.axis.Axis
    shown : xarray.DataArray
    name : str, optional
        That of the array by default.
    """
    si_axis(axis, str(name or shown.name or ""), str(shown.attrs.get("units", "")))


def in_styles(
    curves: Mapping[Any, T], first: int = 1, styles: Sequence[dict[str, Any]] = LINE_STYLES
) -> Iterator[tuple[dict[str, Any], str, T]]:
    """Yield style, label and curve of each of several, the styles beginning with the `first`.

    Parameters
    ----------
    curves : mapping of str to anything
    first : int, optional
    styles : sequence of dict, optional

    Yields
    ------
    style : dict
    label : str
    curve
    """
    for i, (label, curve) in enumerate(curves.items(), first):
        yield {**styles[i % len(styles)]}, str(label), curve
