"""Prescaling: accuracy gained, the same system, the thesis's matrices matched or beaten."""

import control
import mpmath as mp
import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.linear.scaling import prescale
from robustpolish.polishing.air_bearing import AirBearingParameters, air_bearing

THESIS_SECOND = [4096, 0.125, 1024, 1, 4096, 0.125, 1024, 0.5, 8192, 0.125, 4096, 0.25]


def bearing():
    plant = air_bearing(AirBearingParameters.as_published(), actuation="force")
    return control.StateSpace(plant.A, plant.B2, plant.C1, 0 * plant.C1 @ plant.B2)


def test_the_thesis_plant_gains_six_digits():
    result = prescale(bearing())
    assert result.accuracy_after.max() < 1e-6 * result.accuracy_before.max()
    ours = np.log2(np.diag(result.left))
    shift = np.median(ours - np.log2(THESIS_SECOND))  # a common factor changes nothing
    assert abs(ours - shift - np.log2(THESIS_SECOND)).max() <= 1


def test_left_and_right_map_the_matrices():
    G = bearing()
    result = prescale(G)
    assert np.array_equal(result.left @ result.right, np.eye(12))
    assert np.array_equal(result.system.A, result.left @ G.A @ result.right)
    assert np.array_equal(result.system.B, result.left @ G.B)
    assert np.array_equal(result.system.C, G.C @ result.right)
    gain = np.ones((2, 12))
    assert np.array_equal(result.state_gain(gain), gain @ np.linalg.inv(result.right))


def test_the_estimate_bounds_the_true_error():
    """Rotate the states before and after scaling; compare responses with exact ones."""
    rng = np.random.default_rng(0)
    G = control.ss([[0, 1], [-1e10, -100]], [[0], [1]], [[1, 0]], 0)
    result = prescale(G, band=(1e4, 1e6))
    Q = np.linalg.qr(rng.standard_normal((2, 2)))[0]

    def error(system, w):
        A, B, C = Q @ system.A @ Q.T, Q @ system.B, system.C @ Q.T
        rough = (C @ np.linalg.solve(1j * w * np.eye(2) - A, B))[0, 0]
        exact = 1 / (mp.mpc(1e10, 100 * w) - mp.mpf(w) ** 2)
        return float(abs(mp.mpc(rough) / exact - 1))

    before = [error(G, w) for w in result.frequency]
    after = [error(result.system, w) for w in result.frequency]
    assert max(after) < 1e-3 * max(before)
    assert all(np.array(before) < 10 * result.accuracy_before)
    assert all(np.array(after) < 10 * result.accuracy_after)


@pytest.mark.parametrize("dt", [0, 0.1])
def test_never_worse(dt):
    rng = np.random.default_rng(1)
    for _ in range(10):
        G = control.StateSpace(
            rng.standard_normal((4, 4)) / 4,
            rng.standard_normal((4, 1)),
            rng.standard_normal((1, 4)),
            0,
            dt,
        )
        result = prescale(G)
        assert result.accuracy_after.max() <= result.accuracy_before.max() * 1.05


def test_odd_systems():
    undamped = control.ss([[0, 1], [-1, 0]], [[0], [1]], [[1, 0]], 0)
    assert prescale(undamped, band=(1, 10)).system.nstates == 2  # a pole on the grid
    assert prescale(control.ss([], [], [], [[1.0]])).left.shape == (0, 0)
    assert prescale(control.ss([[0.0]], [[1.0]], [[1.0]], 0)).frequency.size > 0


def test_bad_input_is_refused():
    for band in ((10, 1), (0, 1), "wide", (1, 2, 3), (1, np.inf)):
        with pytest.raises(InvalidInputError, match="band"):
            prescale(bearing(), band=band)
    with pytest.raises(InvalidInputError, match=r"band.*31\.4159"):
        prescale(control.ss([[0.5]], [[1]], [[1]], 0, 0.1), band=(1, 100))
