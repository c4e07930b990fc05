"""What plots show of labelled data."""

from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_rgb

from robustpolish import plots as plotting
from robustpolish.plots.charts import (
    plot_distribution,
    plot_error_bars,
    plot_over_plane,
    plot_path_in_space,
)
from robustpolish.plots.frequency import plot_bode, plot_nichols, plot_nyquist_disks
from robustpolish.plots.poles import plot_campbell, plot_whirl_shapes
from robustpolish.plots.residuals import plot_force_curve
from robustpolish.plots.style import LINE_STYLES, MARKER_STYLES, log_axis, si_axis
from robustpolish.plots.time import (
    plot_before_and_after,
    plot_distances,
    plot_panels,
    plot_time_series,
    plot_two_machines,
)
from tests.plotting.legends import names

# Axes carry names and units with SI prefixes, and follow what is shown.


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


@pytest.fixture
def ax():
    return plt.subplots()[1]


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


def test_logarithmic_axes_have_the_unit_at_their_ticks(ax):
    ax.plot([3, 4e4], [1e-9, 1e-3])
    log_axis(ax, "x", "frequency", "Hz")
    log_axis(ax, "y", "gain", "m/N")
    assert {"10 Hz", "1 kHz"} <= set(ticks(ax.xaxis))
    assert "1 nm/N" in ticks(ax.yaxis)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("frequency", "gain")


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


# Bars of good and bad numbers.


def test_bars_mark_the_bad():
    where = {"mode": ["a", "b"]}
    ax = plotting.plot_bars(
        xr.DataArray([0.5, 1e-9], where, "mode", "distance"),
        xr.DataArray([False, True], where, "mode"),
        meaning=("seen", "unseen"),
    )
    assert sorted(bar.get_width() for bar in ax.patches) == [1e-9, 0.5]
    assert names(ax) == ["seen", "unseen"]
    assert [text.get_text() for text in ax.get_yticklabels()] == ["a", "b"]
    assert ax.get_xlabel() == "distance"


# Histograms with reference values.


def test_every_value_is_counted_and_the_marks_stand_where_they_are():
    values = xr.DataArray(np.linspace(1e-6, 3e-6, 80), dims="machine", name="norm")
    values.attrs["units"] = "m/N"
    ax = plot_distribution(values, {"certificate": 2e-6, "limit": 4e-6}, note="2 left out")
    heights = [bar.get_height() for bar in ax.patches]
    assert (len(heights), sum(heights)) == (10, 80)
    assert [line.get_xdata()[0] for line in ax.lines] == [2e-6, 4e-6]
    assert names(ax) == ["certificate", "limit"]
    assert ax.get_xlabel() == "norm [µm/N]"
    assert ax.get_ylabel() == "number per bin (machine)"
    assert ax.get_title() == "2 left out"


def test_ticks_of_values_that_hardly_scatter_are_told_apart():
    values = xr.DataArray(1.00002e-4 + 2e-11 * np.linspace(0, 1, 60), dims="machine", name="norm")
    values.attrs["units"] = "m/N"
    ax = plot_distribution(values)
    ax.figure.canvas.draw()
    labels = [label for label in ax.get_xticklabels() if label.get_text()]
    assert len({label.get_text() for label in labels}) == len(labels)
    boxes = [label.get_window_extent() for label in labels]
    assert all(a.x1 < b.x0 for a, b in pairwise(boxes))
    assert all(tick == round(tick) for tick in ax.get_yticks())


# Values with bars over a positive quantity.


def test_values_and_bars_stand_where_they_belong():
    level = np.array([0.1, 1.0, 10.0])
    curve = xr.DataArray(
        [1.0, 2.0, 4.0], {"level": level, "bar": ("level", [0.1, 0.2, 0.3])}, "level"
    )
    ax = plot_error_bars({"first": curve, "second": 2 * curve}, "change", "%", over="level")
    assert (ax.get_xscale(), ax.get_xlabel(), ax.get_ylabel()) == ("log", "level", "change [%]")
    line, _, bars = ax.containers[0].lines
    np.testing.assert_allclose(line.get_ydata(), [1, 2, 4])
    np.testing.assert_allclose(bars[0].get_segments()[2][:, 1], [3.7, 4.3])
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["first", "second"]


