"""Norms of loops: computed, bracketed in balls, and proven with the bits it takes."""

from pathlib import Path

import control
import numpy as np
import pytest
from published_plants import compleib

import robustpolish as rp
from robustpolish.linear.arithmetic import balls
from robustpolish.linear.arithmetic.balls import BallSystem
from robustpolish.synthesis.proofs.bounded_real import (
    BITS,
    enclose_loop,
    gain_at,
    precise_peak,
    prove_h2,
    prove_hinf,
    prove_stability,
)

# A computed norm, bracketed by a gain and a proof.


# What long arithmetic calls stable is proven, and nothing else.

HIGH_GAIN = Path(__file__).with_name("high_gain.npz")


def high_gain_loop():
    """Nine states drawn at random with a controller of entries of 6e5, whose norm is 6.9e-7."""
    data = np.load(HIGH_GAIN)
    plant = rp.GeneralizedPlant.from_matrices(
        *(data[name] for name in ("A", "B1", "B2", "C1", "C2"))
    )
    return plant, control.ss(*(data[name] for name in ("KA", "KB", "KC", "KD")))


def jordan_block(n, rate):
    """A chain of n equal lags in mixed states, exact in doubles; its norm is rate^-n."""
    rng = np.random.default_rng(n)
    L = np.tril(rng.integers(-1, 2, (n, n)), -1) + np.eye(n)
    back = np.round(np.linalg.inv(L))
    A = L @ (-rate * np.eye(n) + np.eye(n, k=1)) @ back
    return rp.GeneralizedPlant.from_matrices(
        A, L[:, -1:], np.zeros((n, 1)), back[:1], np.ones((1, n))
    )


def test_a_loop_whose_norm_rounding_changes_is_proven():
    certificate = rp.certify(*high_gain_loop())
    assert certificate.valid, certificate.reasons
    # With its matrices in doubles it has 6.8756e-7, below what holds for the loop as it is.
    assert certificate.achieved == pytest.approx(6.91546e-7, rel=1e-5)
    assert certificate.achieved < certificate.bound <= certificate.achieved * (1 + 1e-3)


@pytest.mark.parametrize(("pole", "where"), [(0.5, 0.0), (-0.5, np.pi / 0.02)])
def test_a_sampled_lag_peaks_at_zero_or_at_the_nyquist_frequency(pole, where):
    lag = rp.GeneralizedPlant.from_matrices([[pole]], [[1]], [[1]], [[1]], [[1]], dt=0.02)
    certificate = rp.certify(lag, [[0.0]])
    assert (certificate.achieved, certificate.peak_frequency) == pytest.approx((2.0, where))


def test_no_bits_prove_a_bound_below_the_gain():
    loop = enclose_loop(*high_gain_loop())
    gain, frequency = precise_peak(loop, 1.0)
    with balls.precision(480):
        assert gain_at(loop, frequency) == pytest.approx(gain, rel=1e-12)
    for bits in (240, 480):
        assert prove_hinf(loop, gain * (1 - 1e-9), bits=bits) is None
        assert prove_hinf(loop, gain * (1 + 1e-4), bits=bits) is not None
    rounded = rp.certify(*high_gain_loop(), "h2").achieved
    assert rounded <= prove_h2(loop, False, bits=240).bound <= rounded * (1 + 1e-5)


@pytest.mark.parametrize(("n", "rate"), [(6, 2.0**-5), (8, 2.0**-5), (10, 2.0**-6)])
def test_a_defective_loop_that_doubles_misjudge(n, rate):
    plant, none = jordan_block(n, rate), [[0.0]]
    assert n < 10 or np.linalg.eigvals(plant.A).real.max() > 0  # unstable, to doubles
    certificate = rp.certify(plant, none)
    assert certificate.valid, certificate.reasons
    assert certificate.bound == pytest.approx(rate**-n, rel=2e-3)
    assert rp.certify(plant, none, "h2").valid
    unstable = jordan_block(n, -(2.0**-30))
    loop = enclose_loop(unstable, control.ss([], [], [], none))
    assert not rp.certify(unstable, none).stable
    assert all(prove_stability(loop, bits) is None for bits in (None, 240, 480))


def test_a_discrete_loop_with_high_gain_is_proven():
    plant, controller = high_gain_loop()
    sampled = control.sample_system(plant.closed_loop(controller), 1e-7)
    n = sampled.nstates
    loop = rp.GeneralizedPlant.from_matrices(
        sampled.A, sampled.B, np.zeros((n, 1)), sampled.C, np.ones((1, n)), sampled.D, dt=1e-7
    )
    certificate = rp.certify(loop, [[0.0]])
    assert certificate.stable
    assert np.isfinite(certificate.bound), certificate.reasons


@pytest.mark.shared
def test_the_heat_exchanger_of_compleib_is_certified(shared):
    design = rp.output_feedback(compleib(shared, "IH"), time_limit=60)
    assert design.certificate.valid
    assert design.certificate.achieved < 1.2e-6


# Peaks too narrow for doubles, and the matrix that proves a norm below one.


def loop_of(A, B, C, D=None):
    C, B = np.atleast_2d(C), np.atleast_2d(B)
    D = np.zeros((len(C), B.shape[1])) if D is None else D
    return BallSystem.of(control.StateSpace(A, B, C, D))


@pytest.mark.parametrize("damping", [0.3, 1e-6, 1e-13])
def test_the_peak_of_a_resonance_far_from_the_start(damping):
    loop = loop_of([[0.0, 1.0], [-1.0, -2 * damping]], [[0.0], [1.0]], [[1.0, 0.0]])
    gain, frequency = precise_peak(loop, 0.9)
    assert gain == pytest.approx(1 / (2 * damping * np.sqrt(1 - damping**2)), rel=2e-5)
    assert frequency == pytest.approx(np.sqrt(1 - 2 * damping**2), rel=1e-2)


def test_a_peak_at_infinite_frequency():
    # (3 s + 1)/(s + 1)
    loop = loop_of([[-1.0]], [[1.0]], [[-2.0]], [[3.0]])
    assert precise_peak(loop, 1.0) == (pytest.approx(3.0), np.inf)


# Norms in plain doubles.


# The norm that a loop achieves.


# The response at many frequencies.


@pytest.mark.parametrize("damping", [1e-1, 1e-13])
def test_the_gain_of_many_states_is_right_to_the_last_digit(damping):
    """Light damping makes doubles useless, so that balls solve it all."""
    A = np.zeros((64, 64))
    for k in range(32):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[0.0, 1.0], [-1.0, -damping]]
    B, C = np.tile([[0.0], [1.0]], (32, 1)), np.tile([[1.0, 0.0]], (1, 32))
    loop = BallSystem.of(control.StateSpace(A, B, C, 0))
    with balls.precision(BITS):
        assert gain_at(loop, 1.0) == pytest.approx(32 / damping, rel=1e-15)
        assert gain_at(loop, np.inf) == 0.0
