"""Pictures of a residual: shares, tests, surfaces."""

import numpy as np
import pytest
import xarray as xr

from robustpolish import plots as plotting
from tests.plotting.legends import names


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
    ax.figure.canvas.draw()
    assert not ax.get_legend().get_window_extent().overlaps(ax.get_window_extent())  # off the map


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


def test_coherence_is_shown_against_chance():
    frequency = np.array([0.0, 10.0, 100.0])
    coherence = xr.DataArray([1.0, 0.5, 0.2], {"frequency": frequency}, "frequency")
    ax = plotting.plot_coherence(coherence, 0.3)
    np.testing.assert_array_equal(ax.lines[0].get_data(), [[10.0, 100.0], [0.5, 0.2]])
    assert ax.lines[1].get_ydata()[0] == 0.3
    assert names(ax) == ["coherence", "chance"]
