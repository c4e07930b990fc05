"""The stability decision at and around the boundary."""

import control
import numpy as np
import pytest

from robustpolish.linear.stability import stability


def ss(A, dt=0):
    n = len(A)
    return control.StateSpace(
        A, np.zeros((n, 1)), np.zeros((1, n)), 0, dt, remove_useless_states=False
    )


@pytest.mark.parametrize("rate", [1e-9, 1.0, 1e17])
@pytest.mark.parametrize(("damping", "verdict"), [(1, "stable"), (0, "marginal"), (-1, "unstable")])
def test_a_damping_ratio_far_below_rounding_is_decided(rate, damping, verdict):
    w = float(2.0 ** np.round(np.log2(rate)))  # so that w * w is exact
    A = np.array([[0, w], [-w, -damping * 1e-25 * w]])
    result = stability(ss(A))
    assert result.verdict == verdict
    assert bool(result) is (verdict == "stable")
    assert result.exact


@pytest.mark.parametrize("dt", [0, 1.0])
def test_defective_poles_at_the_boundary(dt):
    jordan = np.diag(np.ones(3), 1)
    edge = 1.0 if dt else 0.0
    for shift, verdict in ((-1e-10, "stable"), (0, "marginal"), (1e-10, "unstable")):
        assert stability(ss(jordan + (edge + shift) * np.eye(4), dt)).verdict == verdict


def test_poles_at_minus_one_are_on_the_circle():
    assert stability(ss(np.diag([-1.0, 0.5]), True)).pole == -1
    assert stability(ss(np.diag([-1.0, 0.5]), True)).verdict == "marginal"


def test_symmetric_real_pairs_are_not_taken_for_axis_poles():
    result = stability(ss(np.diag([1e-18, -1e-18, -1.0])))
    assert result.verdict == "unstable"
    assert result.pole == pytest.approx(1e-18)


def test_without_states():
    system = control.StateSpace([], [], [], [[1.0]])
    assert stability(system)
    assert stability(system).pole is None