# Norm over gain, a marker per controller.


def test_gain_against_norm_names_every_controller():
    points = xr.Dataset(
        {
            "gain": ("controller", [1.0, 1e3, np.nan], {"long_name": "gain"}),
            "norm": ("controller", [2e-6, 1e-6, np.nan], {"long_name": "norm", "units": "m/N"}),
        },
        {"controller": ["a", "b", "failed"]},
    )
    ax = plotting.plot_gain_against_norm(points)
    assert names(ax) == ["a", "b"]
    np.testing.assert_allclose([np.ravel(line.get_data()) for line in ax.lines],
                               [(1.0, 2e-6), (1e3, 1e-6)])  # fmt: skip
    assert ax.get_xscale() == "log"
    assert ax.get_ylabel() == "norm [µm/N]"


# A waterfall falls from level to level.


def test_the_waterfall_falls_from_level_to_level():
    levels = xr.DataArray(
        [0.5, 0.3, 0.02, 0.05], {"step": ["base", "refit", "a_b", "worse"]}, "step", "error of x"
    )
    ax = plotting.plot_waterfall(levels, 0.01)
    edges = [(bar.get_y(), bar.get_y() + bar.get_height()) for bar in ax.patches]
    np.testing.assert_allclose(edges, [(0, 0.5), (0.3, 0.5), (0.02, 0.3), (0.02, 0.05)])
    assert [text.get_text() for text in ax.get_xticklabels()] == ["base", "refit", "a b", "worse"]
    assert names(ax) == ["start", "taken away", "added", "noise floor, 0.01"]
    assert [t.get_text() for t in ax.texts] == ["0.5", "↓ to 0.3", "↓ to 0.02", "↑ to 0.05"]
    assert ax.get_ylabel() == "error of x"
    ax.figure.canvas.draw()
    assert ax.get_legend().get_window_extent().y0 >= ax.get_window_extent().y1 - 1  # off the bars


X, Y = np.linspace(0, 0.03, 7), np.linspace(0, 0.02, 5)
MAP = xr.DataArray(np.add.outer(X, Y), {"x": X, "y": Y}, ("x", "y"), "depth", {"units": "m"})


def test_a_map_has_its_axes_and_its_line():
    ax = plot_over_plane(MAP, level=0.02)
    assert (ax.get_xlabel(), ax.get_ylabel(), len(ax.collections)) == ("x [mm]", "y [mm]", 2)
    np.testing.assert_allclose(ax.collections[0].get_array().ravel(), MAP.values.T.ravel())


def test_a_path_stands_in_space_in_millimetres():
    time = np.linspace(0, 1, 11)
    place = tuple(xr.DataArray(0.01 * time, dims="time") for _ in range(3))
    colour = xr.DataArray(time, dims="time", name="force", attrs={"units": "N"})
    ax = plot_path_in_space(MAP, place, colour)
    _, line = ax.collections
    assert len(line.get_array()) == 10


# Long records keep their peaks when they are drawn.


def test_a_single_peak_survives_the_reduction():
    values = np.zeros(100_001)
    values[54_321] = 7.0
    values[-1] = -3.0
    time = {"time": np.arange(values.size) / 2e4}
    signal = xr.DataArray(values, time, "time", "y", {"units": "m"})
    axes = plot_time_series({"y": signal})
    time, drawn = axes.lines[0].get_data()
    assert drawn.size < 6000
    assert drawn.max() == 7.0
    assert drawn[-1] == -3.0
    assert time[np.argmax(drawn)] == 54_321 / 2e4
    assert (np.diff(time) > 0).all()
    assert axes.get_legend() is None


# Signals before and after, one panel each.


