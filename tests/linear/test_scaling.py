"""Scaling: even matrices, the way back for controllers, decoupled parts."""

import control
import mpmath as mp
import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.linear.scaling import decoupled_blocks, prescale, scale_system
from robustpolish.polishing.air_bearing import AirBearingParameters, air_bearing

# Units for synthesis.


def plant(seed=0, dt=0):
    rng = np.random.default_rng(seed)
    n, m, p = 4, 3, 3
    units = 10.0 ** rng.uniform(-6, 6, n)
    A = rng.standard_normal((n, n)) * units / units[:, None] * (1 if dt else 1e5)
    B = rng.standard_normal((n, m)) / units[:, None] * 10.0 ** rng.uniform(-6, 6, m)
    C = rng.standard_normal((p, n)) * units * 10.0 ** rng.uniform(-6, 6, (p, 1))
    return control.StateSpace(A, B, C, np.zeros((p, m)), dt, states=list("abcd"))


@pytest.mark.parametrize("dt", [0, 0.01])
def test_wild_units_become_even(dt):
    scaled, scaling = scale_system(plant(dt=dt))
    for M in (scaled.A, scaled.B, scaled.C):
        assert 0.3 < abs(M).max() < 10
    for scales in (scaling.state, scaling.inputs, scaling.outputs, [scaling.time]):
        assert all(np.frexp(scales)[0] == 0.5)  # powers of two
    assert scaled.state_labels == list("abcd")


def test_groups_share_a_scale_and_keep_the_norm():
    G = plant(1)
    G = control.StateSpace(G.A - 1e6 * np.eye(4), G.B, G.C, G.D)
    scaled, scaling = scale_system(G, input_groups=[range(3)], output_groups=[[0, 1, 2]])
    assert len(set(scaling.inputs)) == len(set(scaling.outputs)) == 1
    factor = scaling.outputs[0] / scaling.inputs[0]
    assert hinf_norm(scaled).value * factor == pytest.approx(hinf_norm(G).value, rel=2e-9)


@pytest.mark.parametrize("dt", [0, 0.01])
def test_loops_close_alike_in_both_units(dt):
    rng = np.random.default_rng(5)
    G = plant(2, dt)
    scaled, scaling = scale_system(G)
    controls, measured = [1, 2], [0, 2]
    F = rng.standard_normal((2, 4))
    poles = np.linalg.eigvals(scaled.A + scaled.B[:, controls] @ F) * scaling.time
    real = G.A + G.B[:, controls] @ scaling.state_gain(F, controls)
    assert np.sort_complex(np.linalg.eigvals(real)) == pytest.approx(np.sort_complex(poles))
    K = control.StateSpace(
        rng.standard_normal((3, 3)),
        rng.standard_normal((3, 2)),
        rng.standard_normal((2, 3)),
        rng.standard_normal((2, 2)),
        dt,
    )
    channel = (measured, controls)
    before = closed(scaled, K, *channel) * scaling.time
    after = closed(G, scaling.controller(K, controls, measured), *channel)
    assert np.sort_complex(after) == pytest.approx(np.sort_complex(before), rel=1e-6)
    static = scaling.output_gain(K.D, controls, measured)
    assert pytest.approx(static) == scaling.controller(K, controls, measured).D


def closed(G, K, outputs, inputs):
    B, C = G.B[:, inputs], G.C[outputs]
    return np.linalg.eigvals(np.block([[G.A + B @ K.D @ C, B @ K.C], [K.B @ C, K.A]]))


def test_nothing_to_scale():
    empty = control.StateSpace([], [], [], [[8.0, 0.0]])
    scaled, _ = scale_system(empty)
    assert abs(scaled.D).max() <= 1
    still = control.ss(np.zeros((2, 2)), np.zeros((2, 1)), np.zeros((1, 2)), 0)
    assert scale_system(still)[1].time == 1


def test_bad_input_is_refused():
    G = plant()
    with pytest.raises(InvalidInputError, match="input_groups"):
        scale_system(G, input_groups=[[0, 1], [1, 2]])
    with pytest.raises(InvalidInputError, match="output_groups"):
        scale_system(G, output_groups=[[7]])
    _, scaling = scale_system(G)
    with pytest.raises(InvalidInputError, match="gain"):
        scaling.state_gain(np.ones((2, 4)))
    with pytest.raises(InvalidInputError, match="system"):
        scaling.apply(control.ss([[-1]], [[1]], [[1]], 0))


# Prescaling: accuracy gained, the thesis matrices matched or beaten.

THESIS_SECOND = [4096, 0.125, 1024, 1, 4096, 0.125, 1024, 0.5, 8192, 0.125, 4096, 0.25]


