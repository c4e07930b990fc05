"""Bare plants and controllers: connected as the plants with names are, whatever their units."""

import control
import numpy as np
import pytest
from hard_plants import random_plant
from small_plants import oscillator

import robustpolish as rp
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.problem.matrices import (
    Controller,
    PlantMatrices,
    absorb_d22,
    augmented,
    channel,
    close,
    close_static_loop,
    regularise,
    to_continuous,
    to_discrete,
)

POINTS = (0.0, 1j, 0.5 - 3j)


def drawn_controller(nu=2, ny=2, n=3, seed=0):
    rng = np.random.default_rng(seed)
    return Controller(*map(rng.standard_normal, ((n, n), (n, ny), (nu, n), (nu, ny))))


def same_response(first, second):
    for s in POINTS:
        np.testing.assert_allclose(
            control.StateSpace(*first)(s), control.StateSpace(*second)(s), rtol=1e-8
        )


def test_a_loop_is_that_of_the_plant_with_names():
    plant, K = random_plant(4, 0), drawn_controller()
    assert PlantMatrices.of(plant).has_d22
    # Around D22 the shifted controller does what K does without it.
    inner = PlantMatrices.of(plant).without_d22()
    assert not inner.has_d22
    outer = absorb_d22(K, plant.D22)
    assert outer is not None
    loop = plant.closed_loop(control.StateSpace(*outer))
    same_response(close(inner, K), (loop.A, loop.B, loop.C, loop.D))
    bare = random_plant(4, 0, feedthrough=False)
    given = bare.closed_loop(control.StateSpace(*K))
    same_response(close(PlantMatrices.of(bare), K), (given.A, given.B, given.C, given.D))


@pytest.mark.parametrize("epsilon", [0.3, 1e-3])
def test_a_regularised_plant_is_regular_and_its_norms_are_larger(epsilon):
    plant = PlantMatrices.of(random_plant(3, 1, unstable=0)).without_d22()
    assert regularise(plant, 0.0) is plant
    regular = regularise(plant, epsilon)
    assert np.linalg.matrix_rank(plant.D12) < plant.nu
    assert np.linalg.matrix_rank(regular.D12) == plant.nu
    assert np.linalg.matrix_rank(regular.D21) == plant.ny
    # No zeros on the axis: [A - s I, B2; C1, D12] keeps its rank.
    for s in (0.0, 1j):
        pencil = [[plant.A - s * np.eye(3), plant.B2], [regular.C1, regular.D12]]
        assert np.linalg.matrix_rank(np.block(pencil)) == 3 + plant.nu
    K = drawn_controller()
    K = Controller(K.A - 5 * np.eye(3), 0.01 * K.B, K.C, 0.001 * K.D)
    norms = [hinf_norm(control.StateSpace(*close(p, K))).value for p in (plant, regular)]
    assert np.isfinite(norms).all()
    assert norms[0] < norms[1] < norms[0] * (1 + 20 * epsilon)


def test_signals_come_in_the_order_asked_for():
    plant = oscillator().replace(D11=[[1.0, 2.0], [3.0, 4.0]])
    turned = channel(plant, ["noise", "force"], ["price", "x"])
    np.testing.assert_array_equal(turned.D11, [[4.0, 3.0], [2.0, 1.0]])
    np.testing.assert_array_equal(turned.D21, [[0.2, 0.0]])
    np.testing.assert_array_equal(turned.D12, [[0.5], [0.0]])
    assert turned.disturbance_names == ("noise", "force")


@pytest.mark.parametrize(
    ("disturbances", "performance", "argument"),
    [
        ("wind", "x", "disturbances"),
        (["force", "force"], "x", "disturbances"),
        ("force", ["x", "y"], "performance"),
        ("force", [], "performance"),
    ],
)
def test_unknown_repeated_or_missing_names_are_refused(disturbances, performance, argument):
    known = "force, noise" if argument == "disturbances" else "x, price"
    with pytest.raises(rp.InvalidInputError, match=f"^{argument}: got .* names out of {known}"):
        channel(oscillator(), disturbances, performance)


PLACES = (0.0, 1j, 0.5 - 3j)


def same_as(loop, system):
    assert loop is not None
    for s in PLACES:
        own = control.StateSpace(loop.A, loop.B, loop.C, loop.D)(s)
        np.testing.assert_allclose(own, system(s), rtol=1e-8)


def drawn(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


@pytest.mark.parametrize("feedthrough", [False, True])
@pytest.mark.parametrize("order", [0, 2])
def test_a_static_gain_around_integrators_is_a_dynamic_controller(order, feedthrough):
    plant, K = random_plant(3, 1, feedthrough=feedthrough), drawn(order + 2, order + 2)
    parts = K[:order, :order], K[:order, order:], K[order:, :order], K[order:, order:]
    loop = close_static_loop(augmented(PlantMatrices.of(plant), order), K)
    same_as(loop, plant.closed_loop(control.StateSpace(*parts)))


def sampled(seed, eigenvalues=None):
    plant = random_plant(4, seed)
    A = plant.A / np.abs(np.linalg.eigvals(plant.A)).max() * 1.1
    if eigenvalues is not None:
        A = np.linalg.solve(plant.A, np.diag(eigenvalues) @ plant.A)
    names = ("B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22")
    matrices = (getattr(plant, name) for name in names)
    return GeneralizedPlant.from_matrices(A, *matrices, dt=0.1)


def small_controller():
    rng = np.random.default_rng(3)
    return Controller(*(rng.standard_normal((2, 2)) for _ in range(4)))


def images(plant):
    gain = np.ones((plant.nu, plant.ny))
    return to_continuous(plant, np.ones(plant.nx), gain)


@pytest.mark.parametrize("eigenvalues", [None, (-1.0, 0.5, 0.2, -0.3), (-1.0, -1.0, 0.9, 2.0)])
def test_loops_with_both_respond_alike(eigenvalues):
    plant, K = sampled(1, eigenvalues), small_controller()
    image, feedback = images(plant)
    assert not image.is_discrete
    assert feedback.any() == (eigenvalues is not None)  # only a pole at -1 has to be moved
    discrete = to_discrete(K, feedback, plant.D22)
    assert discrete is not None
    own = plant.closed_loop(control.StateSpace(*discrete, plant.dt))
    loop = image.closed_loop(control.StateSpace(*K))
    for angle in (0.3, 1.0, 2.5):
        z = np.exp(1j * angle)
        np.testing.assert_allclose(own(z), loop((z - 1) / (z + 1)), rtol=1e-6)
