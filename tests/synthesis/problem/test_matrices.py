"""Bare plants and controllers: connected as the plants with names are, whatever their units."""

import control
import numpy as np
import pytest
from hard_plants import random_plant

from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.synthesis.problem.matrices import (
    Controller,
    PlantMatrices,
    absorb_d22,
    balanced,
    balancing_scale,
    close,
    regularise,
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


def test_no_controller_acts_alike_where_the_loop_is_ill_posed():
    K = drawn_controller(1, 1)._replace(D=np.array([[2.0]]))
    assert absorb_d22(K, np.array([[-0.5]])) is None
    # Units are no reason: det(I + Dk D22) is 1/2, its condition number 2e18.
    wild = drawn_controller()._replace(D=np.array([[0.0, 1e9], [0.5e-9, 0.0]]))
    assert absorb_d22(wild, np.eye(2)) is not None
    assert absorb_d22(K, np.zeros((1, 1))) is K


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


def test_balanced_states_are_alike_and_nothing_is_rounded():
    K = drawn_controller()
    units = np.exp2([50.0, 20.0, 33.0])
    wild = Controller(K.A * units / units[:, None], K.B / units[:, None], K.C * units, K.D)
    found = balanced(wild)
    assert wild.gain > 1e9
    assert found.gain < 20 * K.gain
    np.testing.assert_array_equal(found.C @ found.B, K.C @ K.B)
    same_response(found, K)
    static = drawn_controller(n=0)
    assert balanced(static) is static


def test_scales_are_powers_of_two_and_ones_where_nothing_can_be_scaled():
    size = np.array([[1.0, 1e12, 1.0], [1e-12, 1.0, 1e-12], [1.0, 1e12, 1.0]])
    scale = balancing_scale(size)
    np.testing.assert_array_equal(np.exp2(np.round(np.log2(scale))), scale)
    even = size * scale / scale[:, None]
    assert even.max() < 8 * even.min()
    np.testing.assert_array_equal(balancing_scale(np.diag([1.0, np.inf])), [1.0, 1.0])
    assert balancing_scale(np.zeros((0, 0))).size == 0


def test_fingerprints_tell_parts_apart():
    plant = PlantMatrices.of(random_plant(3, 0))
    same = PlantMatrices.of(random_plant(3, 0))
    assert plant.fingerprint == same.fingerprint
    assert plant.fingerprint != plant.replace(discrete=True).fingerprint
    assert plant.fingerprint != plant.replace(A=np.nextafter(plant.A, 1.0)).fingerprint
    nothing = plant.replace(C1=np.zeros((0, 3)), D12=np.zeros((0, 2)))
    assert nothing.fingerprint != nothing.replace(C1=np.zeros((0, 2))).fingerprint
