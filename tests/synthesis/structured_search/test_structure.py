"""The search in one part: units, requirements, keys, and what no gain moves."""

from dataclasses import replace

import numpy as np
import pytest
from hard_plants import rescaled
from random_loops import scalar_loop
from small_plants import oscillator

from robustpolish.errors import InfeasibleError
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.nonsmooth.parametrisations import MaskedGain
from robustpolish.synthesis.problem.scaling import scale_plant
from robustpolish.synthesis.structured.search import (
    Norm,
    PartProblem,
    bound_in_words,
    norm_measure,
    scaled_part,
)

# Displacements, forces and time in units that differ by powers of ten.
PLANT = rescaled(oscillator(), seed=3)[0]


def problem(order=0, norm: Norm = "hinf", **options):
    free = MaskedGain(np.ones((order + 1, order + 1), bool))
    return PartProblem(scale_plant(PLANT), norm, order, free, (), "gain", **options)


def some_gain(order):
    """A gain of the scaled part that damps it a little."""
    K = np.array([[-0.05]])
    return K if not order else np.array([[-1.0, 0.2], [-0.1, -0.05]])


@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_the_controller_has_the_norm_that_the_search_saw(norm, order):
    part, K = problem(order, norm), some_gain(order)
    if norm == "h2":
        K[order:, order:] = 0.0  # noise would pass straight to u
    loop = PLANT.closed_loop(part.controller(K))
    seen = part.objective.pieces(K, 0.0, ())[0].value
    truth = float(hinf_norm(loop) if norm == "hinf" else h2_norm(loop))
    assert part.scaled.norm(seen, norm) == pytest.approx(truth, rel=1e-5)


@pytest.mark.parametrize("order", [0, 1])
def test_the_gain_is_bounded_in_the_units_of_the_plant(order):
    K = some_gain(order)
    size = float(hinf_norm(problem(order).controller(K))) if order else None
    size = size or abs(np.asarray(problem().controller(K).D).item())
    for share, kept in ((1.01, True), (0.99, False)):
        part = problem(order, gain_bound=share * size)
        (requirement,) = part.requirements
        assert (requirement.pieces(K, 0.0, ())[0].value <= 0) == kept
        # A dynamic controller has to be stable itself, or its gain over frequency is none.
        assert len(part.stable_loops) == 1 + order
    assert problem(order).requirements == ()
    assert len(problem(order).stable_loops) == 1


def test_what_rounding_left_of_a_zero_is_a_zero():
    K = some_gain(1)
    K[0, 1] = 1e-17
    assert not np.asarray(problem(1).controller(K).B).any()
    assert np.asarray(problem(1).controller(some_gain(1)).B).any()


def test_keys_tell_problems_with_different_answers_apart():
    part = problem()
    assert part.key == problem().key
    assert part.key != problem(extra=b"other mask").key
    moved = replace(part, scaled=scale_plant(PLANT.replace(B2=2 * PLANT.B2)))
    assert part.key != moved.key


def test_a_loop_without_disturbances_is_measured_by_its_states():
    loop = scalar_loop(A=-2.0)
    none = np.zeros
    silent = loop.replace(B1=none((1, 0)), D11=none((1, 0)), D21=none((1, 0)))
    # 1/2 for the H-infinity norm, sqrt(1/4) for the H2 norm.
    for measure in (norm_measure(silent, "hinf"), norm_measure(silent, "h2")):
        (piece,) = measure.pieces(np.zeros((1, 1)), 0.0, ())
        assert piece.value == pytest.approx(0.5)


def test_modes_that_the_pattern_does_not_move_are_refused_by_name():
    plant = GeneralizedPlant.from_matrices(
        np.diag([0.5, -1.0]), np.ones((2, 1)), np.eye(2), np.eye(2), np.eye(2), states=["up", "low"]
    )
    mask = np.array([[False, True], [False, True]])
    with pytest.raises(InfeasibleError, match=r"\+0\.5 rad/s \(state up\)"):
        scaled_part(plant, "static gain", mask)
    scaled, inner = scaled_part(plant, "static gain")
    assert scaled.original is plant
    assert np.array_equal(inner.A, scaled.plant.A)


def test_bounds_in_words():
    assert bound_in_words(None) == ""
    assert bound_in_words(2.5e4) == "the gain bound 25000"
