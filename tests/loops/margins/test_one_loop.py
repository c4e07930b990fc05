"""Margins at one signal: closed forms, python-control, conditional and unstable loops, delays."""

import control
import numpy as np
import pytest

from robustpolish.loops.loop import loop_of
from robustpolish.loops.margins import margins_of
from tests.loops.loops_for_tests import CONDITIONAL, TEXTBOOK, random_loop, s


def margins(plant, controller=-1, place="input", signal=0):
    return margins_of(loop_of(plant, controller), place, signal)


def test_a_textbook_loop():
    found = margins(TEXTBOOK)
    gain, phase, modulus, at_phase, at_gain, _ = control.stability_margins(TEXTBOOK)
    assert found.gain_up == pytest.approx(3.0, rel=1e-12)
    assert (found.gain_down, found.conditionally_stable) == (0.0, False)
    assert found.phase_deg == pytest.approx(phase, rel=1e-9)
    assert found.modulus == pytest.approx(modulus, rel=1e-6)
    assert found.phase_crossovers[0].frequency_hz == pytest.approx(np.sqrt(2) / (2 * np.pi))
    assert found.gain_crossovers[0].frequency_hz == pytest.approx(at_gain / (2 * np.pi))
    assert found.delay_s == pytest.approx(np.radians(phase) / at_gain, rel=1e-9)
    assert (gain, at_phase) == pytest.approx((3, np.sqrt(2)))


@pytest.mark.parametrize("rate", [1e-6, 1.0, 1e7])
def test_an_integrator_with_gain_bears_a_quarter_period(rate):
    found = margins(control.tf([rate], [1, 0]))
    assert found.delay_s == pytest.approx(np.pi / 2 / rate, rel=1e-12)
    assert (found.gain_up, found.gain_down, found.phase_deg) == (np.inf, 0.0, pytest.approx(90))
    assert found.disk.alpha == pytest.approx(2.0, rel=1e-8)


def test_a_lag_with_gain_has_a_closed_form():
    k = 5.0
    found = margins(control.tf([k], [1, 1]))
    omega = np.sqrt(k**2 - 1)
    assert found.gain_crossovers[0].frequency_hz == pytest.approx(omega / (2 * np.pi))
    assert found.delay_s == pytest.approx((np.pi - np.arctan(omega)) / omega, rel=1e-12)


def test_conditionally_stable_loops_have_a_lower_gain_margin():
    found = margins(CONDITIONAL)
    assert found.conditionally_stable
    assert 0 < found.gain_down < 1 < found.gain_up < np.inf
    for factor, stable in [(1.01, True), (0.99, False)]:
        poles = control.feedback(control.ss(CONDITIONAL * found.gain_down * factor), 1).poles()
        assert bool(poles.real.max() < 0) is stable
        poles = control.feedback(control.ss(CONDITIONAL * found.gain_up / factor), 1).poles()
        assert bool(poles.real.max() < 0) is stable
    assert "Less gain" in repr(found)


def test_an_unstable_plant_needs_its_gain():
    found = margins(control.tf([3], [1, -1]))
    assert found.gain_down == pytest.approx(1 / 3)
    assert (found.unstable_poles, found.conditionally_stable) == (1, False)
    omega = np.sqrt(8)
    assert found.delay_s == pytest.approx(np.arctan(omega) / omega)


def test_gain_at_all_frequencies_bears_no_delay():
    found = margins(control.ss([[-1.0]], [[1.0]], [[1.0]], [[2.0]]))
    assert found.delay_s == 0.0
    assert found.gain_up == np.inf
    small = margins(control.tf([1], [1, 3]))
    assert (small.delay_s, small.phase_deg, small.gain_crossovers) == (np.inf, np.inf, ())


