"""Certificates of loops: known norms, random loops, false claims, bad arguments."""

import sys
from pathlib import Path

import control
import numpy as np
import pytest
from published_plants import compleib

import robustpolish as rp
from robustpolish.linear.arithmetic import balls
from robustpolish.linear.arithmetic.balls import BallSystem
from robustpolish.synthesis.certificate import certify, exact_delays
from robustpolish.synthesis.proofs.bounded_real import (
    BITS,
    enclose_loop,
    gain_at,
    precise_peak,
    prove_h2,
    prove_hinf,
    prove_stability,
)
from tests.times import computing_time

# Certificates.


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


@pytest.mark.parametrize(("gain", "pole"), [(0.5, "1.5"), (-1.0, "0")])
def test_an_unstable_or_marginal_loop_is_never_valid(gain, pole):
    certificate = certify(first_order(), [[gain]])
    assert not certificate.valid
    assert not certificate.stable
    assert certificate.achieved == np.inf
    assert pole in certificate.reasons[0]


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


# Controllers may come as transfer functions.


def plant(signals=1, dt=0):
    one = np.eye(signals)
    return rp.GeneralizedPlant.from_matrices(one, one, one, one, one, dt=dt)


@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_a_transfer_function_is_certified_as_its_realisation_is(norm):
    K = control.tf([-30.0, -200.0], [1.0, 40.0])
    found = rp.certify(plant(), K, norm)
    other = rp.certify(plant(), control.ss(K), norm)
    assert found.valid, found.reasons
    assert found.achieved == pytest.approx(other.achieved, rel=1e-9)
    assert found.poles == pytest.approx(other.poles)


def test_a_discrete_transfer_function_is_certified():
    K = control.tf([-0.5], [1.0, 0.1], 0.1)
    assert rp.certify(plant(dt=0.1), K).valid
    with pytest.raises(rp.InvalidInputError, match="controller"):
        rp.certify(plant(), K)


def test_several_signals_are_realised_with_the_fewest_states():
    K = control.TransferFunction([[[-3.0], [0.0]], [[0.0], [-3.0]]], [[[0.01, 1.0]] * 2] * 2)
    certificate = rp.certify(plant(2), K)
    assert certificate.valid, certificate.reasons
    assert certificate.poles.size == 4


def test_without_slycot_the_message_says_so(monkeypatch):
    for name in [name for name in sys.modules if name.split(".")[0] == "slycot"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "slycot", None)
    lag = control.tf([-3.0], [0.01, 1.0])
    assert rp.certify(plant(), lag).valid  # one input and one output need none
    K = control.TransferFunction([[[-3.0]] * 2] * 2, [[[0.01, 1.0]] * 2] * 2)
    with pytest.raises(rp.InvalidInputError, match=r"slycot is missing.*state-space realisation"):
        rp.certify(plant(2), K)


def test_a_design_of_a_transfer_function_has_the_names_of_the_plant():
    design = rp.given_controller(plant(), control.tf([-3.0], [0.01, 1.0]))
    assert design.controller.input_labels == list(design.plant.measurement_names)
    assert design.controller.output_labels == list(design.plant.control_names)
    assert design.certificate.valid


