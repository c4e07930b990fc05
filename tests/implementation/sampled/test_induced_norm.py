"""The induced norm of a sampled loop: periods, stretches, bracket and proofs."""

import control
import numpy as np
import pytest
from scipy.linalg import expm

import robustpolish as rp
from robustpolish.implementation.sampled.induced_norm import (
    EnergySection,
    GainReached,
    bracket,
    check_gain,
    hamiltonian,
    peak_frequency,
    period_section,
    phase_section,
)
from robustpolish.implementation.sampled.lifting import (
    Phase,
    period_map,
    scaled,
    split_delay,
)
from robustpolish.implementation.sampled.proof import period_balls, prove_above, prove_below
from robustpolish.linear.arithmetic import balls
from tests.implementation.designs import sampled_servo, servo

# Bracket, storage function and peak.


def loop():
    return scaled(period_map(servo(), sampled_servo().controller, 0.05, 0.02))


@pytest.mark.parametrize("start", [1e-9, 1.0, 1e9])
def test_the_bracket_does_not_depend_on_the_first_guess(start):
    low, high = bracket(loop(), start)
    expected = sampled_servo().certificate
    assert low.gamma < high.gamma <= low.gamma * (1 + 1e-6)
    assert not low.below
    assert high.below
    assert high.gamma == pytest.approx(expected.achieved, rel=1e-5)


def test_the_peak_is_where_the_gain_is_reached():
    own = loop()
    gamma = sampled_servo().certificate.achieved
    omega = peak_frequency(own, gamma)
    assert 0 <= omega <= np.pi / 0.05
    section = period_section(own, gamma)
    z = np.exp(1j * omega * 0.05)
    states = np.linalg.solve(z * np.eye(len(section.A)) - section.A, section.G)
    back = np.linalg.solve((z * np.eye(len(section.A)) - section.A).conj().T, section.Q)
    assert np.abs(np.linalg.eigvals(states @ back)).max() == pytest.approx(1, abs=1e-3)
    assert peak_frequency(own, gamma * 1e-13) is None


# Proofs: true bounds are proven, false ones are not.


def test_both_ends_are_proven_and_nothing_beyond_them():
    own = loop()
    low, high = bracket(own, 1.0)
    bound, storage = prove_below(own, high.gamma)
    assert high.gamma < bound < high.gamma * (1 + 1e-5)
    assert np.linalg.eigvalsh(storage).min() > 0
    assert prove_above(own, check_gain(own, low.gamma * (1 - 1e-5)))
    assert prove_below(own, low.gamma * 0.99) is None
    assert not prove_above(own, high)


def test_balls_hold_what_doubles_found():
    own = loop()
    gamma = 2.0
    with balls.precision(200):
        section, sound = period_balls(own, gamma)
    assert sound
    expected = period_section(own, gamma)
    for mine, theirs in zip(section, expected, strict=True):
        np.testing.assert_allclose(balls.midpoint(mine), theirs, rtol=1e-8, atol=1e-11)
        assert all(float(entry.rad()) < 1e-30 for entry in mine.entries())


# Stretches of a loop, joined by doubling.


def phase(length=1.0, D=0.0):
    rng = np.random.default_rng(4)
    A = rng.normal(size=(3, 3))
    return Phase(length, A, rng.normal(size=(3, 2)), rng.normal(size=(2, 3)), np.full((2, 2), D))


@pytest.mark.parametrize("D", [0.0, 0.2])
def test_doubling_gives_what_the_exponential_gives(D):
    own, gamma = phase(0.4, D), 5.0
    found = phase_section(own, gamma)
    F = expm(hamiltonian(own, gamma) * own.length)
    inverse = np.linalg.inv(F[3:, 3:])
    np.testing.assert_allclose(found.A, inverse.T, rtol=1e-10)
    np.testing.assert_allclose(found.G, F[:3, 3:] @ inverse, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.Q, -inverse @ F[3:, :3], rtol=1e-9, atol=1e-12)


def test_the_gain_of_an_integrator_over_a_stretch():
    # z = integral of w over [0, T]: the largest gain is 2 T / pi.
    T = 3.0
    one = np.ones((1, 1))
    integrator = Phase(T, 0 * one, one, one, 0 * one)
    edge = 2 * T / np.pi
    assert isinstance(phase_section(integrator, edge * (1 + 1e-9)), EnergySection)
    assert isinstance(phase_section(integrator, edge * (1 - 1e-9)), GainReached)


def test_a_stiff_stretch_does_not_overflow():
    stiff = Phase(1.0, np.array([[-1e8, 0], [0, -1.0]]), np.ones((2, 1)), np.ones((1, 2)), [[0.0]])
    stiff = stiff._replace(D=np.zeros((1, 1)))
    found = phase_section(stiff, 2.0)
    assert isinstance(found, EnergySection)
    assert all(np.isfinite(part).all() for part in found)


# One period, stepped by hand.


@pytest.mark.parametrize("delay", [0.0, 0.03, 0.1, 0.27, 0.3])
def test_the_transition_is_that_of_the_loop_stepped_by_hand(delay):
    rng = np.random.default_rng(2)
    A, B, C = rng.normal(size=(3, 3)), rng.normal(size=(3, 1)), rng.normal(size=(1, 3))
    plant = rp.GeneralizedPlant.from_matrices(A, B, B, C, C)
    K = control.ss([[0.4]], [[1.0]], [[-0.5]], [[-0.3]], 0.1)
    map_ = scaled(period_map(plant, K, 0.1, delay))
    transition = map_.transition()

    def step(length, u, x):
        big = expm(np.block([[A, B], [np.zeros((1, 4))]]) * length)
        return big[:3, :3] @ x + big[:3, 3:] @ u

    whole, rest = split_delay(0.1, delay)
    held = whole + (rest > 0)
    x, past, xk = rng.normal(size=3), [rng.normal(size=1) for _ in range(held)], rng.normal(size=1)
    s = np.concatenate([x, *past, xk]) / map_.sample
    for _ in range(5):
        s = transition @ s
        y = C @ x
        queue = [K.C @ xk + K.D @ y, *past]
        xk = K.A @ xk + K.B @ y
        if rest:
            x = step(rest, queue[whole + 1], x)
        x = step(0.1 - rest, queue[whole], x)
        past = queue[:held]
    np.testing.assert_allclose(s * map_.sample, np.concatenate([x, *past, xk]), rtol=1e-9)


#
