"""Scaling: even matrices, and the way back for gains and controllers."""

import control
import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.linear.scaling import scale_system


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