@pytest.mark.parametrize("damping", [1e-3, 1e-6, 1e-9])
def test_a_lightly_damped_mode_that_grids_miss(damping):
    # The mode's peak of 5 makes its own crossovers, damping * omega apart.
    omega = 1234.5678
    mode = 10 * damping * omega * s / (s**2 + 2 * damping * omega * s + omega**2)
    found = margins(control.tf([50.0], [1, 10]) * 0.01 + mode)
    near = [
        c for c in found.gain_crossovers if abs(c.frequency_hz * 2 * np.pi - omega) < omega / 10
    ]
    assert len(near) == 2
    width = (near[1].frequency_hz - near[0].frequency_hz) * 2 * np.pi
    assert width == pytest.approx(2 * damping * omega * np.sqrt(24), rel=0.02)
    least = min(c.delay_s for c in near)
    assert found.delay_s == least
    exact = (np.pi - np.arctan(np.sqrt(24))) / omega
    assert least == pytest.approx(exact, rel=0.01)
    assert found.disk.proven


def test_the_disk_misses_no_sharp_peak():
    # A resonance of the wrong sign brings S close to its limit in a sliver of frequency.
    omega, damping = 123.456, 1e-7
    L = -1.6 * damping * omega * s / (s**2 + 2 * damping * omega * s + omega**2)
    found = margins(L)
    assert found.modulus == pytest.approx(0.2, rel=1e-6)
    grid = np.logspace(-1, 5, 20001)
    assert control.disk_margins(control.ss(L), grid)[0] > 1.5
    # S - T = (1 - L)/(1 + L) with L = -0.8 at the peak
    assert found.disk.alpha == pytest.approx(2 * 0.2 / 1.8, rel=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_every_margin_is_the_edge_of_stability(seed):
    plant, controller = random_loop(seed)
    loop = loop_of(plant, controller)
    for place in ("input", "output"):
        for i in range(2):
            found = margins_of(loop, place, i)
            L = found.loop
            for factor in (found.gain_up, found.gain_down):
                if 0 < factor < np.inf:
                    inner = 1 + (factor - 1) * 0.999
                    outer = 1 + (factor - 1) * 1.001
                    assert control.feedback(inner * L, 1).poles().real.max() < 0
                    assert control.feedback(outer * L, 1).poles().real.max() > 0
            for share, stable in ((0.98, True), (1.02, False)):
                if found.delay_s == np.inf:
                    break
                late = control.ss(control.tf(*control.pade(found.delay_s * share, 6)))
                assert bool(control.feedback(L * late, 1).poles().real.max() < 0) is stable
            assert found.disk.phase_deg <= found.phase_deg * (1 + 1e-9)
            assert found.disk.gain[1] <= found.gain_up * (1 + 1e-9)
            assert found.disk.gain[0] >= found.gain_down * (1 - 1e-9)


def test_discrete_loops():
    L = control.tf([0.5], [1, -1], 0.1)
    found = margins(L)
    # |z - 1| = 0.5, and L = -1 at z = -1 for a gain of 4
    omega = 2 * np.arcsin(0.25) / 0.1
    assert found.gain_crossovers[0].frequency_hz == pytest.approx(omega / (2 * np.pi))
    assert found.gain_up == pytest.approx(4.0)
    lag = np.pi - (np.pi / 2 + omega * 0.05)
    assert found.delay_s == pytest.approx(lag / omega)
    assert found.delay_samples == pytest.approx(lag / omega / 0.1)
    for samples, stable in ((2, True), (3, False)):
        assert samples < found.delay_samples if stable else samples > found.delay_samples
        late = control.tf([1], [1] + [0] * samples, 0.1)
        assert bool(abs(control.feedback(L * late, 1).poles()).max() < 1) is stable


def test_it_shows_and_draws_itself():
    found = margins(TEXTBOOK)
    assert "phase margin [deg]  32.61" in repr(found)
    ax = found.plot()
    assert ax.get_xlabel() == "real part of L"
    assert len(ax.patches) == 1  # the disk
