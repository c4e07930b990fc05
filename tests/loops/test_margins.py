"""Margins and bandwidths: closed forms, python-control, delays that do the worst."""

import math

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.loops.disk_margins import DiskMargin, decibel
from robustpolish.loops.loop import loop_of
from robustpolish.loops.margins import best_scales, margins_of, simultaneous_margins
from tests.loops.loops_for_tests import (
    CONDITIONAL,
    SATELLITE,
    TEXTBOOK,
    delayed_poles,
    random_loop,
    s,
    satellite,
)


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
    grid = np.logspace(-1, 5, 2001)
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


def test_gain_and_phase_of_a_disk():
    disk = DiskMargin(0.5, 1.0, True)
    low, high = disk.gain
    assert (low, high) == (pytest.approx(0.6), pytest.approx(1 / 0.6))
    cosine = (1 + low * high) / (low + high)  # Seiler, Packard and Gahinet, (8)
    assert disk.phase_deg == pytest.approx(math.degrees(math.acos(cosine)))
    assert disk.gain_db == pytest.approx(20 * math.log10(high))


def test_a_half_plane_and_more():
    assert DiskMargin(2.0, 1.0, True).gain == (0.0, math.inf)
    assert DiskMargin(2.0, 1.0, True).phase_deg == pytest.approx(90)
    assert DiskMargin(3.0, 1.0, True).phase_deg > 90
    assert DiskMargin(math.inf, math.nan, True).phase_deg == 180
    assert (decibel(0), decibel(math.inf)) == (-math.inf, math.inf)


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
    alpha, gain_db, phase = control.disk_margins(TEXTBOOK, np.linspace(0.5, 1.5, 2001))
    assert found.disk.alpha == pytest.approx(alpha, rel=2e-3)
    assert found.disk.gain_db == pytest.approx(gain_db, rel=2e-3)
    assert found.disk.phase_deg == pytest.approx(phase, rel=2e-3)
    assert found.common_delay_s == pytest.approx(0.7595810246)
    assert found.any_delay_s == pytest.approx(found.common_delay_s, rel=0.02)
    assert found.any_delay_s <= found.common_delay_s


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("where", ["inputs", "outputs"])
def test_the_disk_agrees_with_a_fine_grid(seed, where):
    loop = loop_of(*random_loop(seed))
    found = simultaneous_margins(loop, where)
    place = where[:-1]
    L = loop.opened(place)
    grid = np.logspace(-3, 4, 1001)
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


def late_loop(seed, order=3):
    system, K = random_loop(seed)
    plant = rp.GeneralizedPlant.from_loop(system)
    tau = 0.4 * simultaneous_margins(loop_of(system, K), "inputs").any_delay_s
    for i, name in enumerate(plant.control_names):
        plant = plant.with_delay(name, tau / (i + 1), order=order)
    return loop_of(plant, K)


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
    values = loop.response_around(at, 2.0, 1.0).at(np.linspace(1e-4, 20, 5000))
    peak = max(best_scales(value)[0] for value in values)
    assert disk.proven
    assert 0.998 * 2 / peak <= disk.alpha <= 2 / peak


def test_a_second_order_loop():
    # S = s (s + 1.4) / (s^2 + 1.4 s + 1), T = 1 / (s^2 + 1.4 s + 1)
    L = control.tf([1], [1, 1.4, 0])
    (at_input, at_output) = rp.loop_analysis(L, -1).bandwidths
    x = (-(1.4**2 - 2) + np.sqrt((1.4**2 - 2) ** 2 + 4)) / 2  # |T|^2 = 1/2
    assert at_input.complementary_hz == pytest.approx(np.sqrt(x) / (2 * np.pi), rel=1e-9)
    cross = (-(1.4**2) + np.sqrt(1.4**4 + 4)) / 2
    assert at_input.crossover_hz == pytest.approx(np.sqrt(cross) / (2 * np.pi), rel=1e-9)
    omega = at_input.sensitivity_hz * 2 * np.pi
    S = 1 / (1 + L(1j * omega))
    assert abs(S) == pytest.approx(1 / np.sqrt(2), rel=1e-9)
    assert omega < np.sqrt(cross)
    assert at_output.complementary_hz == pytest.approx(at_input.complementary_hz)
    assert at_input.peak_s == pytest.approx(rp.loop_analysis(L, -1).input.peaks["S"].value)


def test_loops_without_a_bandwidth():
    weak = rp.loop_analysis(control.tf([0.1], [1, 1]), -1).bandwidths[0]
    assert np.isnan([weak.crossover_hz, weak.sensitivity_hz, weak.complementary_hz]).all()
    endless = rp.loop_analysis(control.ss([], [], [], [[9.0]]), -1).bandwidths[0]
    assert endless.complementary_hz == np.inf


def test_all_signals_together_by_the_largest_singular_value():
    rows = satellite().bandwidths
    assert [row.name for row in rows] == ["u[0]", "u[1]", "all", "y[0]", "y[1]", "all"]
    # Skogestad and Postlethwaite: the peaks of S and T are 10.05
    assert rows[2].peak_t == pytest.approx(np.sqrt(101), rel=1e-6)
    assert rows[2].peak_s == pytest.approx(10.05, abs=0.01)


def test_discrete_bandwidth_stays_below_nyquist():
    row = rp.loop_analysis(control.tf([0.5], [1, -1], 0.1), -1).bandwidths[0]
    z = np.exp(1j * row.complementary_hz * 2 * np.pi * 0.1)
    assert abs(0.5 / (z - 0.5)) == pytest.approx(1 / np.sqrt(2))
