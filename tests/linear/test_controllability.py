"""Controllability and observability, mode by mode."""

import control
import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.linear.stability import (
    controllability,
    is_detectable,
    is_stabilizable,
    observability,
)

# The test of Popov, Belevitch and Hautus.

NAMES = ["u", "q", "theta"]


def test_the_hidden_mode_is_named():
    A, B = np.diag([-1.0, 0.5, -3.0]), [[1.0], [0.0], [1.0]]
    test = controllability(A, B, states=NAMES)
    assert not test
    (mode,) = test.deficient
    assert (mode.eigenvalue, mode.state, mode.stable) == (0.5, "q", False)
    assert test.distance == 0
    refused = is_stabilizable(A, B, states=NAMES)
    assert not refused
    assert "0.5 (state q)" in refused.reason
    assert is_stabilizable(A, [[1.0], [1.0], [0.0]])


def test_discrete_modes_inside_the_circle_may_be_hidden():
    assert is_stabilizable(np.diag([0.5, -0.5]), [[0.0], [1.0]], dt=0.1)
    assert not is_stabilizable(np.diag([0.5, -0.5]), [[0.0], [1.0]])
    assert not is_detectable(np.diag([0.5, -1.0]), [[1.0, 0.0]], dt=True)


@pytest.mark.parametrize("small", [1e-2, 1e-6, 1e-10])
def test_the_distance_follows_the_coupling(small):
    test = controllability([[-1.0, 1.0], [0.0, -1.0 - small]], [[1.0], [0.0]])
    assert not test  # the second state is driven by nothing
    near = controllability(np.diag([-1.0, -1.0 - small]), [[1.0], [1.0]])
    assert near
    assert 0.02 * small < near.distance < small


def test_observability_is_the_dual():
    rng = np.random.default_rng(0)
    A, C = rng.standard_normal((5, 5)), rng.standard_normal((2, 5))
    one, other = observability(A, C), controllability(A.T, C.T)
    assert one.distance == pytest.approx(other.distance)
    assert one.kind == "observability"


def test_verdicts_do_not_depend_on_units():
    rng = np.random.default_rng(1)
    for _ in range(20):
        A = rng.standard_normal((5, 5))
        B = rng.standard_normal((5, 2))
        A[3:, :3] = B[3:] = 0  # two modes out of reach
        units, rate = 2.0 ** rng.integers(-30, 30, 5), 2.0 ** rng.integers(-30, 30)
        inputs = 2.0 ** rng.integers(-30, 30, 2)
        shuffled = rng.permutation(5)
        changed = (A * units / units[:, None] * rate)[np.ix_(shuffled, shuffled)]
        test = controllability(A, B)
        other = controllability(changed, (B / units[:, None] * inputs)[shuffled])
        assert len(test.deficient) == len(other.deficient)
        ours = sorted((m.eigenvalue for m in test.deficient), key=abs)
        theirs = sorted((m.eigenvalue / rate for m in other.deficient), key=abs)
        assert theirs == pytest.approx(ours)
        assert bool(is_stabilizable(A, B)) == bool(is_stabilizable(changed, B[shuffled]))


def test_rounded_coordinates_still_show_the_hidden_mode():
    rng = np.random.default_rng(2)
    Q = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    A, B = Q @ np.diag([-1.0, -2.0, 3.0, -4.0]) @ Q.T, Q @ [[1.0], [1.0], [0.0], [1.0]]
    refused = is_stabilizable(A, B)
    assert not refused
    assert refused.modes[0].eigenvalue == pytest.approx(3)


@pytest.mark.shared
def test_the_benchmark_that_no_controller_stabilises(shared):
    data = np.load(shared / "data" / "compleib" / "compleib24.npz")
    refused = is_stabilizable(data["REA4/A"], data["REA4/B"])
    assert [mode.eigenvalue for mode in refused.modes] == pytest.approx([0.6065])
    names = {key.split("/")[0] for key in data.files} - {"REA4"}
    assert all(is_stabilizable(data[f"{n}/A"], data[f"{n}/B"]) for n in names)
    assert all(is_detectable(data[f"{n}/A"], data[f"{n}/C"]) for n in names)


def test_systems_keep_their_names():
    G = control.ss(np.diag([-1.0, 2.0]), [[1.0], [0.0]], [[1.0, 1.0]], 0, states=["a", "b"])
    assert controllability(G).deficient[0].state == "b"
    assert observability(G)


def test_bad_input_is_refused():
    with pytest.raises(InvalidInputError, match=r"B: got shape \(3, 1\)"):
        controllability(np.eye(2), np.ones((3, 1)))
    with pytest.raises(InvalidInputError, match=r"states: .*expected 2 names"):
        controllability(np.eye(2), np.ones((2, 1)), states=["only one"])
    with pytest.raises(InvalidInputError, match="system: got ndarray"):
        observability(np.eye(2))
    with pytest.raises(InvalidInputError, match=r"A: got nan"):
        controllability([[np.nan]], [[1.0]])
    with pytest.raises(InvalidInputError, match="C: got a matrix beside a system"):
        observability(control.ss([[-1]], [[1]], [[1]], 0), [[1.0]])


# Distances.


def modes_of(A, B, tolerance=None, discrete=False):
    test = controllability(A, B, tolerance=tolerance, dt=discrete)
    return sorted(test.modes, key=lambda mode: mode.eigenvalue.real)


def test_the_exact_answer_does_not_depend_on_the_tolerance():
    modes = modes_of([[1, 0], [1, -2]], [[0], [1]], tolerance=0.0)
    assert [mode.deficient for mode in modes] == [False, True]
    unreachable = modes[1]
    assert (unreachable.eigenvalue, unreachable.distance, unreachable.stable) == (1, 0.0, False)


def test_almost_equal_modes_under_one_input_are_almost_unreachable():
    near = modes_of([[-1, 0], [0, -1.001]], [[1], [1]])
    far = modes_of([[-1, 0], [0, -2]], [[1], [1]])
    assert 0 < near[0].distance < 0.01 * far[0].distance
    assert not near[0].deficient


def test_a_pair_is_told_once_and_stability_by_the_side():
    modes = modes_of([[0, 1], [-4, 0]], [[0], [1]])
    assert len(modes) == 1
    assert modes[0].eigenvalue == pytest.approx(2j)
    assert not modes[0].stable
    assert modes_of([[0.5]], [[1]], discrete=True)[0].stable
    assert not modes_of([[-1.0]], [[1]], discrete=True)[0].stable
