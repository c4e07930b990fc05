"""What long arithmetic calls stable is proven, and nothing else."""

from pathlib import Path

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.linear.arithmetic import balls
from robustpolish.synthesis.proofs.bounded_real import (
    enclose_loop,
    gain_at,
    precise_peak,
    prove_h2,
    prove_hinf,
    prove_stability,
)

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
    data = np.load(shared / "data" / "compleib" / "compleib_larger.npz")
    names = ("A", "B1", "B", "C1", "C", "D11", "D12", "D21")
    plant = rp.GeneralizedPlant.from_matrices(*(data[f"IH/{name}"] for name in names))
    design = rp.output_feedback(plant, time_limit=60)
    assert design.certificate.valid
    assert design.certificate.achieved < 1.2e-6
