"""Scalings, their fits and derivatives: against differences, analysis and output feedback."""

import numpy as np
import pytest
import uncertain_plants

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.robust.loop_model import DeltaBlock, DeltaStructure
from robustpolish.robust.scalings import Inequality, Space, best_scalings
from robustpolish.synthesis.problem.matrices import Controller, augmented, close_static_loop
from robustpolish.synthesis.uncertain.scaled_gain import (
    LoopResponses,
    ModalGain,
    MuBounds,
    RobustProblem,
    ScaledGain,
    Scalings,
    controller_from_matrix,
    controller_matrix,
    grid,
)
from robustpolish.synthesis.uncertain.search import (
    ONE,
    Filter,
    MuDescent,
    fitted,
    k_step,
    scaled_plant,
    scalings_of,
)


@pytest.mark.parametrize(("name", "signals"), [("lag", 1), ("two_masses", 1), ("column", 2)])
def test_the_k_step_is_near_the_infimum_of_output_feedback(name, signals):
    problem = RobustProblem.of(getattr(uncertain_plants, name)(), signals, signals, 1.0)
    plant = scaled_plant(problem, [ONE] * len(problem.as_complex.blocks))
    K = k_step(plant, 1.0, Budget())
    loop = close_static_loop(augmented(plant, len(K.A)), controller_matrix(K))
    assert loop.stable
    omega = np.array([0.0, *np.geomspace(1e-6, 1e6, 600), np.inf])
    norm = np.linalg.norm(LoopResponses.of(loop, omega).M, 2, axis=(1, 2)).max()
    design = rp.output_feedback(problem.plant)
    assert norm <= design.lower_bound * 1.03


@pytest.fixture
def problem():
    return RobustProblem.of(uncertain_plants.lag(), 1, 1, 1.0)


@pytest.fixture
def K():
    return Controller(*(np.array([[x]]) for x in (-1.0, 0.3, 0.4, -0.5)))


def test_loop_of_the_scaled_plant_is_the_scaled_loop(problem, K):
    filters = [Filter(2.0, np.array([0.5]), np.array([3.0])), ONE]
    omega = np.array([0.0, 0.4, 7.0, np.inf])
    loop = close_static_loop(augmented(scaled_plant(problem, filters), 1), controller_matrix(K))
    M = LoopResponses.of(problem.loop(K), omega).M
    d = np.exp(filters[0].sizes(omega))
    nz, nw = problem.structure.shape
    left, right = np.ones((4, nz)), np.ones((4, nw))
    left[:, 0], right[:, 0] = d, d
    expected = np.linalg.norm(left[:, :, None] * M / right[:, None, :], 2, axis=(1, 2))
    scaled = np.linalg.norm(LoopResponses.of(loop, omega).M, 2, axis=(1, 2))
    assert scaled == pytest.approx(expected)


def test_fitted_scalings_raise_the_levels_next_to_nothing(problem, K):
    loop = problem.loop(K)
    omega = grid([loop.poles])
    M = LoopResponses.of(loop, omega).M
    known = MuBounds.over(problem.as_complex, omega, M)
    filters = scalings_of(problem, known, M)
    loop = close_static_loop(augmented(scaled_plant(problem, filters), 1), controller_matrix(K))
    norms = np.linalg.norm(LoopResponses.of(loop, omega).M, 2, axis=(1, 2))
    assert norms.max() <= 1.02 * known.peak
    assert len(filters[-1].poles) == 0


OMEGA = np.array([0.0, *np.geomspace(1e-3, 1e3, 60), np.inf])


def response(K, s):
    if np.isinf(abs(s)):
        return K.D
    return K.D + K.C @ np.linalg.solve(s * np.eye(len(K.A)) - K.A, K.B)