def test_every_signal_has_a_panel_and_every_response_its_line():
    time = np.linspace(0, 1, 20)
    before = xr.Dataset(
        {n: ("time", np.full(20, v), {"units": "m"}) for n, v in (("x", 2.0), ("y", 3.0))},
        {"time": time},
    )
    after = before[["x"]] / 2  # it has no y
    figure = plot_panels({"before": before, "after": after}, ("x", "y"), 6.0)
    top, bottom = figure.axes
    np.testing.assert_array_equal([line.get_ydata()[0] for line in top.lines], [2.0, 1.0])
    np.testing.assert_array_equal([line.get_ydata()[0] for line in bottom.lines], [3.0])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["before", "after"]
    assert names(top) == names(bottom) == []  # told once, off the data
    assert (top.get_xlabel(), bottom.get_xlabel()) == ("", "time [s]")
    assert figure.get_size_inches()[0] == 6.0


def test_quick_oscillations_become_bands_with_a_closer_look():
    time = np.linspace(0, 2, 20_001)
    quick = np.sin(2 * np.pi * 500 * time) * 3e-5
    data = xr.Dataset(
        {n: ("time", v, {"units": "m"}) for n, v in (("x", quick), ("y", 1e-7 * time))},
        {"time": time},
    )
    figure = plot_panels({"loop": data}, ("x", "y"))
    whole, closer, below, _ = figure.axes
    edges = [line.get_ydata() for line in whole.lines]
    assert len(whole.collections) == 1
    np.testing.assert_allclose(edges[0], -3e-5, rtol=0.01)
    np.testing.assert_allclose(edges[1], 3e-5, rtol=0.01)
    shown = closer.lines[0].get_xdata()
    assert np.ptp(shown) == pytest.approx(0.012, rel=0.02)  # six periods
    assert not closer.collections
    assert not below.collections  # a ramp is not quick
    assert [ax.get_ylabel() for ax in (whole, closer, below)] == ["x [µm]", "", "y [µm]"]


TIME = np.arange(100) / 10


def wave(size, unit="m", shape=np.sin):
    return xr.DataArray(size * shape(TIME), {"time": TIME}, "time", "x", {"units": unit})


def test_what_each_model_leaves_stands_below_it():
    above, below = plot_before_and_after(wave(1.0), wave(0.5), wave(0.9)).axes
    sizes = [np.abs(np.asarray(line.get_ydata())).max() for line in above.lines]
    top = np.abs(np.sin(TIME)).max()
    assert sizes == pytest.approx([top, 0.5 * top, 0.9 * top])
    rest = [np.abs(np.asarray(line.get_ydata())).max() for line in below.lines]
    assert rest == pytest.approx([0.5 * top, 0.1 * top])
    # one model looks the same in every panel
    colours = [
        {str(line.get_label()): line.get_color() for line in ax.lines} for ax in (above, below)
    ]
    assert colours[1].items() <= colours[0].items()
    assert below.get_ylabel() == "residual [mm]"


def test_a_stretch_is_shown_large_and_marked_in_the_whole():
    figure = plot_before_and_after(wave(1.0), None, wave(0.9), slice(2.0, 4.0), width=6.0)
    above, below, whole = figure.axes
    for ax in (above, below):
        times = np.asarray(ax.lines[0].get_xdata())
        assert (times[0], times[-1]) == pytest.approx((2.0, 4.0))
    assert len(whole.lines[0].get_xdata()) == 100
    assert whole.patches[0].get_x() == 2.0
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["measured", "after"]
    assert [ax.get_legend() for ax in figure.axes] == [None] * 3
    assert figure.get_size_inches()[0] == 6.0


# Measured and simulated signals, what is left over, and their spectra.


def test_the_spectrum_peaks_at_the_frequency_of_the_signal():
    time = np.arange(4096) / 1024
    values = 3.0 * np.sin(2 * np.pi * 64 * time)
    values[5] = np.nan  # left out, not drawn
    signal = xr.DataArray(values, {"time": time}, "time", "x", {"units": "V"})
    short = signal[:4]  # too short for a spectrum
    ax = plotting.plot_spectra({"signal": signal, "short": short}, plotting.new_axes(None))
    (line,) = ax.lines
    frequency, density = line.get_data()
    assert frequency[np.argmax(density)] == pytest.approx(64, abs=0.5)
    assert ax.get_ylabel() == "amplitude density [V/sqrt(Hz)]"


