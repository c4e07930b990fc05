"""The peak by branch and bound, against exact arithmetic."""

import control
import numpy as np
import pytest

from robustpolish.linear.arithmetic.rational import ExactModel, fraction
from robustpolish.linear.arithmetic.realisation import realisation, rescaled
from robustpolish.linear.eigen import eigensystem
from robustpolish.linear.norms.modal_form import modal_form
from robustpolish.linear.norms.modal_peak import _search, modal_peak
from robustpolish.linear.norms.peak import gain_crossings
from tests.analysis.norms.random_models import model


def peak_of(G, tolerance=1e-9, widest=1e-9):
    form = modal_form(G, eigensystem(G.A), True)
    return form and modal_peak(form, tolerance, widest)


def check(G):
    """The bracket is proven by exact crossings: none above, some below."""
    found = peak_of(G)
    assert found.lower <= found.gain <= found.upper <= found.lower * (1 + 1.3e-9)
    exact = ExactModel.of(G)
    assert not gain_crossings(exact, fraction(found.upper) ** 2)
    if np.isfinite(found.frequency):
        assert gain_crossings(exact, fraction(found.lower * (1 - 1e-12)) ** 2)
    return found


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("dt", [0, 0.1])
def test_brackets_hold_in_exact_arithmetic(seed, dt):
    rng = np.random.default_rng(seed)
    inputs, outputs = (int(k) for k in rng.integers(1, 4, 2))
    check(rescaled(model(seed, int(rng.integers(2, 9)), inputs, outputs, dt)))


@pytest.mark.parametrize("damping", [1e-1, 1e-3, 1e-5])
def test_light_damping_and_equal_peaks(damping):
    A = np.zeros((6, 6))
    for k, w in enumerate((1.0, 1.0 + 3 * damping, 7.0)):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[0, w], [-w, -2 * damping * w]]
    turn = np.linalg.qr(np.random.default_rng(0).standard_normal((6, 6)))[0]
    B, C = np.tile([[0.0], [1.0]], (3, 1)), np.tile([[1.0, 0.0]], (1, 3))
    system = control.ss(turn @ A @ turn.T, turn @ B, C @ turn.T, 0)
    check(rescaled(realisation("system", system)))


def test_a_gain_that_is_the_same_everywhere():
    """Inner systems are what optimal loops look like: every frequency is a peak."""
    rng = np.random.default_rng(1)
    A = rng.standard_normal((5, 5))
    A -= (np.linalg.eigvals(A).real.max() + 0.3) * np.eye(5)
    B = rng.standard_normal((5, 1))
    X = control.lyap(A, B @ B.T)
    system = control.ss(A, B, -B.T @ np.linalg.inv(X), 1)
    G = rescaled(realisation("system", system))
    found = peak_of(G, 1e-6, 1e-6)
    # rounded matrices are not quite inner: the largest gain is 1 to some ten digits
    assert found.lower * G.gain <= 1 + 1e-9
    assert 1 <= found.upper * G.gain <= 1 + 2e-6


def test_the_gain_may_be_largest_at_infinity():
    found = peak_of(realisation("system", control.ss([[-1]], [[1]], [[-1]], 1)))  # s/(s + 1)
    assert found.frequency == np.inf
    assert found.lower <= 1 <= found.upper


def test_none_where_rounding_leaves_it_open():
    damped = control.ss([[0, 1], [-1, -1e-13]], [[0], [1]], [[1, 0]], 0)
    assert peak_of(realisation("system", damped)) is None
    nothing = control.ss(-np.diag([1.0, 1.0]), [[1], [1]], [[1, -1]], 0)
    assert peak_of(realisation("system", nothing)) is None


def test_more_states_than_exact_arithmetic_does_quickly():
    G = rescaled(model(3, 40))
    form = modal_form(G, eigensystem(G.A), True)
    found = modal_peak(form, 1e-9, 1e-9)
    assert found is not None
    w = np.linspace(0, 20, 2000)
    gains = [
        np.linalg.norm(G.C @ np.linalg.solve(1j * x * np.eye(40) - G.A, G.B) + G.D, 2) for x in w
    ]
    assert max(gains) <= found.upper


def test_one_compilation_serves_all_systems():
    for proven in (True, False):
        G = rescaled(model(1))
        assert modal_peak(modal_form(G, eigensystem(G.A), proven), 1e-6, 1e-6) is not None
    assert len(_search.signatures) == 1