def test_sizes_of_a_filter_are_fitted_by_one_of_its_order():
    true = Filter(0.3, np.array([0.2, 8.0]), np.array([1.0, 1.5]))
    found = fitted(OMEGA, true.sizes(OMEGA), np.ones(len(OMEGA)), 2)
    assert [len(f.poles) for f in found] == [0, 1, 2]
    errors = [np.abs(f.sizes(OMEGA) - true.sizes(OMEGA)).max() for f in found]
    assert errors[2] < 0.01 < errors[0]


BLOCKS = (
    DeltaBlock("real", 2),
    DeltaBlock("complex", 2),
    DeltaBlock("full", 1, 2, 3),
    DeltaBlock("real"),
    DeltaBlock("full", 1, 2, 1),
)


@pytest.fixture
def case():
    random = np.random.default_rng(0)
    structure = DeltaStructure(BLOCKS)
    scalings = Scalings(structure)
    nz, nw = structure.shape
    M = random.standard_normal((3, nz, nw)) + 1j * random.standard_normal((3, nz, nw))
    weights = random.standard_normal((3, nw, nw)) + 1j * random.standard_normal((3, nw, nw))
    weights = weights + np.conj(weights.swapaxes(1, 2))
    theta = 0.3 * random.standard_normal((3, scalings.size))
    return scalings, theta, M, weights


@pytest.mark.parametrize("gain", [1.0, 7.0])
def test_scalings_of_the_analysis_prove_the_same_level(case, gain):
    scalings, _, M, _ = case
    best = best_scalings(Inequality(Space(scalings.structure), M[:1] / gain))
    theta = scalings.of_bounds([best], gain)
    assert ScaledGain(scalings, theta, M[:1]).squares == pytest.approx(best.square * gain**2)


@pytest.fixture
def start(problem, K):
    loop = problem.loop(K)
    omega = grid([loop.poles])
    found = MuBounds.over(problem.structure, omega, LoopResponses.of(loop, omega).M)
    scalings = Scalings(problem.structure)
    form, theta = ModalGain.of(K)
    descent = MuDescent(augmented(problem.matrices, 1), form, scalings, omega)
    return descent, (theta, scalings.of_bounds(found.found), found.peak)


def test_derivatives_are_those_of_differences_with_the_fence_and_without(start):
    descent, (theta, weights, level) = start
    random, h = np.random.default_rng(0), 1e-6
    x = np.concatenate([theta, weights.ravel()])
    for each in (
        descent,
        MuDescent(descent.plant, descent.gain, descent.scalings, descent.omega, 2.0),
    ):
        fence = each._stability_penalty(each.loop(theta))[0]
        assert (fence > 0) == (each.damping == 2.0)
        value, slope = each._value(x, len(theta), 20.0, level**2)
        step = random.standard_normal(len(x))
        ends = [each._value(x + sign * h * step, len(theta), 20.0, level**2)[0] for sign in (1, -1)]
        assert np.isfinite(value)
        assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(slope @ step, rel=1e-4)


def test_descent_lowers_the_level_and_keeps_the_loop_stable(start):
    descent, (theta, weights, level) = start
    theta, _, lowered = descent.lower((theta, weights, level), (30.0, 300.0), Budget(), 100)
    assert lowered < 0.9 * level
    assert descent.loop(theta).stable


@pytest.mark.parametrize("states", [0, 1, 2, 5, 6])
def test_form_keeps_the_controller(states):
    random = np.random.default_rng(states)
    K = Controller(
        *(random.standard_normal(s) for s in ((states, states), (states, 2), (3, states), (3, 2)))
    )
    form, theta = ModalGain.of(K)
    again = controller_from_matrix(form.gain(theta), form.order)
    for s in (0.3j, 5.0 + 1j):
        assert response(again, s) == pytest.approx(response(K, s), rel=1e-9)
    blocks = np.kron(np.eye(3), np.ones((2, 2)))[:states, :states]
    assert not again.A[blocks == 0].any()
    step, weights = random.standard_normal(form.size), random.standard_normal(form.mask.shape)
    moved = form.gain(theta + step) - form.gain(theta)
    assert (weights * moved).sum() == pytest.approx(form.back(theta, weights) @ step)
