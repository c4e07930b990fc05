"""Norms of loops with known peaks, and what speaks against a loop."""

import control
import numpy as np
import pytest

from robustpolish.synthesis.proofs.achieved_norm import achieved_h2, achieved_hinf


def oscillators(frequencies, damping):
    """Return decoupled resonances with a static gain of one each."""
    blocks = [np.array([[0.0, 1.0], [-(w**2), -2 * damping * w]]) for w in frequencies]
    n = len(blocks)
    A, B, C = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, n)), np.zeros((n, 2 * n))
    for i, (block, w) in enumerate(zip(blocks, frequencies, strict=True)):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = block
        B[2 * i + 1, i], C[i, 2 * i] = w**2, 1.0
    return control.StateSpace(A, B, C, np.zeros((n, n)))


# From 12 states on exact arithmetic is left out at first, from 60 on altogether.
@pytest.mark.parametrize("count", [1, 8, 31])
def test_the_peak_of_a_resonance(count):
    damping, reasons = 0.01, []
    loop = oscillators(np.linspace(30.0, 50.0, count), damping)
    # The weakest of the resonances is doubled, so that it is the one that counts.
    loop = control.StateSpace(loop.A, loop.B, np.diag([2.0] + [1.0] * (count - 1)) @ loop.C, loop.D)
    norm, frequency = achieved_hinf(loop, loop, 1e-12, reasons)
    assert norm == pytest.approx(1 / (damping * np.sqrt(1 - damping**2)), rel=1e-6)
    assert frequency == pytest.approx(30.0 * np.sqrt(1 - 2 * damping**2), rel=1e-4)
    assert reasons == []


@pytest.mark.parametrize(("pole", "where"), [(0.5, 0.0), (-0.5, np.pi / 0.02)])
def test_a_sampled_lag_peaks_at_zero_or_at_the_nyquist_frequency(pole, where):
    reasons = []
    loop = control.StateSpace([[pole]], [[1.0]], [[1.0]], [[0.0]], 0.02)
    assert achieved_hinf(loop, loop, 1e-12, reasons) == pytest.approx((2.0, where))
    assert reasons == []


def test_what_rounding_does_to_a_loop_counts():
    loop, reasons = oscillators([1.0], 0.1), []
    plain, _ = achieved_hinf(loop, loop, 1e-12, reasons)
    larger, _ = achieved_hinf(loop, 1.004 * loop, 1e-12, reasons)
    assert larger == pytest.approx(1.004 * plain, rel=1e-6)
    # Rounding may even move the poles to the other side, where only the response can be compared.
    unstable = oscillators([1.0], -0.1 / 1.004)
    larger, _ = achieved_hinf(loop, unstable, 1e-12, reasons)
    assert larger == pytest.approx(1.004 * plain, rel=1e-3)
    assert reasons == []
    achieved_hinf(loop, 1.1 * loop, 1e-12, reasons)
    assert len(reasons) == 1
    assert "in doubles its norm is 5.52771 instead of 5.02519" in reasons[0]


def test_an_unstable_loop_has_no_norm():
    loop, reasons = control.StateSpace([[1.0]], [[1.0]], [[1.0]], [[0.0]]), []
    assert achieved_hinf(loop, loop, 1e-12, reasons) == (np.inf, None)
    assert reasons[0].startswith("the H-infinity norm could not be computed: ")


def test_energy_of_a_lag_and_of_a_feedthrough():
    reasons = []
    lag = control.StateSpace([[-8.0]], [[1.0]], [[6.0]], [[0.0]])
    assert achieved_h2(lag, reasons) == pytest.approx(6 / np.sqrt(2 * 8), rel=1e-6)
    assert reasons == []
    assert achieved_h2(control.StateSpace(lag.A, lag.B, lag.C, 1e-9), reasons) == np.inf
    assert reasons[0].startswith("the H2 norm is not finite: ")