def bearing():
    plant = air_bearing(AirBearingParameters.as_published(), actuation="force")
    return control.StateSpace(plant.A, plant.B2, plant.C1, 0 * plant.C1 @ plant.B2)


def test_the_thesis_plant_gains_six_digits():
    result = prescale(bearing())
    assert result.accuracy_after.max() < 1e-6 * result.accuracy_before.max()
    ours = np.log2(np.diag(result.left))
    shift = np.median(ours - np.log2(THESIS_SECOND))  # a common factor changes nothing
    assert abs(ours - shift - np.log2(THESIS_SECOND)).max() <= 1


def test_left_and_right_map_the_matrices():
    G = bearing()
    result = prescale(G)
    assert np.array_equal(result.left @ result.right, np.eye(12))
    assert np.array_equal(result.system.A, result.left @ G.A @ result.right)
    assert np.array_equal(result.system.B, result.left @ G.B)
    assert np.array_equal(result.system.C, G.C @ result.right)
    gain = np.ones((2, 12))
    assert np.array_equal(result.state_gain(gain), gain @ np.linalg.inv(result.right))


def test_the_estimate_bounds_the_true_error():
    """Rotate the states before and after scaling; compare responses with exact ones."""
    rng = np.random.default_rng(0)
    G = control.ss([[0, 1], [-1e10, -100]], [[0], [1]], [[1, 0]], 0)
    result = prescale(G, band=(1e4, 1e6))
    Q = np.linalg.qr(rng.standard_normal((2, 2)))[0]

    def error(system, w):
        A, B, C = Q @ system.A @ Q.T, Q @ system.B, system.C @ Q.T
        rough = (C @ np.linalg.solve(1j * w * np.eye(2) - A, B))[0, 0]
        exact = 1 / (mp.mpc(1e10, 100 * w) - mp.mpf(w) ** 2)
        return float(abs(mp.mpc(rough) / exact - 1))

    before = [error(G, w) for w in result.frequency]
    after = [error(result.system, w) for w in result.frequency]
    assert max(after) < 1e-3 * max(before)
    assert all(np.array(before) < 10 * result.accuracy_before)
    assert all(np.array(after) < 10 * result.accuracy_after)


def test_odd_systems():
    undamped = control.ss([[0, 1], [-1, 0]], [[0], [1]], [[1, 0]], 0)
    assert prescale(undamped, band=(1, 10)).system.nstates == 2  # a pole on the grid
    assert prescale(control.ss([], [], [], [[1.0]])).left.shape == (0, 0)
    assert prescale(control.ss([[0.0]], [[1.0]], [[1.0]], 0)).frequency.size > 0


def test_bad_input_is_refused_p():
    for band in ((10, 1), (0, 1), "wide", (1, 2, 3), (1, np.inf)):
        with pytest.raises(InvalidInputError, match="band"):
            prescale(bearing(), band=band)
    with pytest.raises(InvalidInputError, match=r"band.*31\.4159"):
        prescale(control.ss([[0.5]], [[1]], [[1]], 0, 0.1), band=(1, 100))


# Decoupled parts of a system.


def test_the_air_bearing_splits_into_its_axes():
    plant = air_bearing(AirBearingParameters.as_published())
    system = plant.open_loop
    blocks = decoupled_blocks(system.A, system.B, system.C, system.D)
    assert [len(block.states) for block in blocks] == [4, 4, 4]
    assert sorted(i for block in blocks for i in block.inputs) == list(range(system.ninputs))


def test_feedthrough_joins_and_leftovers_are_listed():
    A, B, C = np.diag([-1.0, -2.0]), np.eye(2), np.eye(2)
    assert len(decoupled_blocks(A, B, C)) == 2
    assert len(decoupled_blocks(A, B, C, [[0, 1], [0, 0]])) == 1
    blocks = decoupled_blocks(A, [[1, 0], [0, 0]], [[1, 0]])
    assert blocks[0].inputs == blocks[0].outputs == (0,)
    assert (blocks[1].states, blocks[1].inputs) == ((1,), ())
    assert blocks[2].inputs == (1,)


def test_a_tolerance_drops_weak_coupling():
    A = [[-1, 1e-9], [0, -2]]
    assert len(decoupled_blocks(A, np.eye(2), np.eye(2))) == 1
    assert len(decoupled_blocks(A, np.eye(2), np.eye(2), tolerance=1e-6)) == 2


def test_bad_input_is_refused_d():
    with pytest.raises(InvalidInputError, match=r"A: got shape \(2, 3\)"):
        decoupled_blocks(np.ones((2, 3)), np.ones((2, 1)), np.ones((1, 2)))
    with pytest.raises(InvalidInputError, match="tolerance"):
        decoupled_blocks(np.eye(1), np.eye(1), np.eye(1), tolerance=-1)
