"""Forms of a controller, single precision, limits, anti-windup, and fewer states."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.implementation.certify_sampled import longest_period
from robustpolish.implementation.realization import (
    FORMS,
    anti_windup,
    control_limits,
    controller_outputs,
    emulated,
    realized,
    roundoff_bound,
)
from tests.implementation.designs import sampled_servo
from tests.reference.examples import servo_design


def responses(K):
    turns = np.exp(1j * np.array([1e-3, 0.1, 1.0, 3.0]))
    return np.array([K.C @ np.linalg.solve(z * np.eye(K.nstates) - K.A, K.B) + K.D for z in turns])


@pytest.mark.parametrize("form", FORMS)
def test_the_transfer_is_kept(form):
    rng = np.random.default_rng(3)
    for n in (1, 2, 5, 9):
        A = rng.normal(size=(n, n))
        A *= 0.99 / np.abs(np.linalg.eigvals(A)).max()
        scale = 10.0 ** rng.integers(-6, 6, n)
        A, B = A * scale / scale[:, None], rng.normal(size=(n, 2)) / scale[:, None]
        K = control.ss(A, B, rng.normal(size=(2, n)) * scale, rng.normal(size=(2, 2)), 0.1)
        found = realized(K, form)
        np.testing.assert_allclose(responses(found), responses(K), rtol=1e-7, atol=1e-9)
        assert max(np.abs(found.A).max(), np.abs(found.B).max(), np.abs(found.C).max()) < 1e3


@pytest.mark.parametrize("form", FORMS)
def test_multiple_poles_and_unstable_ones_do_no_harm(form):
    jordan = np.array([[1.0, 1.0, 0.0], [0, 1.0, 1.0], [0, 0, 0.3]])
    K = control.ss(jordan, [[0], [1.0], [1]], [[1.0, 0, 1]], [[0.0]], 1.0)
    np.testing.assert_allclose(responses(realized(K, form)), responses(K), rtol=1e-8)


def test_single_precision_is_stated_and_sections_lose_less():
    sampled = servo_design().discretize(0.001)
    losses = {}
    for form in FORMS:
        found = sampled.realization(form)
        loss = found.details["single_precision"]
        assert loss.certificate.valid
        assert "single precision" in found.message
        assert abs(loss.norm_change) < 1e-2
        losses[form] = loss.pole_shift
    assert max(losses.values()) < 1e-4
    with pytest.raises(rp.InvalidInputError, match="form"):
        sampled.realization("companion")


def in_single(K, y):
    A, B, C, D = (np.asarray(M, np.float32) for M in (K.A, K.B, K.C, K.D))
    x, out = np.zeros(len(A), np.float32), []
    for row in y.astype(np.float32):
        out.append(C @ x + D @ row)
        x = A @ x + B @ row
    return np.array(out, float)


@pytest.mark.parametrize("form", ["balanced", "modal", "sections"])
def test_no_run_leaves_the_bound(form):
    K = realized(sampled_servo().controller, form)
    bound = roundoff_bound(K)
    for seed in range(3):
        y = np.sign(np.random.default_rng(seed).normal(size=(5000, 1)))
        expected = controller_outputs(K, y)
        error = np.abs(in_single(K, y) - expected).max()
        assert 0 < error <= bound.outputs[0]
        assert np.abs(expected).max() <= bound.size[0]
    assert bound.per_sample[0] < bound.outputs[0] < 1e-2 * bound.size[0]


def test_a_controller_that_grows_has_no_bound():
    K = control.ss([[1.5]], [[1.0]], [[1.0]], 0, 1.0)
    assert roundoff_bound(K).outputs[0] == np.inf


def test_limits_in_every_form():
    names = ("F", "M")
    for given in (2.0, (-2, 2), [2.0, (-2.0, 2.0)], {"F": 2.0, "M": (-2, 2)}):
        low, high = control_limits(given, names)
        np.testing.assert_array_equal(low, [-2, -2])
        np.testing.assert_array_equal(high, [2, 2])
    low, high = control_limits({"M": 1.0}, names)
    assert low[0] == -np.inf
    assert high.tolist() == [np.inf, 1.0]
    assert control_limits(None, names) is None


@pytest.mark.parametrize("bad", [0.0, -1.0, "x", (2, 1), [1.0], {"G": 1}, (1, 2, 3), np.nan])
def test_wrong_limits_are_refused(bad):
    with pytest.raises(rp.InvalidInputError, match="limits"):
        control_limits(bad, ("F", "M"))


def test_a_conditioned_pi_controller_forgets_at_once():
    # u = 2 e + sum of 0.1 e: conditioned, the state is what makes u just reach the limit.
    K = control.ss([[1.0]], [[0.1]], [[1.0]], [[2.0]], 0.1)
    found = anti_windup(K)
    assert found.form == "conditioned"
    assert found.L[0, 0] == pytest.approx(0.05)


def test_a_strictly_proper_controller_gets_an_observer():
    K = control.ss([[1.0, 0.1], [0, 0.5]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], 0.1)
    found = anti_windup(K)
    assert found.form == "observer"
    assert np.abs(np.linalg.eigvals(K.A - found.L @ K.C)).max() < 0.99
    with pytest.raises(rp.InvalidInputError, match="conditioned"):
        anti_windup(K, "conditioned")
    assert not anti_windup(K, "none").L.any()
    with pytest.raises(rp.InvalidInputError, match="anti_windup"):
        anti_windup(K, "hanus?")


# Controllers imitated at samples, plants at samples, and the longest period by hand.


K = control.ss([[-1.0, 2.0], [-2.0, -1.0]], [[0.0], [1.0]], [[3.0, 1.0]], [[0.5]])


def response(system, omega):
    return complex(np.squeeze(system(np.exp(1j * omega * system.dt) if system.dt else 1j * omega)))


@pytest.mark.parametrize(
    ("method", "theirs"),
    [("tustin", "bilinear"), ("zoh", "zoh"), ("forward", "euler"), ("backward", "backward_diff")],
)
def test_they_are_those_of_python_control(method, theirs):
    found, expected = emulated(K, 0.1, method), control.sample_system(K, 0.1, theirs)
    for omega in (0.0, 0.3, 2.0, 20.0):
        assert response(found, omega) == pytest.approx(response(expected, omega), rel=1e-10)
    same = emulated(K, 0.1, theirs)
    np.testing.assert_array_equal(same.A, found.A)


@pytest.mark.parametrize("method", ["tustin", "zoh", "foh", "matched", "forward", "backward"])
def test_they_tend_to_the_controller(method):
    gaps = [abs(response(emulated(K, h, method), 1.5) - response(K, 1.5)) for h in (1e-2, 1e-3)]
    assert gaps[1] < 0.2 * gaps[0]
    assert gaps[1] < 1e-2
    assert response(emulated(K, 0.1, method), 0.0) == pytest.approx(response(K, 0.0), rel=1e-6)


def test_prewarping_is_exact_at_its_frequency():
    hertz = 1.3
    found = emulated(K, 0.1, "tustin", prewarp_hz=hertz)
    omega = 2 * np.pi * hertz
    assert response(found, omega) == pytest.approx(response(K, omega), rel=1e-12)


def test_first_order_hold_is_exact_for_ramps():
    found = emulated(control.ss([[-1.0]], [[1.0]], [[1.0]], 0), 0.5, "foh")
    k = np.arange(30)
    y = control.forced_response(found, inputs=0.5 * k).outputs
    t = 0.5 * k
    np.testing.assert_allclose(y - y[0] * np.exp(-t), t - 1 + np.exp(-t), atol=1e-10)


PI = ([-0.01], [0.0], 100.0)
MATCHED = {
    "PI": PI,
    "double integrator with lead": ([-1.0], [0.0, 0.0, -40.0], 3.0),
    "notch beside integrator": ([-1 + 30j, -1 - 30j], [-60 + 1j, -60 - 1j, 0.0], 7.0),
    "derivative": ([0.0], [-50.0, -60.0], 2.0),
    "no zeros": ([], [-1.0, -2.0, -1e3], 4.0),
    "unstable": ([5.0, -3.0], [2.0, -7.0, 0.0], -1.5),
    "12 slow poles": (-np.arange(1.5, 10), [*-np.arange(1.0, 13)], 1.0),
}


@pytest.mark.parametrize("period", [0.1, 1e-3, 1e-5])
@pytest.mark.parametrize("name", MATCHED)
def test_matched_moves_poles_and_zeros(name, period):
    zeros, poles, gain = MATCHED[name]
    # a realisation without polynomials: blocks of one or two states in a row
    K = control.ss([], [], [], [[gain]])
    left = list(zeros)
    for p in poles:
        if np.imag(p) < 0:
            continue
        n, pick = (1, 1) if np.isreal(p) else (2, 2)
        own, left = left[:pick], left[pick:]
        den = np.real(np.poly([p] if n == 1 else [p, np.conj(p)]))
        num = np.pad(np.atleast_1d(np.real(np.poly(own))), (n - len(own), 0))
        A = np.vstack([-den[1:], np.eye(n - 1, n)])
        K = control.ss(A, np.eye(n, 1), num[1:] - num[0] * den[1:], num[0]) * K
    found = emulated(K, period, "matched")

    def factor(z, roots):  # over the period, as s for slow signals
        return np.prod([(z - np.exp(r * period)) / (np.expm1(r * period) / r if r else period)
                        for r in roots])  # fmt: skip

    for rate in (0.01, 0.3, 2.0):
        z = np.exp(1j * rate)
        want = gain * factor(z, zeros) / factor(z, poles)
        assert response(found, rate / period) == pytest.approx(want, rel=1e-6)


def test_matched_without_a_way_through_is_zero():
    found = emulated(control.ss([[-1.0, 0], [0, -2]], [[1.0], [0]], [[0, 1.0]], 0), 0.1, "matched")
    assert found(np.exp(0.1j)) == 0


def test_a_gain_stays_itself():
    gain = control.ss([], [], [], [[2.0, -1.0]])
    for method in ("tustin", "zoh", "foh", "backward"):
        found = emulated(gain, 0.1, method)
        assert found.nstates == 0
        np.testing.assert_array_equal(found.D, gain.D)


def test_wrong_arguments_are_refused():
    with pytest.raises(rp.InvalidInputError, match="method"):
        emulated(K, 0.1, "magic")
    for period in (0.0, -1.0, np.inf, "x"):
        with pytest.raises(rp.InvalidInputError, match="period"):
            emulated(K, period)
    with pytest.raises(rp.InvalidInputError, match="prewarp_hz"):
        emulated(K, 0.1, "zoh", prewarp_hz=1.0)
    with pytest.raises(rp.InvalidInputError, match="prewarp_hz"):
        emulated(K, 0.1, prewarp_hz=5.0)
    with pytest.raises(rp.InvalidInputError, match="one of each"):
        emulated(control.append(K, K), 0.1, "matched")
    with pytest.raises(rp.InvalidInputError, match="pole"):
        emulated(control.ss([[20.0]], [[1.0]], [[1.0]], 0), 0.1)


@pytest.mark.parametrize("delay", [0.0, 0.04, 0.1, 0.25])
def test_poles_are_those_of_the_certificate(delay):
    plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    sampled = rp.implementation.plant_at_samples(plant, 0.1, delay)
    loop = control.feedback(sampled, control.ss([], [], [], [[-2.0]], 0.1), sign=1)
    found = np.abs(np.linalg.eigvals(loop.A)).max()
    certificate = rp.implementation.certify_sampled(plant, [[-2.0]], 0.1, delay)
    assert found == pytest.approx(certificate.spectral_radius, rel=1e-9)


@pytest.mark.parametrize(("at", "computing"), [("u", 0), ("y", 0), ("uy", 0), ("uy", 0.07)])
def test_delays_of_the_plant_are_exact_at_samples(at, computing):
    lag = control.ss([[-2.0]], [[3.0]], [[1.0]], 0, inputs="u", outputs="y")
    plant, total = rp.GeneralizedPlant(lag, measurements="y", controls="u"), computing
    for name, seconds in (("u", 0.23), ("y", 0.11)):
        if name in at:
            plant, total = plant.with_delay(name, seconds), total + seconds
    found = rp.implementation.plant_at_samples(plant, 0.1, computing)
    n, r = divmod(total, 0.1)  # the control acts r after the sample n later
    early, late = 1.5 * (np.exp(-0.2 + 2 * r) - np.exp(-0.2)), 1.5 * (1 - np.exp(-0.2 + 2 * r))
    for rate in (0.1, 1.0, 3.0):
        z = np.exp(1j * rate)
        want = (late + early / z) / (z - np.exp(-0.2)) / z**n
        assert complex(np.squeeze(found(z))) == pytest.approx(want, rel=1e-9)


def test_delays_that_differ_are_refused_at_samples():
    two = control.append(*[control.ss([[-2.0]], [[3.0]], [[1.0]], 0)] * 2)
    plant = rp.GeneralizedPlant(two, measurements=2, controls=2)
    for name in (plant.control_names[0], plant.measurement_names[1]):
        late = plant.with_delay(name, 0.01)
        with pytest.raises(rp.InvalidInputError, match=f"{name[0]}.* 10 ms".replace("[", r"\[")):
            rp.implementation.plant_at_samples(late, 0.1)


def lag(a=1.0):
    return rp.GeneralizedPlant.from_matrices([[a]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])


def static(k):
    return control.ss([], [], [], [[k]])


def test_an_unstable_lag_with_a_gain():
    # x+ = (e - 3 (e - 1)) x is stable while e < 2.
    assert longest_period(lag(), static(-3.0)) == pytest.approx(np.log(2), rel=1e-6)
    # One period of delay: z^2 - e z + 3 (e - 1), stable while 3 (e - 1) < 1.
    found = longest_period(lag(), static(-3.0), delay_periods=1.0)
    assert found == pytest.approx(np.log(4 / 3), rel=1e-6)


def test_units_of_time_only_scale_it():
    found = longest_period(lag(1e6), static(-3e6))
    assert found == pytest.approx(np.log(2) * 1e-6, rel=1e-6)


def test_a_fixed_delay_is_part_of_every_period():
    # x' = x - 3 x(t - d) is unstable from d = acos(1/3)/sqrt(8) on, however fast one samples.
    critical = np.arccos(1 / 3) / np.sqrt(8)
    assert longest_period(lag(), static(-3.0), delay=critical * 1.05) == 0.0
    assert 0 < longest_period(lag(), static(-3.0), delay=critical * 0.9) < 0.2


def test_no_limit_is_infinite():
    assert longest_period(lag(-1.0), static(-0.5)) == np.inf
