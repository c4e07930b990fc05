"""Products with more digits, against rational arithmetic."""

from fractions import Fraction

import numpy as np
import pytest

from robustpolish.linear.norms.modal_form import extended_product


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
