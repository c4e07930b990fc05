"""The thesis's inequalities, handed to a solver."""

import control
import numpy as np
import pytest

from robustpolish.linear.arithmetic.rational import ExactModel
from robustpolish.linear.arithmetic.realisation import realisation
from robustpolish.linear.norms.lmi import interior_solution, minimise_gamma, proves_lmi
from robustpolish.linear.norms.peak import modal_model

SYSTEM = realisation("s", control.ss([[0.0, 1.0], [-4.0, -0.4]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0))
HINF = 1 / (0.4 * np.sqrt(4 - 0.04))


@pytest.mark.parametrize("equation", ["10.17", "10.44"])
def test_the_smallest_gamma_is_the_norm(equation):
    answer = minimise_gamma(modal_model(SYSTEM), equation)
    assert answer.status == "optimal"
    assert answer.gamma == pytest.approx(HINF, rel=1e-4)


@pytest.mark.parametrize(("equation", "gamma"), [("10.15", 1.0), ("10.17", 1.1 * HINF)])
def test_a_matrix_well_inside_passes_the_exact_proof(equation, gamma):
    answer = interior_solution(modal_model(SYSTEM), equation, gamma)
    assert answer.K is not None
    np.testing.assert_array_equal(answer.K, answer.K.T)
    assert proves_lmi(ExactModel.of(SYSTEM), equation, answer.K, gamma)