def test_every_signal_has_overlay_residual_and_spectra():
    time = np.arange(100) / 100
    measured = xr.Dataset({"x": ("time", np.sin(time), {"units": "m"})}, {"time": time})
    figure = plotting.plot_overlay(measured, measured * 0.75)
    overlay, rest, spectra = figure.axes
    assert [ax.get_title() for ax in figure.axes] == ["x", "residual", "spectra"]
    assert names(overlay) == ["measured", "simulated"]
    np.testing.assert_allclose(rest.lines[0].get_ydata(), 0.25 * np.sin(time))
    assert names(spectra) == ["measured", "residual"]


def test_the_difference_stands_against_the_noise():
    runs = [wave(size, shape=np.cos) for size in (1.0, 0.5, 0.9)]
    drive = wave(3.0, "N", np.cos)
    drive, both, apart = plot_two_machines(drive, runs, ("one", "other"), 0.02).axes
    assert np.asarray(drive.lines[0].get_ydata())[0] == pytest.approx(3.0)
    assert [str(line.get_label()) for line in both.lines] == ["one", "other"]
    assert [line.get_ydata()[0] for line in apart.lines] == pytest.approx([0.5, 0.1])
    (band,) = apart.patches
    assert (band.get_y(), band.get_height()) == pytest.approx((-0.04, 0.08))
    assert len(plot_two_machines(None, runs, ("one", "other"), 0.02).axes) == 2


def test_bars_show_what_tells_and_what_does_not():
    ratios = xr.DataArray([5.0, 0.2, 0.0], {"experiment": list("abc")}, name="over noise")
    ax = plot_distances(ratios, 0.75)
    told, not_told, nothing = ax.patches
    assert [bar.get_width() for bar in ax.patches] == pytest.approx([5.0, 0.2, 1e-3])
    assert told.get_facecolor() != not_told.get_facecolor() == nothing.get_facecolor()
    assert ax.lines[0].get_xdata()[0] == 0.75
    assert [label.get_text() for label in ax.get_yticklabels()] == list("abc")
    assert ax.get_xscale() == "log"


FORCE = xr.DataArray(
    np.linspace(-5.0, 5.0, 11),
    {"velocity": ("velocity", np.linspace(-0.02, 0.02, 11), {"units": "m/s"})},
    "velocity",
    attrs={"units": "N"},
)


def test_an_endless_band_does_not_flatten_the_curve():
    band = xr.full_like(FORCE, np.inf)
    low, high = plot_force_curve(FORCE, band).get_ylim()
    assert -20 < low < -5
    assert 5 < high < 20


# A residual over time and frequency.


def test_the_residual_map_is_bright_where_the_residual_is():
    time = np.arange(8000) / 2000.0
    values = 1e-3 * np.sin(2 * np.pi * 200 * time) * (time > 3)
    values += 1e-9 * np.random.default_rng(0).standard_normal(time.size)
    residual = xr.DataArray(values, {"time": time}, "time", "a", {"units": "m"})
    ax = plotting.plot_residual_map(residual, {"mode": [200.0, 5e4]})
    mesh = ax.collections[0]
    density = mesh.get_array()
    row, column = np.unravel_index(np.argmax(density), density.shape)
    corners = mesh.get_coordinates()[row : row + 2, column : column + 2]
    assert corners[..., 0].min() > 2.9
    assert corners[..., 1].min() <= 200 <= corners[..., 1].max()
    assert names(ax) == ["mode"]
    assert ax.lines[0].get_ydata()[0] == 200
    assert ax.get_xlabel() == "time [s]"
    bar = ax.figure.axes[1]
    assert bar.get_ylabel() == "amplitude density [m/sqrt(Hz)]"


# Pictures of a residual: shares, tests, surfaces.


