"""Controllers imitated at samples, plants at samples, and the longest period by hand."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.implementation.certify_sampled import longest_period
from robustpolish.implementation.emulation import emulated

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
