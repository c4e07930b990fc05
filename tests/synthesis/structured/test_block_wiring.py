"""Wired blocks give the transfer functions that they say, with gradients, limits and starts."""

import math
from itertools import islice

import control
import numpy as np
import pytest
from three_loops import blocks, plant

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.errors import InfeasibleError
from robustpolish.synthesis.problem.preflight import scale_plant, whole_plant
from robustpolish.synthesis.structured.block_structure import BlockStructure
from robustpolish.synthesis.structured.block_wiring import (
    block_parametrisation,
    place_blocks,
)

S, W, INF = 2.3j, 2 * math.pi, math.inf
pid, tunable = rp.tunable.pid, rp.tunable.tunable


def response(placement, scaled, gain, theta):
    """K at S in the plant's units."""
    M, n = gain.gain(theta), len(gain.leave) - scaled.original.nu
    pencil = S * scaled.time * np.eye(n) - M[:n, :n]
    K = M[n:, :n] @ np.linalg.solve(pencil, M[:n, n:]) + M[n:, n:]
    return scaled.output_gain(np.ones(K.shape)) * K


def test_series_and_sums():
    P = plant()
    placement, scaled = place_blocks(blocks(), P), scale_plant(P)
    gain = block_parametrisation(placement, scaled)
    theta = 0.3 * np.random.default_rng(2).normal(size=gain.size)
    K = response(placement, scaled, gain, theta)
    v = dict(zip([n.key for n in placement.numbers], gain.numbers(theta), strict=True))

    w, d, b = (v[f"notch_x.{name}"] for name in ("frequency_hz", "depth", "width"))
    notch = (S**2 + d * b * W * w * S + (W * w) ** 2) / (S**2 + b * W * w * S + (W * w) ** 2)
    f, z = W * v["low_pass_x.frequency_hz"], v["low_pass_x.damping"]
    first = v["k"] + v["pid_x.Ki"] / S + v["pid_x.Kd"] * S / (v["pid_x.Tf"] * S + 1)
    first = first * notch * f**2 / (S**2 + 2 * z * f * S + f**2)
    assert K[0, 0] == pytest.approx(first + v["gain.gain[0,0]"])

    lead = (1 + S / W / v["lead_lag_v.zero_hz"]) / (1 + S / W / v["lead_lag_v.pole_hz"])
    lag = 1 / (1 + S / W / v["low_pass_v.frequency_hz"])
    assert K[1, 1] == pytest.approx(v["k"] * lead * lag * (S + 2) / (S + 5))

    A, B, C, D = (
        np.array([[v[f"fixed_order_p.{m}[{i},{j}]"] for j in range(c)] for i in range(2)])
        for m, c in (("A", 2), ("B", 1), ("C", 2), ("D", 1))
    )
    free = -(C @ np.linalg.solve(S * np.eye(2) - A, B) + D)[:, 0]
    free = free * (v["pid_p.Kp"] + v["pid_p.Ki"] / S)
    assert K[:, 2] == pytest.approx(free + np.array([0.0, v["gain.gain[1,1]"]]))
    assert K[0, 1] == 0


@pytest.mark.parametrize("kind", ["P", "I", "D", "PI", "pd", "ID", "PID"])
def test_each_kind_of_pid_has_its_terms(kind):
    P = plant()
    placement, scaled = place_blocks(pid("x", "F", kind), P), scale_plant(P)
    gain = block_parametrisation(placement, scaled)
    theta = 0.3 * np.random.default_rng(2).normal(size=gain.size)
    v = dict(zip([n.slot.name for n in placement.numbers], gain.numbers(theta), strict=True))
    expected = v.get("Kp", 0) + v.get("Ki", 0) / S
    expected += v.get("Kd", 0) * S / (v.get("Tf", 1) * S + 1)
    assert response(placement, scaled, gain, theta)[0, 0] == pytest.approx(expected)


def test_back_is_the_gradient():
    P = plant()
    more = [pid("x", "M", "PD"), pid("v", "F", "ID")]
    placement = place_blocks([*blocks(), *more], P)
    gain = block_parametrisation(placement, scale_plant(P))
    rng = np.random.default_rng(1)
    theta = 0.3 * rng.normal(size=gain.size)
    theta[[n.key for n in placement.numbers].index("notch_x.depth")] = 0.4  # inside its limits
    weights = rng.normal(size=gain.gain(theta).shape)
    step = 1e-6
    slopes = [
        np.sum(weights * (gain.gain(theta + step * e) - gain.gain(theta - step * e))) / (2 * step)
        for e in np.eye(gain.size)
    ]
    assert gain.back(theta, weights) == pytest.approx(np.array(slopes), rel=1e-6, abs=1e-8)


def loop(numerator, denominator=(1.0, 0.4, 4.0)):
    G = control.tf(numerator, list(denominator), inputs="F", outputs="x")
    return rp.GeneralizedPlant.from_loop(G, units={"F": "N", "x": "m"})


def problem(P, given, norm="hinf", **initial):
    return BlockStructure(norm, place_blocks(given, P), None, initial).problem(whole_plant(P))


def started(block, initial=None):
    """Numbers of forty starts for a plant of second order."""
    found = problem(loop([3.0]), block, **(initial or {}))
    drawn = islice(found.starts[0](Budget(), np.random.default_rng(0)), 40)
    return np.array([found.parametrisation.numbers(theta) for theta in drawn])


def test_given_values_come_first_and_are_not_forgotten():
    Kp = tunable("Kp", 7.0, low=1.0, high=9.0)
    found = started(pid(kind="PI", Kp=Kp), {"pid_x.Ki": -0.3})
    assert found[0] == pytest.approx([7.0, -0.3])
    assert (found[:, 0] >= 1.0).all()
    assert (found[:, 0] <= 9.0).all()
    assert np.ptp(found[:, 0]) > 1.0


def test_integrators_that_no_number_stabilises_are_refused():
    with pytest.raises(InfeasibleError, match=r"integrators of pid_x: .* a mode at 0"):
        problem(loop([1.0, 0.0]), pid("x"))
    with pytest.raises(InfeasibleError, match="integrators of pid_x and pid_x_F"):
        problem(loop([1.0]), [pid("x", kind="I"), pid("x", kind="PI")])


def test_modes_that_blocks_do_not_reach_are_named():
    A = np.diag([1.0, -1.0])
    G = control.StateSpace(A, np.eye(2), np.eye(2), 0, inputs=["a", "b"], outputs=["p", "q"])
    with pytest.raises(InfeasibleError, match="no gain moves the mode"):
        problem(rp.GeneralizedPlant.from_loop(G), pid("q", "b"))


def test_feedthrough_and_the_h2_norm():
    matrices = [[-1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]]
    P = rp.GeneralizedPlant.from_matrices(*matrices, D12=[[0.0], [1.0]], D21=[[0.0, 1.0]])
    with pytest.raises(InfeasibleError, match=r"The blocks pass .*low_pass\(\) in series"):
        problem(P, pid(), "h2")
    assert problem(P, pid() * rp.tunable.low_pass(order=1), "h2").order == 3
    with pytest.raises(InfeasibleError, match=r"passes w straight to z \(D11\)"):
        problem(loop([1.0]), pid("x") * rp.tunable.low_pass(), "h2")