def test_the_surface_has_units_and_a_line_where_the_force_turns():
    shown = xr.Dataset(
        {"force": (("displacement", "velocity"), np.outer([-2.0, 0.0, 2.0], [1.0, 1.0]))},
        {"displacement": [-1e-3, 0.0, 1e-3], "velocity": [-0.1, 0.1]},
    )
    for name, unit in (("force", "N"), ("displacement", "m"), ("velocity", "m/s")):
        shown[name].attrs["units"] = unit
    ax = plotting.plot_surface(shown)
    np.testing.assert_array_equal(ax.collections[0].get_array(), shown["force"].values.T)
    assert len(ax.collections) == 2
    assert ax.get_xlabel() == "displacement [mm]"
    assert ax.get_ylabel() == "velocity [mm/s]"
    assert ax.figure.axes[1].get_ylabel() == "force [N]"
    assert names(ax) == ["no force"]


def test_the_line_of_a_surface_ignores_cells_that_few_samples_visited():
    force = np.outer(np.linspace(-2.0, 2.0, 8), np.ones(6))
    samples = np.ones((8, 6))
    force[6, 3], samples[6, 3] = -9.0, 0.01  # one wild sample far from where the force turns
    force[0, 0] = np.nan
    dims = ("displacement", "velocity")
    axes = {"displacement": np.linspace(-1, 1, 8), "velocity": np.linspace(-1, 1, 6)}
    shown = xr.Dataset({"force": (dims, force)}, axes)
    x = {}
    for name, told in (("raw", shown), ("smooth", shown.assign(samples=(dims, samples)))):
        line = plotting.plot_surface(told).collections[1]
        x[name] = np.concatenate([path.vertices[:, 0] for path in line.get_paths()])
    assert x["raw"].max() > 0.4
    assert np.abs(x["smooth"]).max() < 0.1


def test_shares_stand_where_they_belong():
    where = {"begin": ("window", [0.0, 0.5]), "end": ("window", [0.5, 2.0])}
    ax = plotting.plot_window_shares(xr.DataArray([0.25, 0.75], where, "window"))
    edges = [(bar.get_x(), bar.get_x() + bar.get_width(), bar.get_height()) for bar in ax.patches]
    assert edges == [(0.0, 0.5, 25.0), (0.5, 2.0, 75.0)]
    where = {"low": ("band", [0.0, 10.0]), "high": ("band", [10.0, 100.0])}
    ax = plotting.plot_band_shares(xr.DataArray([0.4, 0.6], where, "band"), {"mode": [20.0, 30.0]})
    edges = [(bar.get_x(), bar.get_x() + bar.get_width(), bar.get_height()) for bar in ax.patches]
    assert edges == [(5.0, 10.0, 40.0), (10.0, 100.0, 60.0)]  # a logarithm knows no zero
    assert [line.get_xdata()[0] for line in ax.lines] == [20.0, 30.0]
    assert names(ax) == ["mode"]


def test_a_correlation_shows_the_smallest_lags_with_their_band():
    lag = np.arange(-300, 301) * 1e-3
    value = xr.DataArray(np.cos(lag), {"lag": lag}, "lag")
    ax = plotting.plot_correlation(value, xr.full_like(value, 0.1))
    drawn, values = ax.lines[0].get_data()
    assert drawn.size == 400
    assert abs(drawn).max() == pytest.approx(0.2)
    np.testing.assert_allclose(values, np.cos(drawn))
    band = ax.collections[0].get_paths()[0].vertices[:, 1]
    assert (band.min(), band.max()) == (-0.1, 0.1)


# Complex responses drawn over frequency and in the plane.


LINES = np.linspace(1.0, 10.0, 50)
RESPONSE = xr.DataArray(1 / (25.0 - LINES**2 + 0.5j * LINES), {"frequency": LINES}, "frequency")


