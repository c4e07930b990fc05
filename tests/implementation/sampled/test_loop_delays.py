"""Delays that all signals round the loop meet: found, taken out, the rest kept."""

from typing import Any

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.implementation.sampled.lifting import without_loop_delay


def plant(controls=2):
    system: Any = control.ss(
        [[-1.0, 0.3], [0.0, -2.0]], np.eye(2)[:, :controls], np.eye(2), 0,
        inputs=["u", "v"][:controls], outputs=["x", "y"],
    )  # fmt: skip
    return rp.GeneralizedPlant.from_loop(system)


def test_what_all_have_in_common_is_taken_out():
    late = plant().with_delay(["u", "v"], 0.1).with_delay("v", 0.2)
    rest, seconds = without_loop_delay(late)
    assert seconds == pytest.approx(0.1)
    assert dict(rest.delays) == pytest.approx({"v": 0.2})
    omega = np.array([0.1, 0.7])
    u, v = plant().nw, plant().nw + 1
    before = late.frequency_response(omega).values
    after = rest.frequency_response(omega).values
    turn = np.exp(-2j * np.pi * omega * 0.1)[:, None]
    np.testing.assert_allclose(after[:, :, u] * turn, before[:, :, u], atol=1e-12)
    np.testing.assert_allclose(after[:, :, v] * turn, before[:, :, v], atol=1e-12)
    np.testing.assert_allclose(after[:, :, :u], before[:, :, :u], atol=1e-12)


def test_measurements_count_too():
    late = plant(1).with_delay("u", 0.1).with_delay(["x", "y"], 0.05)
    rest, seconds = without_loop_delay(late)
    assert seconds == pytest.approx(0.15)
    assert not rest.delays
    np.testing.assert_allclose(rest.system.A, plant(1).system.A)
    np.testing.assert_allclose(rest.system.D, plant(1).system.D)


def test_what_is_not_common_stays():
    assert without_loop_delay(plant().with_delay("u", 0.1))[1] == 0
    assert without_loop_delay(plant())[1] == 0
    inside = plant(1).with_delay("u", 0.1).with_actuator("u", 10.0)  # the delay is behind it
    assert without_loop_delay(inside)[1] == 0
    outside = plant(1).with_actuator("u", 10.0).with_delay("u", 0.1)
    assert without_loop_delay(outside)[1] == pytest.approx(0.1)
    weighted = plant(1).with_delay("u", 0.1).with_control_outputs()
    assert without_loop_delay(weighted)[1] == pytest.approx(0.1)
