"""Certificates of sampled loops, against simulations, closed forms and units."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.implementation.sampled.certificate import (
    filter_system,
    prove_above,
    prove_below,
    sinusoid_gains,
)
from robustpolish.implementation.sampled.induced_norm import bracket, check_gain
from robustpolish.implementation.sampled.lifting import period_map, scaled
from tests.implementation.designs import sampled_servo
from tests.implementation.fine_simulation import STEPS, random_loop
from tests.reference.examples import servo_plant

# Certificates.


def lag():
    return rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])


def contradictions(seeds):
    """Certify random loops; return what a simulation found to be wrong, and the fine gains."""
    wrong, tightness = [], []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        plant, K, period, steps, loop = random_loop(rng)
        certificate = rp.implementation.certify_sampled(plant, K, delay=steps * period / STEPS)
        if not certificate.valid or not 0 < certificate.lower <= certificate.bound:
            wrong.append((seed, certificate.reasons, certificate.lower))
        gain, angle = loop.largest_gain()
        _, worst = loop.gain_at(angle)
        turns = np.exp(1j * angle * np.arange(300))[:, None]
        inputs = [rng.normal(size=(50, worst.size)), (turns * worst).real]
        found = max(gain, *(loop.simulate(w) for w in inputs))
        if found > certificate.bound:
            wrong.append((seed, found, certificate.bound))
        tightness.append(gain / certificate.bound)
    return wrong, np.array(tightness)


def test_no_certificate_is_contradicted_by_a_simulation():
    wrong, tightness = contradictions(range(4))
    assert wrong == []
    # The fine simulation holds w over its steps, so it falls a little short of the worst input.
    assert tightness.min() > 0.98
    assert np.median(tightness) > 0.9999


@pytest.mark.long
def test_no_certificate_of_a_hundred_is_contradicted_by_a_simulation():
    wrong, tightness = contradictions(range(1000, 1100))
    assert wrong == []
    assert tightness.min() > 0.98
    assert np.median(tightness) > 0.9999


@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_the_norm_tends_to_the_continuous_one(norm):
    A = np.array([[0.0, 1.0], [-4.0, -0.4]])
    plant = rp.GeneralizedPlant.from_matrices(
        A, [[0, 0], [1, 0]], [[0], [1]], [[1, 0], [0, 0]], [[1, 0]],
        D12=[[0], [0.3]], D21=[[0, 0.1]],
    )  # fmt: skip
    design = rp.output_feedback(plant, norm=norm)
    gaps = [
        abs(design.discretize(h).certificate.achieved / design.certificate.achieved - 1)
        for h in (0.1, 0.01, 0.001)
    ]
    assert gaps[2] < 2e-3
    assert gaps[2] < gaps[1] < gaps[0]


def test_h2_is_the_power_of_a_simulation_with_white_noise():
    rng = np.random.default_rng(11)
    seen = 0
    while seen < 6:
        plant, K, period, steps, loop = random_loop(rng)
        if plant.D11.any():
            continue
        seen += 1
        found = rp.implementation.certify_sampled(plant, K, delay=steps * period / STEPS, norm="h2")
        # Unit energy per fine step is the noise of unit density held over the step.
        S = np.zeros_like(loop.Phi)
        Phi, power = loop.Phi, loop.Gamma @ loop.Gamma.T
        for _ in range(60):
            S, power, Phi = power, power + Phi @ power @ Phi.T, Phi @ Phi
        square = np.trace(loop.see[0] @ S) + np.trace(loop.see[2])
        assert found.valid
        assert found.bound / found.lower - 1 < 1e-6
        assert np.sqrt(square / period) == pytest.approx(found.bound, rel=1e-2)


def test_a_loop_that_can_be_worked_out_by_hand():
    # x' = x + w + u with u = -3 x(kh): x+ = (e - 3 (e - 1)) x + ...; stable below h = log 2.
    for period in (0.1, 0.6, 0.69):
        found = rp.implementation.certify_sampled(lag(), [[-3.0]], period=period)
        assert found.valid
        assert found.poles[0] == pytest.approx(3 - 2 * np.exp(period))
    unstable = rp.implementation.certify_sampled(lag(), [[-3.0]], period=0.7)
    assert not unstable.valid
    assert not unstable.stable
    assert "unstable" in unstable.reasons[0]
    assert unstable.bound == np.inf


def test_a_held_integrator_by_hand():
    # x' = w + u, u = -x(kh)/h: x(kh + t) = (1 - t/h) x(kh) + noise over t; deadbeat at samples.
    h = 0.5
    plant = rp.GeneralizedPlant.from_matrices([[0.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    found = rp.implementation.certify_sampled(plant, [[-1 / h]], period=h, norm="h2")
    # E x(kh)^2 = h; mean of (1 - t/h)^2 h + t over a period is h/3 + h/2.
    assert found.lower == pytest.approx(np.sqrt(h / 3 + h / 2), rel=1e-6)
    assert found.lower <= np.sqrt(h / 3 + h / 2) <= found.bound


def test_no_false_bound_of_a_sampled_loop_is_proven():
    loop = scaled(period_map(servo_plant(), sampled_servo().controller, 0.05, 0.02))
    low, high = bracket(loop, 1.0)
    bound, storage = prove_below(loop, high.gamma)
    assert high.gamma < bound < high.gamma * (1 + 1e-5)
    assert np.linalg.eigvalsh(storage).min() > 0
    assert prove_above(loop, check_gain(loop, low.gamma * (1 - 1e-5)))
    assert prove_below(loop, low.gamma * 0.99) is None
    assert not prove_above(loop, high)


def test_open_loop_has_the_norm_of_the_plant():
    plant = rp.GeneralizedPlant.from_matrices(
        [[0, 1], [-1, -0.1]], [[0], [1]], [[0], [1]], [[1, 0]], [[1, 0]], D11=[[0.5]]
    )
    found = rp.implementation.certify_sampled(plant, [[0.0]], period=0.7)
    true = rp.hinf_norm(plant.open_loop)
    assert found.lower <= true.value <= found.bound
    assert found.bound == pytest.approx(true.value, rel=1e-5)
    assert found.peak_frequency == pytest.approx(true.frequency, rel=1e-2)


def test_units_change_nothing():
    plant = rp.GeneralizedPlant.from_matrices(
        [[0, 1], [-1, -0.1]], [[0, 0], [1, 0]], [[0], [1]], [[1, 0]], [[1, 0]], D21=[[0, 0.2]]
    )
    K = control.ss([[0.5]], [[1.0]], [[-0.02]], [[-0.1]], 0.3)
    before = rp.implementation.certify_sampled(plant, K, delay=0.1)
    assert before.valid
    time, length = 1e-6, 1e8
    T = np.diag([length, length / time])
    scaled = rp.GeneralizedPlant.from_matrices(
        T @ plant.A @ np.linalg.inv(T) / time, T @ plant.B1 / time, T @ plant.B2 / time,
        plant.C1 @ np.linalg.inv(T), plant.C2 @ np.linalg.inv(T), D21=plant.D21,
    )  # fmt: skip
    K = control.ss([[0.5]], [[1.0]], [[-0.02]], [[-0.1]], 0.3 * time)
    after = rp.implementation.certify_sampled(scaled, K, delay=0.1 * time)
    assert after.valid
    assert after.bound == pytest.approx(before.bound, rel=1e-5)


def test_unfiltered_noise_is_averaged_and_said_so():
    plant = rp.GeneralizedPlant.from_matrices(
        [[-1.0]], [[0.0]], [[1.0]], [[1.0]], [[1.0]], D21=[[1.0]]
    )
    bare = rp.implementation.certify_sampled(plant, [[-1.0]], period=0.01)
    assert "average" in bare.notes[0]
    filtered = rp.implementation.certify_sampled(plant, [[-1.0]], period=0.01, anti_aliasing=20.0)
    assert filtered.notes == ()
    assert filtered.bound == pytest.approx(bare.bound, rel=1e-2)
    assert bare.bound == pytest.approx(0.5, rel=1e-2)


def test_a_loop_without_disturbance_has_norm_zero():
    plant = rp.GeneralizedPlant.from_matrices([[-1.0]], [[0.0]], [[1.0]], [[1.0]], [[1.0]])
    found = rp.implementation.certify_sampled(plant, [[-1.0]], period=0.1)
    assert found.valid
    assert found.bound < 1e-25


def test_delays_round_the_loop_are_exact():
    lag = control.tf([1], [1, 1], inputs="u", outputs="y")
    plant = rp.GeneralizedPlant.from_loop(lag)
    late = plant.with_delay("u", 0.02).with_delay("y", 0.05)
    exact = rp.implementation.certify_sampled(late, [[-1.0]], period=0.05)
    same = rp.implementation.certify_sampled(plant, [[-1.0]], period=0.05, delay=0.07)
    assert exact.valid
    assert exact.bound == pytest.approx(same.bound, rel=1e-6)
    np.testing.assert_allclose(np.sort(exact.poles), np.sort(same.poles), atol=1e-12)
    assert "are exact: 0.07 s round the loop" in exact.notes[0]
    # A filter beside delays, which stand before it.
    filtered = rp.implementation.certify_sampled(
        plant.with_delay("u", 0.02), [[-1.0]], 0.05, anti_aliasing=5.0
    )
    by_hand = rp.implementation.certify_sampled(plant, [[-1.0]], 0.05, 0.02, anti_aliasing=5.0)
    assert filtered.bound == pytest.approx(by_hand.bound, rel=1e-6)


# Gains for disturbances of one frequency.


def test_without_control_they_are_those_of_the_plant():
    plant = rp.GeneralizedPlant.from_matrices(
        [[0, 1], [-1, -0.1]], [[0], [1]], [[0], [1]], [[1, 0], [0, 1]], [[1, 0]]
    )
    found = sinusoid_gains(plant, control.ss([], [], [], [[0.0]], 0.3), 0.1)
    for hertz, gain in zip(found["frequency"].values, found.values, strict=True):
        true = np.linalg.norm(plant.open_loop(2j * np.pi * hertz), 2)
        np.testing.assert_allclose(gain, true, rtol=1e-8)


def test_no_tone_has_more_than_the_norm():
    sampled = sampled_servo()
    found = sinusoid_gains(sampled.plant, sampled.controller, sampled.delay)
    assert found.max() <= sampled.certificate.bound
    assert found.max() > 0.9 * sampled.certificate.lower


# Filters before the samplers.


@pytest.mark.parametrize("order", range(1, 9))
def test_butterworth_filters_have_their_corner(order):
    found = filter_system((order, 50.0), 1)
    corner = abs(np.squeeze(found(2j * np.pi * 50.0)))
    assert found.nstates == order
    assert corner == pytest.approx(np.sqrt(0.5), rel=1e-9)
    assert abs(np.squeeze(found(0))) == pytest.approx(1.0)
    assert abs(np.squeeze(found(2j * np.pi * 5e4))) == pytest.approx(1e-3**order, rel=1e-3)


@pytest.mark.parametrize(
    "bad",
    [
        -1.0, 0.0, "fast", True, (2, -1.0), (0, 10.0), (2.5, 10.0), (1, 2, 3), np.nan,
        control.ss([[1.0]], [[1.0]], [[1.0]], 0), control.ss([[0.5]], [[1]], [[1]], 0, 0.1),
        control.ss(-np.eye(2), np.eye(2), np.eye(2), 0),
    ],
)  # fmt: skip
def test_what_is_no_filter_is_refused(bad):
    with pytest.raises(rp.InvalidInputError, match="anti_aliasing"):
        filter_system(bad, 3)
