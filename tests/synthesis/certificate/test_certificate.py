"""Certificates tell the truth about loops, whoever closed them."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.linear.arithmetic import balls
from robustpolish.linear.proofs.definite import is_definite
from robustpolish.synthesis.certificate import certify
from robustpolish.synthesis.proofs.bounded_real import (
    cayley,
    enclose_loop,
    prove_hinf,
    prove_stability,
)


def first_order(gain=1.0, pole=1.0, dt=0):
    return rp.GeneralizedPlant.from_matrices([[pole]], [[1.0]], [[1.0]], [[gain]], [[1.0]], dt=dt)


def random_loop(n, seed, dt=0, margin=0.05):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    if dt:
        A *= (1 - margin) / np.abs(np.linalg.eigvals(A)).max()
    else:
        A -= (np.linalg.eigvals(A).real.max() + margin) * np.eye(n)
    draw = rng.standard_normal
    plant = rp.GeneralizedPlant.from_matrices(
        A,
        draw((n, 2)),
        draw((n, 1)),
        draw((3, n)),
        draw((1, n)),
        D11=draw((3, 2)) if dt else None,
        dt=dt,
    )
    return plant, np.zeros((1, 1))


def test_known_norms_and_gap():
    certificate = certify(first_order(), [[-3.0]], "hinf", claimed=0.55)
    assert certificate.valid
    assert certificate.achieved == pytest.approx(0.5, rel=1e-9)
    assert certificate.gap == pytest.approx(0.1, rel=1e-6)
    assert 0.5 < certificate.bound <= 0.5 * (1 + 1e-4)
    assert certificate.peak_frequency == 0
    assert certify(first_order(), [[-3.0]], "h2").achieved == pytest.approx(0.5, rel=1e-9)


def test_poles_have_damping_and_frequency():
    omega, zeta = 2 * np.pi * 50, 0.02
    plant = rp.GeneralizedPlant.from_matrices(
        [[0, 1], [-(omega**2), -2 * zeta * omega]], [[0], [1]], [[0], [1]], [[1, 0]], [[1, 0]]
    )
    certificate = certify(plant, [[0.0]])
    assert certificate.damping == pytest.approx([zeta, zeta], rel=1e-9)
    assert certificate.frequencies_hz == pytest.approx([50, 50], rel=1e-9)


def test_poles_of_a_discrete_loop_count_in_hertz():
    dt, rate = 0.01, -3.0
    plant = rp.GeneralizedPlant.from_matrices(
        [[np.exp(rate * dt)]], [[1]], [[1]], [[1]], [[1]], dt=dt
    )
    certificate = certify(plant, [[0.0]])
    assert certificate.frequencies_hz == pytest.approx([3 / (2 * np.pi)])
    assert certificate.damping == pytest.approx([1.0])


def test_a_false_claim_is_named():
    certificate = certify(first_order(), [[-3.0]], "hinf", claimed=0.4)
    assert not certificate.valid
    assert certificate.gap == pytest.approx(-0.2)
    assert "0.4 is false: the loop has 0.5" in certificate.reasons[0]


def test_an_unstable_loop_is_never_valid():
    certificate = certify(first_order(), [[0.5]])
    assert not certificate.valid
    assert not certificate.stable
    assert certificate.achieved == np.inf
    assert "1.5" in certificate.reasons[0]


def test_a_marginal_loop_is_never_valid():
    certificate = certify(first_order(), [[-1.0]])
    assert not certificate.valid
    assert not certificate.stable


def test_a_hidden_unstable_mode_counts():
    plant = rp.GeneralizedPlant.from_matrices(
        np.diag([-1.0, 1e-9]), [[1], [0]], [[1], [0]], [[1, 0]], [[1, 0]]
    )
    assert not certify(plant, [[0.0]]).valid


@pytest.mark.parametrize("n", [1, 3, 8, 20])
@pytest.mark.parametrize("dt", [0, 0.1])
@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_random_loops_are_proven_tightly(n, dt, norm):
    plant, gain = random_loop(n, n)
    if dt:
        plant, gain = random_loop(n, n, dt)
    certificate = certify(plant, gain, norm)
    assert certificate.valid, certificate.reasons
    assert certificate.achieved <= certificate.bound <= certificate.achieved * (1 + 1e-4)


@pytest.mark.parametrize("dt", [0, 0.1])
def test_the_proof_does_not_prove_too_much(dt):
    plant, gain = random_loop(6, 3, dt)
    achieved = certify(plant, gain).achieved
    loop = enclose_loop(plant, control.ss([], [], [], gain, dt))
    if dt:
        loop = cayley(loop)
    assert prove_hinf(loop, achieved * (1 + 1e-5)) is not None
    assert prove_hinf(loop, achieved * (1 - 1e-9)) is None
    assert prove_hinf(loop, achieved * (1 - 1e-9), bits=480) is None


def test_light_damping_and_wild_units_are_proven():
    omega, zeta = 3e4, 1e-6
    plant = rp.GeneralizedPlant.from_matrices(
        [[0, 1], [-(omega**2), -2 * zeta * omega]], [[0], [1e6]], [[0], [1]], [[1e-9, 0]], [[1, 0]]
    )
    certificate = certify(plant, [[0.0]])
    assert certificate.valid, certificate.reasons
    assert certificate.achieved == pytest.approx(1e-3 / (2 * zeta * omega**2), rel=1e-6)


def test_a_zero_norm_is_certified():
    plant = rp.GeneralizedPlant.from_matrices(
        np.diag([-1.0, -2.0]), [[1], [0]], [[1], [0]], [[0, 1]], [[1, 0]]
    )
    certificate = certify(plant, [[0.0]])
    assert certificate.valid, certificate.reasons
    assert certificate.achieved < 1e-9


def test_feedthrough_makes_the_h2_norm_infinite():
    plant = rp.GeneralizedPlant.from_matrices([[-1.0]], [[1]], [[1]], [[1]], [[1]], D11=[[1e-30]])
    certificate = certify(plant, [[0.0]], "h2")
    assert not certificate.valid
    assert certificate.achieved == np.inf


def test_an_ill_posed_loop_is_refused():
    plant = rp.GeneralizedPlant.from_matrices([[-1.0]], [[1]], [[1]], [[1]], [[1]], D22=[[2.0]])
    with pytest.raises(rp.InvalidInputError, match="well-posed"):
        certify(plant, [[0.5]])


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"norm": "l1"}, "norm"),
        ({"claimed": -1.0}, "claimed"),
        ({"claimed": np.nan}, "claimed"),
        ({"tolerance": -1}, "tolerance"),
    ],
)
def test_bad_arguments_are_named(arguments, name):
    with pytest.raises(rp.InvalidInputError, match=f"^{name}: "):
        certify(first_order(), [[-3.0]], **arguments)


def test_definiteness_in_balls_is_never_wrong():
    rng = np.random.default_rng(0)
    with balls.precision(200):
        for n in (1, 4, 12):
            X = rng.standard_normal((n, n))
            definite = X @ X.T + 1e-10 * np.eye(n)
            assert is_definite(balls.ball(definite))
            lowest = np.linalg.eigvalsh(definite)[0]
            assert not is_definite(balls.ball(definite - 1.01 * lowest * np.eye(n)))


def test_hilbert_matrices_are_eliminated_in_balls():
    n = 14  # condition number 1e19: a Cholesky factorisation in doubles fails
    with balls.precision(300):
        entries = [[1 / balls.flint.arb(i + j + 1) for j in range(n)] for i in range(n)]
        hilbert = balls.flint.arb_mat(entries)
        assert is_definite(hilbert)
        assert not is_definite(hilbert - balls.identity(n) * balls.flint.arb(1e-15))


def test_stability_alone_can_be_proven():
    plant, gain = random_loop(5, 1, margin=1e-7)
    assert prove_stability(enclose_loop(plant, control.ss([], [], [], gain, 0))) is not None
    unstable, gain = random_loop(5, 1, margin=-1e-9)
    assert prove_stability(enclose_loop(unstable, control.ss([], [], [], gain, 0))) is None
