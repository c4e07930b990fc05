"""Wired blocks give the transfer functions that they say; what no number makes good is refused."""

import math

import control
import numpy as np
import pytest
from three_loops import blocks, plant

import robustpolish as rp
from robustpolish.errors import InfeasibleError
from robustpolish.synthesis.problem.preflight import scale_plant
from robustpolish.synthesis.structured.block_structure import block_parametrisation, place_blocks

S, W = 2.3j, 2 * math.pi
pid = rp.tunable.pid


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


def loop(numerator, denominator=(1.0, 0.4, 4.0)):
    G = control.tf(numerator, list(denominator), inputs="F", outputs="x")
    return rp.GeneralizedPlant.from_loop(G, units={"F": "N", "x": "m"})


def two_apart():
    A = np.diag([1.0, -1.0])
    G = control.StateSpace(A, np.eye(2), np.eye(2), 0, inputs=["a", "b"], outputs=["p", "q"])
    return rp.GeneralizedPlant.from_loop(G)


def direct():
    matrices = [[-1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]]
    return rp.GeneralizedPlant.from_matrices(*matrices, D12=[[0.0], [1.0]], D21=[[0.0, 1.0]])


@pytest.mark.parametrize(
    ("P", "given", "norm", "words"),
    [
        (loop([1.0, 0.0]), pid("x"), "hinf", "integrators of pid_x: .* a mode at 0"),
        (
            loop([1.0]),
            [pid("x", kind="I"), pid("x", kind="PI")],
            "hinf",
            "integrators of pid_x and pid_x_F",
        ),
        (two_apart(), pid("q", "b"), "hinf", "no gain moves the mode"),
        (direct(), pid(), "h2", r"The blocks pass .*low_pass\(\) in series"),
        (loop([1.0]), pid("x") * rp.tunable.low_pass(), "h2", r"passes w straight to z \(D11\)"),
    ],
)
def test_what_no_number_stabilises_and_infinite_norms_are_refused(P, given, norm, words):
    with pytest.raises(InfeasibleError, match=words):
        rp.structured_output_feedback(P, given, norm)
