"""Bounds for all mixtures of loops are true, and near the truth where that is known."""

from dataclasses import replace

import control
import numpy as np
import pytest
from polytope_examples import oscillator, sampled, solver

import robustpolish as rp
from robustpolish.linear.arithmetic import balls
from robustpolish.synthesis.scheduled.polytope import (
    LyapunovFamily,
    PolytopeSpecification,
    prove,
)


def norm_of(matrices, norm, dt):
    system = control.StateSpace(*matrices, dt)
    return float((rp.hinf_norm if norm == "hinf" else rp.h2_norm)(system))


@pytest.mark.parametrize("norm", ["hinf", "h2"])
@pytest.mark.parametrize(("make", "dt"), [(oscillator, 0), (sampled, True)])
def test_a_matrix_for_each_vertex_proves_the_largest_norm_of_all_mixtures(make, dt, norm):
    loops = [make(0.3), make(0.6)]
    specification = PolytopeSpecification(LyapunovFamily.per_vertex(2), norm, bool(dt))
    proof = prove(loops, specification, solver(), 1.0)
    assert proof is not None
    first, second = (loop.doubles for loop in loops)
    mixed = [
        norm_of([(1 - t) * a + t * b for a, b in zip(first, second, strict=True)], norm, dt)
        for t in np.linspace(0, 1, 11)
    ]
    assert max(mixed) <= proof <= 1.001 * max(mixed)


def test_a_common_matrix_costs_and_still_bounds():
    loops = [oscillator(1.0), oscillator(2.0)]
    own, common = (
        prove(loops, PolytopeSpecification(family, "hinf", False), solver(), 1.0)
        for family in (LyapunovFamily.per_vertex(2), LyapunovFamily.common(2))
    )
    # The spring that changes with time pumps energy into the mass.
    assert common > 4 * own


def test_a_single_vertex_is_proven_within_a_thousandth():
    loop = oscillator(1.0)
    for norm in ("hinf", "h2"):
        proof = prove(
            [loop], PolytopeSpecification(LyapunovFamily.common(1), norm, False), solver(), 1.0
        )
        true = norm_of(loop.doubles, norm, 0)
        assert true <= proof <= 1.001 * true


def test_what_is_unstable_in_between_is_not_proven():
    # Half way between [[-1, 8], [0, -1]] and its transpose there is an eigenvalue at 3.
    upper = np.array([[-1.0, 8.0], [0.0, -1.0]])
    loops = [replace(oscillator(1.0), A=balls.ball(M)) for M in (upper, upper.T)]
    for family in (LyapunovFamily.per_vertex(2), LyapunovFamily.common(2)):
        assert prove(loops, PolytopeSpecification(family, "hinf", False), solver(), 1.0) is None


def test_bounded_rates_lie_between_rest_and_jumps():
    loops = [oscillator(1.0, 1.0), oscillator(2.0, 1.0)]
    positions = np.array([[-1.0], [1.0]])
    bounds = [
        prove(
            loops,
            PolytopeSpecification(LyapunovFamily.affine(positions, [rate]), "hinf", False),
            solver(),
            1.0,
        )
        for rate in (0.0, 0.3, np.inf)
    ]
    assert bounds[0] * 1.01 < bounds[1] < bounds[2] / 1.01
