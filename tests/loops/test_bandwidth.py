"""Bandwidths in Hz: closed forms, and loops that have none."""

import control
import numpy as np
import pytest

import robustpolish as rp
from tests.loops.loops_for_tests import SATELLITE


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
    rows = rp.loop_analysis(SATELLITE, -np.eye(2)).bandwidths
    assert [row.name for row in rows] == ["u[0]", "u[1]", "all", "y[0]", "y[1]", "all"]
    # Skogestad and Postlethwaite: the peaks of S and T are 10.05
    assert rows[2].peak_t == pytest.approx(np.sqrt(101), rel=1e-6)
    assert rows[2].peak_s == pytest.approx(10.05, abs=0.01)


def test_discrete_bandwidth_stays_below_nyquist():
    row = rp.loop_analysis(control.tf([0.5], [1, -1], 0.1), -1).bandwidths[0]
    z = np.exp(1j * row.complementary_hz * 2 * np.pi * 0.1)
    assert abs(0.5 / (z - 0.5)) == pytest.approx(1 / np.sqrt(2))
