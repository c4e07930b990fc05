"""Sampling rates: the rules, and exact stability of the sampled loop."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.loops.loop import loop_of
from robustpolish.loops.performance import lowest_stable_rate, sampled_poles
from robustpolish.loops.requirements import LoopRequirements
from tests.loops.loops_for_tests import random_loop


def test_an_integrator_with_gain():
    loop = loop_of(control.tf([1], [1, 0]), -10)
    assert lowest_stable_rate(loop, 0) == pytest.approx(5.0)  # 1 - K T = -1
    assert lowest_stable_rate(loop, 1) == pytest.approx(10.0)  # z^2 - z + K T
    assert lowest_stable_rate(loop, 2) > 10.0


@pytest.mark.parametrize("samples", [0, 1, 2])
def test_poles_are_those_of_python_control(samples):
    plant, controller = random_loop(3)
    period = 0.05
    found = sampled_poles(loop_of(plant, controller), period, samples)
    held = control.c2d(plant, period, "zoh")
    K = control.c2d(controller, period, "tustin")
    late = control.ss(control.tf([1], [1] + [0] * samples, period))
    K = control.append(late, late) * K if samples else K
    expected = control.feedback(held, K, 1).poles()
    np.testing.assert_allclose(np.sort(np.abs(found)), np.sort(np.abs(expected)), atol=1e-7)


def test_rules_have_their_numbers():
    asked = LoopRequirements(phase_loss_deg=10, delay_share=0.25)
    rate = rp.loop_analysis(control.tf([1], [1, 0]), -10, requirements=asked).sample_rate
    crossover = 10 / (2 * np.pi)
    assert rate.rules["phase at the gain crossover"] == pytest.approx(1.5 * 36 * crossover)
    assert rate.rules["delay margin"] == pytest.approx(1.5 / (0.25 * np.pi / 20))
    assert rate.rules["bandwidth"] == pytest.approx(20 * crossover)
    assert rate.rules["fastest closed-loop pole"] == pytest.approx(4 * 10 / 2.2)
    assert rate.needed_hz == max(rate.rules.values())
    assert rate.rules[rate.limited_by] == rate.needed_hz


def test_loops_that_any_or_no_rate_suits():
    quiet = rp.loop_analysis(control.tf([0.5], [1, 1]), -1).sample_rate
    assert quiet.lowest_stable_hz == 0.0
    static = rp.loop_analysis(control.ss([[-1.0]], [[1.0]], [[1.0]], [[2.0]]), -1)
    assert static.sample_rate.needed_hz == np.inf
    assert "No sampling is fast enough" in static.explain()
    assert rp.loop_analysis(control.tf([0.5], [1, -1], 0.1), -1).sample_rate is None
