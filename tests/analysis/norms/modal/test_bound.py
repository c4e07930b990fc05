"""Pieces on which the gain is surely below a level."""

import numpy as np
import pytest

from robustpolish.linear.norms import modal_peak as bound
from robustpolish.linear.norms.modal_expansion import ORDER


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


def test_a_peak_in_the_middle_is_settled_however_near_the_level_is():
    piece = series(1.0, 0.0, -0.4)  # 1 - 0.4 t^2
    assert below(piece, 1 + 1e-9)[0]
    assert not below(piece, 1 - 1e-9)[0]


def test_errors_count():
    assert not below(series(1.0, 0.0, -0.4), 1 + 1e-9, 1e-6)[0]
    assert below(series(1.0, 0.0, -0.4), 1 + 1e-9, 1e-10)[0]
    assert bound.sizes(series(1.0, 0.5), np.empty(ORDER)) == pytest.approx(1.5)


def test_the_peak_is_told():
    piece = series(1.0, 0.1, -0.4)
    _, peak = below(piece, 2.0)
    t = np.linspace(-1, 1, 20001)
    assert peak == pytest.approx(t[np.argmax(1 + 0.1 * t - 0.4 * t**2)], abs=0.05)


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


def test_a_direction_that_turns_along_the_piece_is_settled_too():
    """The gain is 1 everywhere while its direction turns; the rest of G lies well below."""
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    terms, power = [], np.eye(2)
    for j in range(ORDER):
        terms.append(np.diag([1.0, 0.5]) @ power)
        power = power @ turn * 0.01 / (j + 1)
    assert below(series(*terms), 1 + 1e-5)[0]