def test_magnitude_stands_above_phase():
    spread = xr.full_like(RESPONSE.real, 1e-3)
    ax = plot_bode({"measured": RESPONSE}, name="magnitude", unit="m/N", spread=spread)
    upper, lower = ax.figure.axes
    assert upper is ax
    assert (upper.get_xscale(), upper.get_yscale()) == ("log", "log")
    assert lower.get_ylabel() == "phase [deg]"
    np.testing.assert_allclose(upper.lines[0].get_ydata(), np.abs(RESPONSE))
    phase = lower.lines[0].get_ydata()
    assert -180 <= np.nanmin(phase) < -170
    assert len(upper.lines) == 2


def test_jumps_of_a_turn_are_gaps():
    turning = xr.DataArray(np.exp(-1j * LINES), {"frequency": LINES}, "frequency")
    ax = plot_bode({"x": turning})
    assert np.isnan(ax.figure.axes[1].lines[0].get_ydata()).sum() == 2  # at pi and 3 pi


# Gains over frequency show the data that they were given.


def test_gains_with_the_norm_marked():
    frequency = np.geomspace(1, 1e3, 50)
    gain = xr.DataArray(
        1e-6 / frequency, {"frequency": frequency}, "frequency", attrs={"units": "m/N"}
    )
    ax = plotting.plot_gains({"loop": gain}, {"norm": (10.0, 1e-7), "level": (np.nan, 1e-8)})
    np.testing.assert_allclose(ax.lines[0].get_data(), [frequency, gain])
    np.testing.assert_allclose(np.ravel(ax.lines[1].get_data()), [10.0, 1e-7])
    assert names(ax) == ["loop", "norm", "level"]
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert ax.yaxis.get_major_formatter()(1e-6) == "1 µm/N"


# Loops around -1, in the plane and in Nichols's.


OMEGA = np.geomspace(0.01, 100, 400)
VALUES = 1 / (1j * OMEGA * (1j * OMEGA + 1))
LOOP = {"u": xr.DataArray(VALUES, {"frequency": OMEGA}, "frequency")}


def test_the_disk_lies_around_the_critical_point():
    ax = plot_nyquist_disks(LOOP, {"u": 0.5})
    corners = ax.patches[0].get_xy()
    real = corners[:, 0]
    assert (real.min(), real.max()) == (pytest.approx(-1 / 0.6), pytest.approx(-0.6))
    assert ax.get_aspect() == 1.0
    assert ax.get_xlim()[0] < -1.5  # the critical point is seen, the integrator's end is not
    assert ax.get_ylim()[0] > -10
    for disks in (None, {"v": 0.5}, {"u": 2.0}):  # of another loop, and a half plane
        assert not plot_nyquist_disks(LOOP, disks).patches


def test_nichols_shows_gain_over_phase():
    ax = plot_nichols(LOOP, {"u": 0.5})
    phase, gain = ax.lines[0].get_xdata(), ax.lines[0].get_ydata()
    np.testing.assert_allclose(gain, 20 * np.log10(np.abs(VALUES)))
    np.testing.assert_allclose(phase, -90 - np.degrees(np.arctan(OMEGA)))
    corners = ax.patches[0].get_xy()
    assert corners[:, 1].max() == pytest.approx(20 * np.log10(1 / 0.6))
    np.testing.assert_allclose(ax.lines[1].get_xdata(), [-180])


# Poles in the plane, with what is forbidden.


def test_poles_in_hertz_with_the_forbidden_hatched():
    poles = np.array([-10 + 200j, -10 - 200j, -30])
    half_plane = ([[40.0]], [[1.0]])  # real part below -20
    ax = plotting.plot_poles({"loop": poles}, {"too slow": half_plane})
    x, y = ax.lines[0].get_data()
    np.testing.assert_allclose(x, poles.real)
    np.testing.assert_allclose(y, poles.imag / (2 * np.pi))
    assert ax.get_xlabel() == "real part [1/s]"
    assert ax.get_ylabel() == "frequency [Hz]"
    assert "too slow" in names(ax)
    hatched, boundary = ax.collections
    assert hatched.hatches
    line = np.concatenate([path.vertices for path in boundary.get_paths()])
    np.testing.assert_allclose(line[:, 0], -20, atol=0.1)


