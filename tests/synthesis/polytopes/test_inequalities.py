"""The inequalities, for a given gain, say what the norm of its loop is."""

import numpy as np
import pytest
from polytope_examples import held_mass

from robustpolish.synthesis.lmi.program import SemidefiniteProgram
from robustpolish.synthesis.problem.matrices import PlantMatrices, state_gain_norm
from robustpolish.synthesis.scheduled.polytope import (
    LyapunovFamily,
    PolytopeSpecification,
    Slack,
    Terms,
    impose,
    tied_weights,
    with_gain,
    with_slack,
)


@pytest.mark.parametrize("norm", ["hinf", "h2"])
@pytest.mark.parametrize("tilt", [None, 1e-2])
def test_the_least_bound_for_a_given_gain_is_its_norm(norm, tilt):
    plant, F = PlantMatrices.of(held_mass(2.0)), np.array([[-1.0, -2.0]])
    program, count = SemidefiniteProgram(), 1 if tilt is None else 2
    # Twice the same vertex, with a matrix for each: slack and tie have to give the same.
    family = LyapunovFamily.common(1) if tilt is None else LyapunovFamily.per_vertex(2)
    specification = PolytopeSpecification(family, norm, False)
    P = [program.symmetric(2) for _ in range(count)]
    V = P[0] if tilt is None else program.matrix(2, 2)
    weights = tied_weights(False) if tilt is None else (tilt, 1.0)
    square = program.scalar()
    for i in range(count):
        AV, CV = (plant.A + plant.B2 @ F) @ V, (plant.C1 + plant.D12 @ F) @ V
        seen = CV if norm == "hinf" else np.zeros((0, 2)) @ V
        S = with_gain(V, AV, seen, *weights)
        impose(program, specification, i, P, Terms(S, CV, V, plant.B1, plant.D11), square)
    program.minimise(square)
    found = np.sqrt(program.solve().value(square).item())
    # A slack of this small tilt costs a little; with the tilt it goes to zero.
    true = state_gain_norm(plant, F, norm)
    assert found == pytest.approx(true, rel=1e-4 if tilt is None else 0.02)


def test_a_slack_of_its_own_meets_the_equation_of_motion():
    X = Slack(np.array([[1.0, 2.0], [3.0, 4.0]]), np.eye(2), np.array([[5.0, 6.0]]))
    A, C = np.array([[0.0, 1.0], [-1.0, -1.0]]), np.array([[1.0, 0.0]])
    S = with_slack(X, A, C)
    whole = np.vstack(X) @ np.hstack([-np.eye(2), A.T, C.T])
    values = [[block.at(np.zeros(0)) for block in row] for row in S]
    assert np.array_equal(np.block(values), whole)
