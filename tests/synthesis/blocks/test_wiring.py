"""Wired blocks give the transfer functions that they say, in the plant's units."""

import math

import numpy as np
import pytest
from three_loops import blocks, plant

from robustpolish.synthesis.problem.scaling import scale_plant
from robustpolish.synthesis.structured.block_wiring import block_parametrisation, place_blocks

S, W = 2.3j, 2 * math.pi


def test_series_and_sums():
    P = plant()
    placement, scaled = place_blocks(blocks(), P), scale_plant(P)
    gain = block_parametrisation(placement, scaled)
    theta = 0.3 * np.random.default_rng(2).normal(size=gain.size)
    M, n = gain.gain(theta), len(gain.leave) - P.nu
    pencil = S * scaled.time * np.eye(n) - M[:n, :n]
    K = M[n:, :n] @ np.linalg.solve(pencil, M[:n, n:]) + M[n:, n:]
    K = scaled.output_gain(np.ones((2, 3))) * K
    v = dict(zip([n.key for n in placement.numbers], gain.numbers(theta), strict=True))

    w, d, b = (v[f"notch_x.{name}"] for name in ("frequency_hz", "depth", "width"))
    notch = (S**2 + d * b * W * w * S + (W * w) ** 2) / (S**2 + b * W * w * S + (W * w) ** 2)
    f, z = W * v["low_pass_x.frequency_hz"], v["low_pass_x.damping"]
    pid = v["k"] + v["pid_x.Ki"] / S + v["pid_x.Kd"] * S / (v["pid_x.Tf"] * S + 1)
    first = pid * notch * f**2 / (S**2 + 2 * z * f * S + f**2)
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