def test_what_is_forbidden_is_hatched_up_to_new_limits():
    ax = plotting.plot_poles({"loop": [-100.0, -30.0 + 5j]}, {"slow": ([[40.0]], [[1.0]])})
    ax.set_xlim(-500.0, 700.0)
    ax.set_ylim(-90.0, 90.0)
    assert (ax.get_xlim(), ax.get_ylim()) == ((-500.0, 700.0), (-90.0, 90.0))
    hatched = next(drawn for drawn in ax.collections if drawn.hatches)
    ends = hatched.get_paths()[0].vertices
    np.testing.assert_allclose(ends.max(axis=0), (700.0, 90.0))
    np.testing.assert_allclose(ends.min(axis=0), (-20.0, -90.0), atol=1.0)
    assert len(ax.collections) == 2


def test_poles_of_very_different_speed_are_told_apart():
    ax = plotting.plot_poles({"loop": np.array([-1.0, -1e3, -1e6])})
    assert ax.get_xscale() == "symlog"
    # poles of 0.58/s put no tick where another stands
    ax = plotting.plot_poles({"loop": np.array([-0.58, -1e3, -1e6])})
    places = ax.transData.transform([(x, 0.0) for x in ax.get_xticks() if x <= 0])[:, 0]
    assert np.diff(np.sort(places)).min() > 30
    ax.figure.canvas.draw()
    labels = [label.get_text() for label in ax.get_xticklabels()]
    assert {"0", "\N{MINUS SIGN}1", "\N{MINUS SIGN}1000", "$-10^{5}$"} <= set(labels)


def test_double_poles_that_rounding_splits_do_not_spread_the_axis():
    real = np.array([-201 + 1e-6j, -201 - 1e-6j])
    ax = plotting.plot_poles({"loop": np.array([*real, -5e3 + 4e4j, -5e3 - 4e4j])})
    assert ax.get_yscale() == "linear"


def test_discrete_poles_come_with_the_unit_circle():
    ax = plotting.plot_poles({"loop": [0.5, 0.9j, -0.9j]}, discrete=True)
    circle = np.array(ax.lines[1].get_data())
    np.testing.assert_allclose(np.hypot(*circle), 1.0)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("real part", "imaginary part")


SPEEDS = np.array([0.0, 100.0, 200.0])
HZ = np.array([[10.0, 10.0, 5.0], [9.0, 11.0, 5.0], [8.0, 12.0, 5.0]])
WHIRL = np.array([[0.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])


def test_curves_are_drawn_by_their_way_round():
    ax = plot_campbell(SPEEDS, HZ, WHIRL, critical=[60.0])
    assert [line.get_linestyle() for line in ax.lines[:3]] == ["--", "-", "-."]
    np.testing.assert_allclose(ax.lines[1].get_xdata(), SPEEDS * 30 / np.pi)
    np.testing.assert_allclose(ax.lines[1].get_ydata(), HZ[:, 1])
    spin, marks = ax.lines[3], ax.lines[4]
    np.testing.assert_allclose(spin.get_ydata(), SPEEDS / (2 * np.pi))
    np.testing.assert_allclose(marks.get_ydata(), 60.0 / (2 * np.pi))
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["forward", "backward", "neither", "once per turn", "critical speed"]
    assert ax.get_xlabel() == "speed [rev/min]"
    assert ax.get_ylabel() == "whirl frequency [Hz]"


def test_the_larger_axis_is_drawn_at_its_largest():
    nodes = np.array([0.0, 0.5, 1.0])
    x, y = np.array([0.0, -1j, -2j]), np.array([0.0, 0.1, 0.1])
    ax = plot_whirl_shapes(nodes, {"in x": np.array([x, y]), "in y": np.array([y, x])})
    for line in ax.lines[:2]:
        np.testing.assert_allclose(line.get_ydata(), [0.0, 0.5, 1.0], atol=1e-15)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["in x", "in y"]
    assert ax.get_xlabel() == "along the shaft [m]"
