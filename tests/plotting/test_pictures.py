"""Each picture shows the data that it was given."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_rgb

from robustpolish import plotting
from robustpolish.plotting.style import LINE_STYLES, MARKER_STYLES


@pytest.fixture(autouse=True)
def close_figures():
    yield
    plt.close("all")


def names(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


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


def test_poles_of_very_different_speed_are_told_apart():
    ax = plotting.plot_poles({"loop": np.array([-1.0, -1e3, -1e6])})
    assert ax.get_xscale() == "symlog"


def test_discrete_poles_come_with_the_unit_circle():
    ax = plotting.plot_poles({"loop": [0.5, 0.9j, -0.9j]}, discrete=True)
    circle = np.array(ax.lines[1].get_data())
    np.testing.assert_allclose(np.hypot(*circle), 1.0)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("real part", "imaginary part")


def test_the_waterfall_falls_from_level_to_level():
    levels = xr.DataArray(
        [0.5, 0.3, 0.02, 0.05], {"step": ["base", "refit", "a_b", "worse"]}, "step", "error of x"
    )
    ax = plotting.plot_waterfall(levels, 0.01)
    edges = [(bar.get_y(), bar.get_y() + bar.get_height()) for bar in ax.patches]
    np.testing.assert_allclose(edges, [(0, 0.5), (0.3, 0.5), (0.02, 0.3), (0.02, 0.05)])
    assert [text.get_text() for text in ax.get_xticklabels()] == ["base", "refit", "a b", "worse"]
    assert names(ax) == ["start", "taken away", "added", "noise floor, 0.01"]
    assert [t.get_text() for t in ax.texts] == ["0.5", "↓ 0.3", "↓ 0.02", "↑ 0.05"]
    assert ax.get_ylabel() == "error of x"


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


def test_a_response_with_its_band():
    time = np.linspace(0, 1, 50)
    measured = xr.DataArray(np.sin(time), {"time": time}, "time", "x", {"units": "m"})
    ax = plotting.plot_response(measured, measured + 1, xr.zeros_like(measured) + 0.1)
    assert names(ax) == ["measured", "simulated", "95 % band"]


def _grey(colour):
    return float(np.dot(to_rgb(colour), (0.299, 0.587, 0.114)))


def test_styles_can_be_told_apart_without_colour():
    lines = [(round(_grey(s["color"]) / 0.25), s["linestyle"]) for s in LINE_STYLES]
    assert len(set(lines)) == len(lines)
    assert len({style["marker"] for style in MARKER_STYLES}) == len(MARKER_STYLES)
