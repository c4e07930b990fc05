"""The highest peak and its rivals, on loops whose peaks are known."""

import control
import numpy as np
import pytest
from random_loops import random_loop, scalar_loop

from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.synthesis.nonsmooth.measures import LoopResponse, highest_peak, local_peaks
from robustpolish.synthesis.problem.matrices import PlantMatrices, close_static_loop


def response(loop):
    return LoopResponse(close_static_loop(loop, np.zeros((loop.nu, loop.ny))))


@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_finds_the_norm_of_large_loops(discrete, seed):
    loop = random_loop(np.random.default_rng(seed), discrete, n=24)
    norm, peak = highest_peak(response(loop), [])
    system = control.StateSpace(loop.A, loop.B1, loop.C1, loop.D11, discrete)
    assert norm == pytest.approx(float(hinf_norm(system)), rel=1e-6)
    assert np.isfinite(peak)


def test_a_lag_peaks_at_rest_and_a_lead_at_infinity():
    assert highest_peak(response(scalar_loop(A=-2.0)), []) == (pytest.approx(0.5), 0.0)
    lead = scalar_loop(A=-1.0, C1=-1.0, D11=2.0)
    assert highest_peak(response(lead), []) == (2.0, np.inf)


def test_a_resonance_is_found_above_a_level_only():
    zeta, omega = 0.01, 3.0
    A = np.array([[0.0, 1.0], [-(omega**2), -2 * zeta * omega]])
    B, C, none = np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]), np.zeros((1, 1))
    loop = PlantMatrices(A, B, B, C, C, none, none, none, none)
    top = omega * np.sqrt(1 - 2 * zeta**2)
    norm, peak = highest_peak(response(loop), [])
    assert (norm, peak) == (
        pytest.approx(1 / (2 * zeta * np.sqrt(1 - zeta**2) * omega**2)),
        pytest.approx(top, rel=1e-5),
    )
    assert local_peaks(response(loop), 0.9 * norm) == pytest.approx([top], rel=1e-4)
    assert local_peaks(response(loop), 1.1 * norm) == []
