"""Norms in modal coordinates: errors are enclosed, brackets hold in exact arithmetic."""

from dataclasses import replace
from fractions import Fraction

import control
import flint
import numpy as np
import pytest

from robustpolish.linear.arithmetic.balls import precision
from robustpolish.linear.arithmetic.rational import ExactModel, fraction
from robustpolish.linear.arithmetic.realisation import realisation, rescaled
from robustpolish.linear.norms import modal_peak as bound
from robustpolish.linear.norms.h2 import exact_h2_energy, modal_energy
from robustpolish.linear.norms.hinf import gain_crossings
from robustpolish.linear.norms.modal_expansion import (
    FAR,
    ORDER,
    expand,
    expand_far,
    expansion_error,
)
from robustpolish.linear.norms.modal_form import extended_product, modal_form
from robustpolish.linear.norms.modal_peak import modal_peak
from robustpolish.linear.stability import eigensystem

# Random stable systems, and their response.


def model(seed, states=6, inputs=2, outputs=3, dt=0):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((states, states))
    A -= (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(states)
    if dt:
        A = np.linalg.solve(3 * np.eye(states) - A, 3 * np.eye(states) + A)
    B, C = rng.standard_normal((states, inputs)), rng.standard_normal((outputs, states))
    D = rng.standard_normal((outputs, inputs))
    return realisation("system", control.ss(A, B, C, D, dt))


def response(G, x):
    """Evaluate the transfer matrix at s = i x, or z = (1 + i x)/(1 - i x)."""
    point = (1 + 1j * x) / (1 - 1j * x) if G.discrete else 1j * x
    return G.C @ np.linalg.solve(point * np.eye(G.states) - G.A, G.B) + G.D


# The peak by branch and bound, against exact arithmetic.


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


def test_none_where_rounding_leaves_it_open():
    damped = control.ss([[0, 1], [-1, -1e-13]], [[0], [1]], [[1, 0]], 0)
    assert peak_of(realisation("system", damped)) is None
    nothing = control.ss(-np.diag([1.0, 1.0]), [[1], [1]], [[1, -1]], 0)
    assert peak_of(realisation("system", nothing)) is None


# The H2 norm as a sum over modes, against ball arithmetic.


def energy_of(G):
    form = modal_form(G, eigensystem(G.A), True)
    return form and modal_energy(form)


@pytest.mark.parametrize("seed", range(10))
def test_bounds_hold_in_ball_arithmetic(seed):
    G = model(seed, states=3 + seed, inputs=1 + seed % 3)
    G = rescaled(replace(G, D=0 * G.D))
    found, exact = energy_of(G), exact_h2_energy(ExactModel.of(G))
    assert found.lower <= exact.lower <= exact.upper <= found.upper
    assert found.lower <= found.square <= found.upper
    assert found.width < 1e-10


def test_none_where_nothing_is_proven():
    assert energy_of(model(1, dt=0.1)) is None  # discrete
    growing = control.ss(np.diag([-1.0, 1e-3]), np.ones((2, 1)), np.ones((1, 2)), 0)
    assert energy_of(realisation("system", growing)) is None
    hidden = control.ss(np.diag([-1.0, -1.0]), [[1], [1]], [[1, -1]], 0)
    assert energy_of(realisation("system", hidden)) is None


# Modal coordinates and the bounds of what they leave out.


def test_the_true_poles_lie_within_the_bounds():
    """Against eigenvalues in balls, of an eigensystem that is spoilt on purpose."""
    G = model(2)
    spectrum = eigensystem(G.A)
    rough = np.random.default_rng(0).standard_normal(spectrum.right.shape) * 1e-7
    spoilt = type(spectrum)(
        spectrum.values * (1 + 1e-9), spectrum.errors, spectrum.right * (1 + rough), spectrum.left
    )
    for each, size in ((spectrum, 1e-12), (spoilt, 1e-4)):
        form = modal_form(G, each, True)
        with precision(200):
            exact = flint.acb_mat(flint.arb_mat(6, 6, G.A.ravel().tolist())).eig()
        poles = form.real + 1j * form.high
        away = np.abs(np.array([complex(value) for value in exact])[:, None] - poles)
        assert (away.min(axis=0) <= form.rows + 1e-15).all()
        assert form.rows.max() < size
    assert form.rows.max() > 1e-9


# Power series of the response and their errors.


def summed(terms, t):
    return sum(terms[j] * t**j for j in range(ORDER))


def modes_and_room(G):
    form = modal_form(G, eigensystem(G.A), True)
    return form, np.empty((ORDER, *form.D.shape), complex)


@pytest.mark.parametrize("dt", [0, 0.1])
def test_the_series_are_the_response_within_their_errors(dt):
    G = model(5, dt=dt)
    modes, terms = modes_and_room(G)
    poles = modes.real + 1j * modes.high
    for centre in (0.0, 0.3, 1.0, 4.0):
        half = 0.3 * np.abs(1j * centre - poles).min()
        expand(modes, centre, half, terms)
        error, most = expansion_error(modes, centre, half, 0.0)
        coarse, _ = expansion_error(modes, centre, half, 1.0)
        assert error <= coarse * (1 + 1e-12) <= error + 1e-11
        for t in (-1.0, -0.3, 0.0, 1.0):
            away = np.linalg.norm(summed(terms, t) - response(G, centre + half * t), 2)
            assert away <= error + 1e-12
            assert np.linalg.norm(response(G, centre + half * t), 2) <= most
        assert error < 0.1
        assert expansion_error(modes, centre, 0.0, 0.0)[0] < 1e-9  # nothing but rounding is left


@pytest.mark.parametrize("dt", [0, 0.1])
def test_the_last_piece_reaches_to_infinity(dt):
    G = model(5, dt=dt)
    modes, terms = modes_and_room(G)
    start = FAR * float(np.hypot(modes.real, modes.high).max())
    error = expand_far(modes, start, terms)
    for t in (1.0, 0.5, 1e-6):
        away = np.linalg.norm(summed(terms, t) - response(G, start / t), 2)
        assert away <= error + 1e-12
    assert error < 0.01


# Pieces on which the gain is surely below a level.


def series(*terms):
    """Return one piece with the given first terms."""
    first = np.atleast_2d(np.asarray(terms[0], dtype=complex))
    full = np.zeros((ORDER, *first.shape), complex)
    for j, term in enumerate(terms):
        full[j] = term
    return full


def below(terms, level, error=0.0):
    norms, (_, _, m) = np.empty(ORDER), terms.shape
    total = bound.sizes(terms, norms)
    found = np.empty((4, m, m), complex)
    late, lost = bound.squares(terms, norms, total, error, found)
    return bound.below(found, late, lost, level)


@pytest.mark.parametrize("seed", range(40))
def test_no_level_below_the_largest_gain_is_ever_proven(seed):
    rng = np.random.default_rng(seed)
    shape = (int(rng.integers(2, 4)), int(rng.integers(1, 3)))
    terms = [
        (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) * 0.3**j
        for j in range(ORDER)
    ]
    piece = series(*terms)
    t = np.linspace(-1, 1, 401)
    largest = max(np.linalg.norm(sum(N * x**j for j, N in enumerate(terms)), 2) for x in t)
    assert not below(piece, largest * (1 - 1e-6))[0]
    assert below(piece, 3 * largest)[0]


# Products with more digits, against rational arithmetic.


@pytest.mark.parametrize("inner", [5, 80])
@pytest.mark.parametrize("spread", [0, 12])
def test_errors_are_within_their_bounds_and_small(inner, spread):
    rng = np.random.default_rng(inner)
    M = rng.standard_normal((4, inner)) * 10.0 ** rng.uniform(-spread, 0, (4, inner))
    M[3] = 0.0
    V = rng.standard_normal((inner, 70)) + 1j * rng.standard_normal((inner, 70))
    V[:, :10] *= 10.0 ** rng.uniform(-spread, 0, (inner, 10))
    found, error = extended_product(M, V)
    for i, j in [(0, 0), (1, 7), (2, 69), (3, 1)]:
        for parts, value in ((V.real, found.real), (V.imag, found.imag)):
            exact = sum(
                (Fraction(a) * Fraction(b) for a, b in zip(M[i], parts[:, j], strict=True)),
                Fraction(0),
            )
            high = float(value[i, j])
            low = float(value[i, j] - np.longdouble(high))
            assert abs(Fraction(high) + Fraction(low) - exact) <= Fraction(error[i, j])
    size = np.abs(M).max(axis=1)[:, None] * np.abs(V).max(axis=0) * inner
    few = 4 * (inner + 8) * np.finfo(np.longdouble).eps  # as sums one after the other may lose
    assert (error <= 2 * few * size).all()
