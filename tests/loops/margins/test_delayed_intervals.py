"""Intervals of loops with exact delays: right where they are laid, and disks of several signals."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.loops.disk_margins import DelayedIntervals
from robustpolish.loops.loop import loop_of
from robustpolish.loops.margins import simultaneous_margins
from robustpolish.loops.scaled_peak import best_scales
from tests.loops.loops_for_tests import random_loop


def late_loop(seed, order=3):
    system, K = random_loop(seed)
    plant = rp.GeneralizedPlant.from_loop(system)
    tau = 0.4 * simultaneous_margins(loop_of(system, K), "inputs").any_delay_s
    for i, name in enumerate(plant.control_names):
        plant = plant.with_delay(name, tau / (i + 1), order=order)
    return loop_of(plant, K)


def closed(loop, at):
    every = np.eye(loop.plant.nu + loop.plant.ny)
    return DelayedIntervals.of_loop(loop.delayed, every, every[at].T, (every[at], every[at]))


def test_values_are_those_of_the_loop():
    loop = late_loop(1)
    at = loop.at("output")
    intervals = closed(loop, at)
    for omega in (1e-3, 0.7, 40.0):
        S = loop.delayed.closed(np.array([omega]))[0][np.ix_(at, at)]
        np.testing.assert_allclose(intervals.response(omega), 2 * S - np.eye(2), atol=1e-12)


@pytest.mark.parametrize("omega", [0.0, 0.3, 2.0, 30.0, np.inf])
@pytest.mark.parametrize("share", [1.05, 1.5])
def test_nothing_within_an_interval_reaches_the_level(omega, share):
    loop = late_loop(2)
    intervals = closed(loop, loop.at("input"))
    at = 1e6 if np.isinf(omega) else omega
    value, scales = best_scales(intervals.response(at))
    first, last = intervals.around(omega, scales, share * value)
    assert first < last
    inside = np.linspace(first, min(last, 10 * first + 10), 301)
    sizes = [np.linalg.norm(intervals.response(w) * scales[:, None] / scales, 2) for w in inside]
    assert max(sizes) < share * value


@pytest.mark.parametrize("where", ["inputs", "outputs", "inputs and outputs"])
def test_disks_do_not_depend_on_the_order_of_models(where):
    one, other = (simultaneous_margins(late_loop(3, order), where) for order in (1, 6))
    assert one.disk.proven
    assert one.disk.alpha == pytest.approx(other.disk.alpha, rel=2e-3)
    assert one.any_delay_s == pytest.approx(other.any_delay_s, rel=2e-2)


def test_delays_of_many_turns_leave_no_peak_out():
    plant = rp.GeneralizedPlant.from_loop(
        control.ss([[-1, 0.3], [0.2, -2]], np.eye(2), np.eye(2), 0)
    )
    for name, seconds in zip(plant.control_names, (3.0, 5.0), strict=True):
        plant = plant.with_delay(name, seconds)
    loop = loop_of(plant, -np.diag([0.3, 0.4]))
    disk = simultaneous_margins(loop, "outputs").disk
    at = loop.at("output")
    values = 2 * loop.delayed.closed(np.linspace(1e-4, 20, 5000))[:, at][:, :, at] - np.eye(2)
    peak = max(best_scales(value)[0] for value in values)
    assert disk.proven
    assert 0.998 * 2 / peak <= disk.alpha <= 2 / peak