@pytest.mark.parametrize(
    ("controller", "told"),
    [
        (control.tf([-3.0, 1, 0], [1.0, 1]), "improper TransferFunction.*Add a lag"),
        (control.combine_tf([[control.tf([1], [1, 1])] * 2]), "1 outputs and 2 inputs"),
        (control.frd([1, 1], [1, 2]), "got FrequencyResponseData.*TransferFunction.*or a gain"),
        ("high", "real matrix"),
    ],
)
def test_other_controllers_are_refused_with_the_right_hint(controller, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        rp.certify(plant(), controller)


def test_a_plant_has_to_name_its_signals():
    with pytest.raises(rp.InvalidInputError, match=r"plant: got TransferFunction.*measurements="):
        rp.certify(control.tf([1], [1, 1]), [[-3.0]])


# Loops with delays are checked with the delays as they are.


def plant_d(order=3, seconds=0.5):
    lag = control.tf([1], [1, 1], inputs="u", outputs="y")
    return rp.GeneralizedPlant.from_loop(lag).with_delay("u", seconds, order=order)


def test_the_gain_is_that_of_the_exact_loop():
    found = rp.certify(plant_d(1), [[-3.0]]).exact_delays
    largest = 0.0
    for w in np.linspace(0.01, 12, 40001):
        lag, delay = 1 / (1 + 1j * w), np.exp(-0.5j * w)
        S = 1 / (1 + 3 * lag * delay)
        # The effort shows the delayed command, which is what acts.
        blocks = S * np.array([[1], [-3 * delay]]) @ np.array([[1, lag]])
        largest = max(largest, np.linalg.norm(blocks, 2))
    assert found.stability
    assert found.gain == pytest.approx(largest, rel=1e-4)
    assert found.orders == {"u": 1}


def test_a_loop_that_only_the_pade_model_finds_stable_is_refused():
    # 1/s with gain k and delay T: stable up to k T = pi / 2, of Pade's order 1 up to 2.
    integrator = control.tf([1], [1, 0], inputs="u", outputs="y")
    rough = rp.GeneralizedPlant.from_loop(integrator).with_delay("u", 1.0, order=1)
    certificate = rp.certify(rough, [[-1.8]])
    assert certificate.stable
    assert not certificate.valid
    assert "unstable with its delays as they are" in certificate.reasons[0]
    with pytest.raises(rp.SolverError, match="raise order= of with_delay"):
        rp.given_controller(rough, [[-1.8]])
    good = rp.certify(rough, [[-1.5]])
    assert good.valid
    assert "stable" in str(good.exact_delays)


def test_plants_without_delays_say_nothing_of_them():
    lag = control.tf([1], [1, 1])
    none = rp.GeneralizedPlant.from_loop(lag)
    assert exact_delays(none, none.static_controller([[-1.0]]), "hinf") is None
    assert rp.certify(none, [[-1.0]]).exact_delays is None
    sampled = control.ss([[0.5]], [[1.0]], [[1.0]], 0, 0.1, inputs="u", outputs="y")
    chain = rp.GeneralizedPlant.from_loop(sampled).with_delay("u", 0.2)
    assert rp.certify(chain, [[-0.1]]).exact_delays is None


@pytest.mark.parametrize("norm", ["hinf", "h2"])
@pytest.mark.parametrize("split", [True, False])
def test_designs_are_checked_with_exact_delays(norm, split, tmp_path):
    wired = plant_d(2, 0.2).with_sensor("y", noise=0.1).with_actuator("u", 3.0)
    wired = wired.part(disturbances=[1, 2], performance=[0])
    design = rp.output_feedback(wired, norm, control_weight=0.1, split=split)
    assert dict(design.plant.delays) == {"u": 0.2}
    assert design.certificate.exact_delays.stability
    assert (design.certificate.exact_delays.gain is None) == (norm == "h2")
    assert "with the exact delays the loop is stable" in str(design)
    design.save(tmp_path / "design.json")
    assert rp.load(tmp_path / "design.json").certificate.exact_delays.stability


def test_other_methods_are_checked_too():
    design = rp.static_output_feedback(plant_d(2, 0.2))
    assert design.certificate.exact_delays.stability
    with pytest.raises(rp.InvalidInputError, match="delays, which have infinitely many states"):
        rp.state_feedback(plant_d(2, 0.2))


# A loop whose peak lies decades beside where a search in doubles ends: in time all the same.


POSITIONAL = ("A", "B1", "B2", "C1", "C2")


@pytest.mark.shared
@pytest.mark.long
@pytest.mark.parametrize("limit", [1.5, 3.0, 5.0])
def test_the_limit_holds_for_search_and_certificate(limit, shared, monkeypatch):
    with np.load(shared / "data" / "plants" / "slow_certificate.npz") as data:
        matrices = dict(data)
    named = {name: M for name, M in matrices.items() if name not in POSITIONAL}
    plant = rp.GeneralizedPlant.from_matrices(*(matrices[name] for name in POSITIONAL), **named)
    # Seconds of computing, which a busy machine does not change.
    monkeypatch.setattr("time.monotonic", computing_time)
    start = computing_time()
    design = rp.output_feedback(plant, time_limit=limit)
    assert computing_time() - start < limit + 1.0
    assert design.status == "time_limit"
    assert design.certificate.valid
    assert design.certificate.bound <= design.certificate.achieved * (1 + 1e-3)


# Norms of loops: computed, bracketed in balls, and proven with the bits it takes.


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
