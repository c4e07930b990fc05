"""Systems rescaled by powers of two: nothing is rounded, nothing is changed."""

import control
import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.linear.arithmetic.realisation import (
    Realisation,
    power_of_two,
    realisation,
    rescaled,
    size,
    typical_rate,
)


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


@pytest.mark.parametrize("seed", range(20))
def test_nothing_is_rounded(seed):
    rng = np.random.default_rng(seed)
    n, spread = 4, (3, 40)[seed % 2]

    def wide(*shape):
        return rng.standard_normal(shape) * 10.0 ** rng.uniform(-spread, spread, shape)

    given = Realisation(wide(n, n), wide(n, 2), wide(3, n), wide(3, 2), seed % 3 == 0)
    found = rescaled(given)
    for name, M in found.matrices.items():
        assert (np.frexp(np.abs(M / given.matrices[name]))[0] == 0.5).all()
        assert M.flags.c_contiguous
    for power in (found.time, found.gain):
        assert np.frexp(power)[0] == 0.5
    assert found.time == 1.0 or not given.discrete


def test_what_would_lose_bits_is_refused():
    A = np.array([[-1e300, 1e-20], [1e-20, -1e300]])  # over 1e300 no double holds 1e-20
    one = np.ones((2, 2))
    with pytest.raises(InvalidInputError, match="double precision can hold"):
        rescaled(Realisation(A, one, one, 0 * one, False))


def test_what_is_given_stays_as_it_is():
    given = realisation("system", badly_scaled())
    before = {name: M.copy() for name, M in given.matrices.items()}
    rescaled(given)
    for name, M in given.matrices.items():
        np.testing.assert_array_equal(M, before[name])
