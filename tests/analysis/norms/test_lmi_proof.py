"""Whether a matrix satisfies a strict inequality, decided without rounding."""

import control
import numpy as np
import pytest

from robustpolish.linear.arithmetic.rational import ExactModel
from robustpolish.linear.arithmetic.realisation import realisation
from robustpolish.linear.norms.lmi import proves_lmi

# 1/(s + 1): norms 1 (H-infinity) and 1/sqrt(2) (H2).
LAG = ExactModel.of(realisation("s", control.ss(-1.0, 1.0, 1.0, 0.0)))


def test_stability_is_the_sign_of_the_matrix():
    assert proves_lmi(LAG, "10.15", np.array([[1e-300]]), 0.0)
    assert not proves_lmi(LAG, "10.15", np.array([[-1.0]]), 0.0)
    assert not proves_lmi(LAG, "10.15", np.array([[0.0]]), 0.0)


@pytest.mark.parametrize("equation", ["10.17", "10.44"])
def test_the_bound_of_the_gain_is_strict(equation):
    """With K = 1 the inequality reads gamma > 1: the last bit decides."""
    K = np.array([[1.0]])
    assert proves_lmi(LAG, equation, K, np.nextafter(1.0, 2.0))
    assert not proves_lmi(LAG, equation, K, 1.0)


def test_the_h2_inequality_with_its_trace():
    """A K < 0 with B weighs -2 k + k^2/g < 0 and 1/k < g: k = 1, g > 1."""
    K = np.array([[1.0]])
    assert proves_lmi(LAG, "10.45", K, np.nextafter(1.0, 2.0))
    assert not proves_lmi(LAG, "10.45", K, 1.0)
    assert not proves_lmi(LAG, "10.45", 3 * K, 1.0)
