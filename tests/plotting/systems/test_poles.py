"""Poles in the plane, with what is forbidden."""

import numpy as np

from robustpolish import plots as plotting
from tests.plotting.legends import names


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
