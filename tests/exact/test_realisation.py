"""Systems rescaled by powers of two: nothing is rounded, nothing is changed."""

import control
import numpy as np
import pytest

from robustpolish.exact.realisation import power_of_two, realisation, rescaled, size, typical_rate


def badly_scaled(dt=0):
    rng = np.random.default_rng(0)
    units = 10.0 ** rng.integers(-6, 7, 4)
    A = (rng.standard_normal((4, 4)) - 3 * np.eye(4)) * units / units[:, None]
    A = A * (0.1 if dt else 1e5)
    B, C = rng.standard_normal((4, 2)) / units[:, None] * 1e8, rng.standard_normal((3, 4)) * units
    return control.ss(A, B, C, rng.standard_normal((3, 2)), dt)


@pytest.mark.parametrize("dt", [0, 0.25])
def test_the_gain_is_the_same_in_other_units(dt):
    system = badly_scaled(dt)
    model = rescaled(realisation("system", system))
    for x in (0.3, 2.0):
        point = np.exp(1j * x) if dt else 1j * x
        G = model.C @ np.linalg.solve(point * np.eye(4) - model.A, model.B) + model.D
        original = system(np.exp(1j * x) if dt else 1j * x * model.time)
        np.testing.assert_allclose(G * model.gain, original, rtol=1e-9)
    assert 0.25 < size(model.B) < 4
    assert 0.25 < size(model.C) < 4


def test_every_scale_is_a_power_of_two():
    system = badly_scaled()
    model = rescaled(realisation("system", system))
    for ratio in (*(model.A / system.A).ravel(), model.time, model.gain):
        assert np.frexp(abs(ratio))[0] == 0.5


def test_sampling_times():
    assert realisation("s", control.ss(-1, 1, 1, 0)).discrete is False
    assert realisation("s", control.StateSpace(-1, 1, 1, 0, None)).discrete is False
    unnamed = realisation("s", control.ss(0.5, 1, 1, 0, True))
    assert (unnamed.discrete, unnamed.step) == (True, 1.0)
    assert realisation("s", control.ss(0.5, 1, 1, 0, 0.2)).step == 0.2


def test_a_gain_without_states_stays():
    model = realisation("s", control.StateSpace([], [], [], [[2.0]]))
    assert rescaled(model) is model


@pytest.mark.parametrize(
    ("value", "power"), [(1.0, 1.0), (3.1, 4.0), (0.3, 0.25), (0.0, 1.0), (np.inf, 1.0)]
)
def test_powers_of_two(value, power):
    assert power_of_two(value) == power


def test_sizes_do_not_overflow():
    assert size(np.array([[3e200, 4e200]])) == pytest.approx(5e200)
    assert size(np.array([[3e-200, 4e-200]])) == pytest.approx(5e-200)
    assert size(np.zeros((0, 3))) == 0.0


def test_the_typical_rate_leaves_integrators_out():
    assert typical_rate(np.diag([0.0, -1.0, -100.0])) == pytest.approx(10.0)
    assert typical_rate(np.zeros((2, 2))) == 1.0
