"""Norms of loops: computed, bracketed in balls, and proven with the bits it takes."""

from pathlib import Path

import control
import numpy as np
import pytest
from published_plants import compleib

import robustpolish as rp
from robustpolish.linear.arithmetic import balls
from robustpolish.linear.arithmetic.balls import BallSystem
from robustpolish.synthesis.certificate import achieved_hinf
from robustpolish.synthesis.proofs.bounded_real import (
    BITS,
    enclose_loop,
    estimate_norm,
    gain_at,
    precise_peak,
    prove_computed_norm,
    prove_h2,
    prove_hinf,
    prove_stability,
    rounding_level,
)

# A computed norm, bracketed by a gain and a proof.


def drawn(n, dt, seed):
    """A stable plant, more or less damped."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    poles = np.linalg.eigvals(A)
    margin = 10 ** rng.uniform(-3, -0.5)
    A = (
        A / np.abs(poles).max() * (1 - margin)
        if dt
        else A - (poles.real.max() + margin) * np.eye(n)
    )
    sizes = (n, 2), (n, 1), (2, n), (1, n)
    return rp.GeneralizedPlant.from_matrices(A, *map(rng.standard_normal, sizes), dt=dt)


def computed(plant, gain=0.0, rounded=None):
    K = plant.static_controller([[gain]])
    loop = enclose_loop(plant, K)
    rounded = BallSystem.of(plant.closed_loop(K) if rounded is None else rounded)
    return prove_computed_norm(loop, rounded, rounding_level(loop), plant.dt or None)


@pytest.mark.parametrize("dt", [0, 0.1])
@pytest.mark.parametrize("n", [1, 3, 8])
def test_it_encloses_the_exact_norm(n, dt):
    plant = drawn(n, dt, n)
    found, norm = computed(plant), rp.hinf_norm(plant.open_loop)
    assert found is not None
    assert found.achieved == pytest.approx(norm.value, rel=1e-9)
    assert found.frequency == pytest.approx(norm.frequency, rel=1e-3, abs=1e-9)
    assert norm.upper <= found.proof.bound <= 1.0002 * norm.value


@pytest.mark.parametrize("dt", [0, 0.1])
def test_an_unstable_loop_is_never_proven(dt):
    A = np.diag([1.1 if dt else 0.1, 0.5 if dt else -1.0])
    one = np.ones((2, 1))
    plant = rp.GeneralizedPlant.from_matrices(A, one, one, one.T, one.T, dt=dt)
    assert computed(plant) is None


def test_a_loop_that_rounding_changes_is_left_to_care():
    plant = drawn(3, 0, 1)
    other = drawn(3, 0, 2)
    assert computed(plant) is not None
    assert computed(plant, rounded=1.01 * plant.open_loop) is None
    assert computed(plant, rounded=other.open_loop) is None


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


def test_a_narrow_resonance_beside_a_broad_one():
    A = np.zeros((4, 4))
    A[:2, :2] = [[0.0, 1.0], [-1.0, -0.2]]  # peaks with 5
    A[2:, 2:] = [[0.0, 1.0], [-1e4, -2e-4]]  # peaks with 50
    B = np.array([[0.0], [1.0], [0.0], [1.0]])
    found = estimate_norm(
        A, B, np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]), np.zeros((2, 1))
    )
    assert found.settled
    assert found.value == pytest.approx(50.0, rel=1e-5)
    assert found.frequency == pytest.approx(100.0, rel=1e-6)


def test_peaks_at_both_ends_of_the_frequencies():
    lag = np.array([[-2.0]]), np.array([[1.0]])
    assert estimate_norm(*lag, np.array([[6.0]]), np.zeros((1, 1)))[:2] == pytest.approx((3.0, 0.0))
    # 3 s/(s + 2)
    high = estimate_norm(*lag, np.array([[-6.0]]), np.array([[3.0]]))
    assert high[:2] == (pytest.approx(3.0, rel=1e-6), np.inf)
    nothing = np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0))
    assert estimate_norm(*nothing, np.diag([3.0, -4.0])) == (4.0, np.inf, True)


# The norm that a loop achieves.


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
