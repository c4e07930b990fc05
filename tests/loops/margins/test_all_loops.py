"""Margins of several loops at once: the satellite, python-control, delays that do the worst."""

import control
import numpy as np
import pytest

from robustpolish.loops.loop import loop_of
from robustpolish.loops.margins import simultaneous_margins
from robustpolish.loops.response import SystemResponse
from tests.loops.loops_for_tests import SATELLITE, TEXTBOOK, delayed_poles, random_loop


def test_the_satellite_bears_everything_alone_and_little_together():
    loop = loop_of(SATELLITE, -np.eye(2))
    inputs, both = (simultaneous_margins(loop, where) for where in ("inputs", "inputs and outputs"))
    # Seiler, Packard and Gahinet 2020: 0.0997 and 0.0499
    assert inputs.disk.alpha == pytest.approx(0.09975, rel=2e-3)
    assert both.disk.alpha == pytest.approx(0.04984, rel=2e-3)
    assert inputs.disk.proven
    assert both.disk.proven
    assert both.signals == ("u[0]", "u[1]", "y[0]", "y[1]")


def test_one_loop_is_all_of_them():
    found = simultaneous_margins(loop_of(TEXTBOOK, -1), "outputs")
    alpha, gain_db, phase = control.disk_margins(TEXTBOOK, np.linspace(0.5, 1.5, 20001))
    assert found.disk.alpha == pytest.approx(alpha, rel=2e-3)
    assert found.disk.gain_db == pytest.approx(gain_db, rel=2e-3)
    assert found.disk.phase_deg == pytest.approx(phase, rel=2e-3)
    assert found.common_delay_s == pytest.approx(0.7595810246)
    assert found.any_delay_s == pytest.approx(found.common_delay_s, rel=0.02)
    assert found.any_delay_s <= found.common_delay_s


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("where", ["inputs", "outputs"])
def test_the_disk_agrees_with_a_fine_grid(seed, where):
    loop = loop_of(*random_loop(seed))
    found = simultaneous_margins(loop, where)
    place = where[:-1]
    L = loop.opened(place)
    grid = np.logspace(-3, 4, 3001)
    alpha = control.disk_margins(L, grid)[0]
    assert found.disk.proven
    assert found.disk.alpha <= alpha * (1 + 1e-4)
    assert found.disk.alpha >= alpha * 0.98


@pytest.mark.parametrize("seed", range(3))
def test_common_delay_is_the_edge_and_any_delays_are_safe(seed):
    plant, controller = random_loop(seed)
    loop = loop_of(plant, controller)
    found = simultaneous_margins(loop, "inputs")

    def worst(delays):
        lags = [control.ss(control.tf(*control.pade(delay, 6))) for delay in delays]
        return control.feedback(plant * control.append(*lags), controller, 1).poles().real.max()

    assert worst([0.98 * found.common_delay_s] * 2) < 0 < worst([1.02 * found.common_delay_s] * 2)
    assert 0 < found.any_delay_s <= found.common_delay_s
    rng = np.random.default_rng(seed)
    for _ in range(20):
        delays = found.any_delay_s * np.maximum(rng.integers(0, 2, 2), rng.random(2))
        assert worst(np.maximum(delays, 1e-3 * found.any_delay_s)) < 0


def test_the_satellite_by_delays():
    found = simultaneous_margins(loop_of(SATELLITE, -np.eye(2)), "inputs")
    for share, stable in ((0.98, True), (1.02, False)):
        poles = delayed_poles(SATELLITE, -np.eye(2), [share * found.common_delay_s] * 2)
        assert bool(poles.real.max() < 0) is stable


def test_gain_without_end_bears_no_delay():
    plant = control.ss([[-1.0]], [[1.0]], [[1.0]], [[2.0]])
    found = simultaneous_margins(loop_of(plant, -1), "inputs")
    assert (found.common_delay_s, found.any_delay_s) == (0.0, 0.0)
    quiet = simultaneous_margins(loop_of(control.tf([1], [1, 3]), -1), "inputs")
    assert (quiet.common_delay_s, quiet.any_delay_s) == (np.inf, np.inf)


@pytest.mark.parametrize("gain", [1e3, 1e9])
def test_a_crossover_far_above_the_plant_counts(gain):
    found = simultaneous_margins(loop_of(control.tf([gain], [1, 1]), -1), "inputs")
    assert found.common_delay_s == pytest.approx(np.pi / 2 / gain, rel=2e-3)
    assert found.any_delay_s == pytest.approx(found.common_delay_s, rel=0.02)
    assert found.any_delay_s < found.common_delay_s


def test_small_loops_with_a_resonance_above_their_poles():
    # The slow part is small; a mode at 1e4 rad/s rises to 1.5 beyond it.
    mode = control.tf([30.0, 0], [1, 20.0, 1e8])
    found = simultaneous_margins(loop_of(mode + control.tf([0.1], [1, 1]), -1), "inputs")
    assert found.any_delay_s <= found.common_delay_s < 1e-3
    assert found.any_delay_s > 0.5 * found.common_delay_s


def test_discrete_loops_too():
    A, B, C = np.diag([0.9, 0.5]), np.eye(2), np.array([[1.0, 0.4], [0.2, 1.0]])
    loop = loop_of(control.ss(A, B, C, 0, 0.01), -0.3 * np.eye(2))
    found = simultaneous_margins(loop, "inputs")
    alpha = control.disk_margins(loop.opened("input"), np.linspace(0, np.pi / 0.01, 4001))[0]
    assert found.disk.alpha == pytest.approx(alpha, rel=3e-3)
    assert 0 < found.any_delay_s <= found.common_delay_s
    response = SystemResponse(loop.opened("input"))
    assert response.highest == pytest.approx(np.pi / 0.01)
