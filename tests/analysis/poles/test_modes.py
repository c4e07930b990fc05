"""Modes: the thesis's frequencies and dampings, tiny damping, sampled systems, the table."""

import control
import numpy as np
import pytest

from robustpolish.linear.modes import modes
from robustpolish.polishing.air_bearing import AirBearingParameters, air_bearing


def test_the_modes_of_the_thesis():
    plant = air_bearing(AirBearingParameters.as_published(), dissipation=0.001)
    found = modes(plant.open_loop)
    assert found.frequencies_hz == pytest.approx(
        [194.0691, 194.0691, 2069.58, 2069.58, 2824.58, 4610.75], rel=2e-6
    )
    expected = [7.93745e-5, 7.93745e-5, 8.17425e-5, 8.17425e-5, 5.78604e-5, 1.99226e-5]
    assert found.damping_ratios == pytest.approx(expected, rel=5e-6)
    names = [mode.state.removeprefix("d") for mode in found]
    assert names == ["x", "y", "x_m", "y_m", "z", "z_m"]


@pytest.mark.parametrize("zeta", [1e-15, 1e-12, 0.3])
@pytest.mark.parametrize("w", [1e-9, 1e9])
def test_any_damping_at_any_frequency(zeta, w):
    w = float(2.0 ** np.round(np.log2(w)))
    G = control.ss([[0, 1], [-w * w, -2 * zeta * w]], [[0], [1]], [[1, 0]], 0)
    (mode,) = modes(G)
    assert mode.damping_ratio == pytest.approx(zeta, rel=1e-12)
    assert mode.natural_frequency_hz == pytest.approx(w / 2 / np.pi, rel=1e-14)
    assert mode.frequency_hz == pytest.approx(w * np.sqrt(1 - zeta**2) / 2 / np.pi, rel=1e-14)


def test_sampled_modes_are_those_of_the_continuous_system():
    G = control.ss([[0, 1], [-100, -2]], [[0], [1]], [[1, 0]], 0)
    (before,), (after,) = modes(G), modes(control.sample_system(G, 0.01))
    assert after.frequency_hz == pytest.approx(before.frequency_hz)
    assert after.damping_ratio == pytest.approx(before.damping_ratio)


def test_real_unstable_and_zero_eigenvalues():
    G = control.ss(np.diag([0.0, 2.0, -3.0]), np.ones((3, 1)), np.ones((1, 3)), 0)
    zero, unstable, stable = modes(G)
    assert np.isnan(zero.damping_ratio)
    assert (unstable.damping_ratio, stable.damping_ratio) == (-1, 1)
    assert (unstable.state, stable.state) == ("x[1]", "x[2]")
    assert unstable.frequency_hz == 0


def test_it_is_a_sequence_and_prints_a_table():
    G = control.ss([[0, 1], [-4, -0.04]], [[0], [1]], [[1, 0]], 0, states=["gap", "rate"])
    found = modes(G)
    assert len(found) == 1
    assert found[0] is found.modes[0]
    assert found[:1] == found.modes
    assert "gap" in repr(found)
    assert "damping" in repr(found)
