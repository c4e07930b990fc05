"""Axes carry names and units with SI prefixes, and follow what is shown."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgb

from robustpolish.plots.style import LINE_STYLES, MARKER_STYLES, log_axis, si_axis


@pytest.fixture
def ax():
    figure, ax = plt.subplots()
    yield ax
    plt.close(figure)


def ticks(axis):
    axis.figure.canvas.draw()
    return [label.get_text() for label in axis.get_ticklabels()]


def test_the_label_carries_unit_and_prefix(ax):
    ax.plot([0, 0.03], [0, 2.1e-5])
    si_axis(ax.xaxis, "time", "s")
    si_axis(ax.yaxis, "y", "m")
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time [ms]", "y [µm]")
    assert "20" in ticks(ax.yaxis)
    assert ax.yaxis.get_major_formatter().format_data_short(2.1e-5) == "21 µm"


def test_the_label_follows_the_limits_unless_changed_by_hand(ax):
    ax.plot([0, 1], [0, 1e-5])
    si_axis(ax.yaxis, "y", "m")
    ax.set_ylim(0, 5)
    assert "5" in ticks(ax.yaxis)
    assert ax.get_ylabel() == "y [m]"
    ax.set_ylabel("deviation")
    ax.set_ylim(0, 5e-9)
    assert "5" in ticks(ax.yaxis)
    assert ax.get_ylabel() == "deviation"


@pytest.mark.parametrize(
    ("unit", "label"),
    [("", "a"), ("1", "a"), ("%", "a [%]"), ("1/s", "a [1/s]"), ("m^2", "a [m^2]"),
     ("kg", "a [kg]"), ("deg", "a [deg]")],
)  # fmt: skip
def test_units_that_bear_no_prefix_stay(ax, unit, label):
    ax.plot([0, 1], [0, 2e-5])
    si_axis(ax.yaxis, "a", unit)
    assert ax.get_ylabel() == label


@pytest.mark.parametrize(("unit", "label"), [("N/m", "k [kN/m]"), ("N m", "k [kN m]")])
def test_compound_units_take_a_prefix(ax, unit, label):
    ax.plot([0, 1], [0, 3e4])
    si_axis(ax.yaxis, "k", unit)
    assert ax.get_ylabel() == label


def test_logarithmic_axes_have_the_unit_at_their_ticks(ax):
    ax.plot([3, 4e4], [1e-9, 1e-3])
    log_axis(ax, "x", "frequency", "Hz")
    log_axis(ax, "y", "gain", "m/N")
    assert {"10 Hz", "1 kHz"} <= set(ticks(ax.xaxis))
    assert "1 nm/N" in ticks(ax.yaxis)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("frequency", "gain")


def test_a_short_logarithmic_axis_has_ticks_too(ax):
    ax.plot([1.1, 4.5], [1, 1])
    log_axis(ax, "x", "frequency", "Hz")
    assert "2 Hz" in ticks(ax.xaxis)


def _grey(colour):
    return float(np.dot(to_rgb(colour), (0.299, 0.587, 0.114)))


def test_styles_can_be_told_apart_without_colour():
    lines = [(round(_grey(s["color"]) / 0.25), s["linestyle"]) for s in LINE_STYLES]
    assert len(set(lines)) == len(lines)
    assert len({style["marker"] for style in MARKER_STYLES}) == len(MARKER_STYLES)


def test_a_logarithm_of_little_more_than_a_decade_has_ticks_enough(ax):
    ax.plot([2.0, 50.0], [1.0, 2.0])
    log_axis(ax, "x", "frequency", "Hz")
    low, high = ax.get_xlim()
    inside = [t for t in ax.get_xticks() if low <= t <= high]
    assert inside == [2.0, 5.0, 10.0, 20.0, 50.0]
    assert {"2 Hz", "50 Hz"} <= set(ticks(ax.xaxis))
