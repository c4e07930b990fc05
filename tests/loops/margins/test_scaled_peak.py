"""Scales, and the bound between frequencies that no grid gives."""

import math
from functools import partial

import control
import numpy as np
import pytest

from robustpolish.linear.arithmetic.realisation import realisation
from robustpolish.loops.scaled_peak import best_scales, interval, scaled_peak


def test_scales_undo_units():
    rng = np.random.default_rng(0)
    M = rng.standard_normal((3, 3)) + 1j * rng.standard_normal((3, 3))
    units = np.array([1e-6, 1.0, 1e5])
    value, scales = best_scales(M)
    again, _ = best_scales(M * units[:, None] / units)
    assert again == pytest.approx(value, rel=1e-3)
    assert np.linalg.norm(M * scales[:, None] / scales, 2) == pytest.approx(value)
    assert np.abs(np.linalg.eigvals(M)).max() <= value <= np.linalg.norm(M, 2)


@pytest.mark.parametrize("seed", range(3))
def test_the_bound_is_that_of_python_control(seed):
    ab13md = pytest.importorskip("slycot").ab13md
    rng = np.random.default_rng(seed)
    M = rng.standard_normal((4, 4)) + 1j * rng.standard_normal((4, 4))
    bound = ab13md(M, np.ones(4, int), 2 * np.ones(4, int))[0]
    assert best_scales(M)[0] == pytest.approx(bound, rel=5e-3)


def peak_of(system, seeds=()):
    model = realisation("system", system)

    def response(omega):
        if math.isinf(omega):
            return model.D + 0j
        return (
            model.C @ np.linalg.solve(1j * omega * np.eye(model.states) - model.A, model.B)
            + model.D
        )

    size = float(np.linalg.norm(model.A))
    return scaled_peak(size, response, np.array(seeds), partial(interval, model))


def test_a_peak_between_the_points_is_found():
    omega, damping = 1234.5, 1e-5
    mode = control.ss(
        [[0, omega], [-omega, -2 * damping * omega]], [[0], [2 * damping * omega]], [[0, 3.0]], 0
    )
    whole = control.append(mode, control.ss([[-1.0]], [[1.0]], [[1.0]], 0))
    found = peak_of(whole)
    assert found.covered
    assert found.upper == pytest.approx(3.0, rel=2e-3)
    assert found.lower <= 3.0 * (1 + 1e-9) <= found.upper
    assert found.frequency == pytest.approx(omega, rel=1e-4)


def test_an_interval_ends_where_the_gain_has_the_level():
    lag = realisation("lag", control.ss([[-1.0]], [[1.0]], [[1.0]], 0))
    first, last = interval(lag, 5.0, np.ones(1), 0.5)
    assert (first, last) == (pytest.approx(np.sqrt(3)), np.inf)
    static = realisation("gain", control.ss([], [], [], [[2.0]]))
    assert interval(static, 1.0, np.ones(1), 3.0) == (0.0, np.inf)


def test_nothing_has_no_peak():
    zero = control.ss([[-1.0]], [[0.0]], [[1.0]], 0, remove_useless_states=False)
    assert peak_of(zero).upper == 0.0


def test_two_signals_have_their_best_scales_in_closed_form():
    rng = np.random.default_rng(5)
    for _ in range(30):
        sizes = 10.0 ** rng.uniform(-4, 4, (2, 2))
        M = sizes * (rng.standard_normal((2, 2)) + 1j * rng.standard_normal((2, 2)))
        value, scales = best_scales(M)
        tried = np.exp(np.linspace(-20, 20, 4001))
        each = [np.linalg.norm(M * np.array([[1, 1 / d], [d, 1]]), 2) for d in tried]
        assert value <= min(each) * (1 + 1e-12)
        assert value == pytest.approx(np.linalg.norm(scales[:, None] * M / scales, 2))
    assert best_scales(np.zeros((2, 2)))[0] == 0
