"""H-infinity and H2 norms: known values, units, inequalities, bad input."""

import time

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import linalg

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.linear.norms.lmi import h2_norm_lmi, hinf_norm_lmi, lyapunov_lmi
from robustpolish.polishing.air_bearing import AirBearingParameters, air_bearing
from tests.fuzz.plant_calls import Given
from tests.fuzz.sixty_digits import checked

# The H-infinity norm.


def ss(A, B, C, D=0, dt=0):
    return control.StateSpace(A, B, C, D, dt, remove_useless_states=False)


def oscillator(w, zeta):
    return ss([[0, 1], [-w * w, -2 * zeta * w]], [[0], [w * w]], [[1, 0]])


@pytest.mark.parametrize("w", [1e-9, 1.0, 3e4, 1e9])
@pytest.mark.parametrize("zeta", [1e-12, 1e-9, 1e-4, 0.05, 0.5])
def test_an_oscillator_has_its_textbook_peak(w, zeta):
    norm = hinf_norm(oscillator(w, zeta))
    peak = 1 / (2 * zeta * np.sqrt(1 - zeta**2))
    assert norm.value == pytest.approx(peak, rel=2e-9)
    assert norm.frequency == pytest.approx(w * np.sqrt(1 - 2 * zeta**2), rel=1e-8)
    assert norm.lower <= norm.value <= norm.upper
    assert norm.upper <= norm.lower * (1 + 2e-9)


def test_the_value_python_control_misses():
    assert float(hinf_norm(oscillator(1e9, 0.05))) == pytest.approx(10.0125, abs=5e-5)


@pytest.mark.parametrize(
    ("system", "value", "frequency"),
    [
        (ss([[-1]], [[1]], [[1]]), 1, 0),
        (ss([[-1]], [[1]], [[-1]], 1), 1, np.inf),  # s/(s + 1): only the limit reaches it
        (ss([[-1]], [[1]], [[0]], 3), 3, None),
        (ss(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), [[3, 4]]), 5, 0),
        (ss([[-1, 0], [0, -1]], [[1], [1]], [[1, -1]]), 0, None),  # the outputs cancel
        (ss([[-1]], [[0]], [[1]]), 0, None),
        (ss([[0.5]], [[1]], [[1]], 0, True), 2, 0),
        (ss([[-0.5]], [[1]], [[1]], 0, 0.1), 2, np.pi / 0.1),
        (ss([[0]], [[1]], [[1]], 0, True), 1, None),  # a delay of one sample
        (ss([[-1, 1], [0, -1]], [[0], [1]], [[1, 0]]), 1, 0),  # defective
    ],
)
def test_small_systems(system, value, frequency):
    norm = hinf_norm(system)
    assert norm.value == pytest.approx(value, rel=1e-9)
    assert norm.lower <= value <= norm.upper
    assert norm.stable
    if frequency is not None:
        assert norm.frequency == pytest.approx(frequency)


INFINITE = [
    (ss([[0]], [[1]], [[1]]), "pole 0 rad/s on the imaginary axis"),
    (ss([[0, 1], [-4, 0]], [[0], [1]], [[1, 0]]), "2j rad/s on the imaginary axis"),
    (ss([[3]], [[1]], [[0]]), "pole 3 rad/s in the right half-plane"),  # hidden, yet unstable
    (ss([[1e-20]], [[1]], [[1]]), "1e-20 rad/s in the right half-plane"),
    (ss([[-1]], [[1]], [[1]], 0, True), "pole -1 on the unit circle"),
    (ss([[2]], [[1]], [[1]], 0, True), "pole 2 outside the unit circle"),
]


@pytest.mark.parametrize("norm_of", [hinf_norm, h2_norm])
@pytest.mark.parametrize(("system", "told"), INFINITE)
def test_infinite_norms_say_why(system, told, norm_of):
    norm = norm_of(system)
    assert norm.value == np.inf
    assert not norm.stable
    assert told in norm.reason


def test_white_noise_straight_to_the_output_has_no_finite_h2_norm():
    norm = h2_norm(ss([[-1]], [[1]], [[1]], 1e-9))
    assert norm.value == np.inf
    assert norm.stable
    assert "D is not zero" in norm.reason


def test_a_hidden_pole_on_the_axis_leaves_the_norm_finite():
    A = np.diag([0.0, -1.0])
    norm = hinf_norm(ss(A, [[1], [1]], [[0, 2]]))
    assert norm.value == pytest.approx(2)
    assert not norm.stable
    assert "hidden" in norm.reason
    mixed = [[1, 0], [1, 1]] @ A @ np.linalg.inv([[1, 0], [1, 1]])
    norm = hinf_norm(ss(mixed, [[1], [2]], [[-2, 2]]))
    assert norm.value == pytest.approx(2)
    assert not norm.stable


def test_modes_out_of_reach_in_mixed_states_change_no_norm():
    rng = np.random.default_rng(4)
    A = np.array([[-1.0, 2, 5, 0], [-2, -1, 0, 3], [0, 0, -3, 1], [0, 0, 0, -2]])
    B, C = np.array([[1.0], [2], [0], [0]]), rng.integers(1, 6, (2, 4)).astype(float)
    lower, upper = (np.tril(rng.integers(-2, 3, (4, 4)), -1) + np.eye(4) for _ in range(2))
    T = lower @ upper.T  # whole numbers, whose determinant is one
    back = np.round(np.linalg.inv(T))
    seen = ss(A[:2, :2], B[:2], C[:, :2])
    whole = ss(T @ A @ back, T @ B, C @ back)
    assert hinf_norm(whole).value == pytest.approx(hinf_norm(seen).value, rel=1e-9)
    assert h2_norm(whole).value == pytest.approx(h2_norm(seen).value, rel=1e-9)


@pytest.mark.parametrize("dt", [0, 0.1])
@pytest.mark.parametrize("seed", range(4))
def test_brackets_of_larger_systems_hold_with_and_without_exact_arithmetic(seed, dt):
    rng = np.random.default_rng(seed)
    n = (8, 8, 14, 14)[seed]
    A = rng.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + 10.0 ** -rng.integers(0, 5)) * np.eye(n)
    if dt:
        A = np.linalg.solve(3 * np.eye(n) - A, 3 * np.eye(n) + A)
    system = ss(A, rng.standard_normal((n, 2)), rng.standard_normal((3, n)), 0, dt)
    if n == 8:
        assert checked("hinf_norm", hinf_norm(system), Given(None, system, None)) == "proven"
    expected, at = control.linfnorm(system, 1e-12)
    for exact in (True, False):
        norm = hinf_norm(system, exact=exact)
        assert norm.lower <= norm.value <= norm.upper <= norm.lower * (1 + 1e-6)
        assert norm.lower * (1 - 1e-9) <= expected <= norm.upper * (1 + 1e-9)
        assert norm.frequency == pytest.approx(at, rel=1e-3, abs=1e-6)


def test_the_quick_norm_is_not_slower_than_the_proof():
    # 100 modes from 1 to 1e4 rad/s, damping 1e-3, in random orthogonal coordinates, 3 x 3.
    rng = np.random.default_rng(0)
    w, z = np.geomspace(1, 1e4, 100), 1e-3
    turn = np.sqrt(1 - z * z)
    A = linalg.block_diag(*([[-z * x, x * turn], [-x * turn, -z * x]] for x in w))
    Q = np.linalg.qr(rng.normal(size=A.shape))[0]
    B, C = rng.normal(size=(200, 3)), rng.normal(size=(3, 200))
    system = control.ss(Q @ A @ Q.T, Q @ B, C @ Q.T, 0)
    seconds, found = {}, {}
    for exact in (True, False) * 2:  # the first compiles
        start = time.process_time()
        found[exact] = rp.hinf_norm(system, exact=exact)
        seconds[exact] = time.process_time() - start
    peaks = np.sqrt(np.clip(1 - 2 * z * z, 0, None)) * w
    reached = rp.linear.singular_values(system, peaks / (2 * np.pi)).isel(singular_value=0).max()
    assert float(reached) <= found[True].upper
    assert found[False].value == pytest.approx(found[True].value, rel=1e-6)
    assert seconds[False] < 2 * seconds[True]


def test_two_peaks_of_almost_one_height():
    first, second = oscillator(1.0, 1e-3), oscillator(7.0, 1e-3 * (1 - 1e-7))
    both = control.append(first, second)
    system = ss(both.A, both.B, both.C, both.D)
    mixed = ss(both.A, both.B @ [[1], [1]], [[1, 1]] @ both.C)
    assert hinf_norm(system).frequency == pytest.approx(7, rel=1e-4)
    norm = hinf_norm(mixed)
    sampled = np.concatenate([w + np.linspace(-1e-3, 1e-3, 2001) * w for w in (1.0, 7.0)])
    assert abs(mixed(1j * sampled)).max() == pytest.approx(norm.value, rel=1e-5)
    assert abs(mixed(1j * sampled)).max() <= norm.upper


@pytest.mark.parametrize(("dissipation", "value"), [(0.01, 0.00211825), (0.001, 0.0211825)])
def test_the_open_loop_of_the_thesis(dissipation, value):
    plant = air_bearing(AirBearingParameters.as_published(), dissipation=dissipation)
    assert hinf_norm(plant.open_loop).value == pytest.approx(value, rel=5e-6)


@pytest.mark.parametrize("pole", [1e-300, 1e-9, 1e9, 1e300])
def test_exponents_near_the_ends_of_double_precision(pole):
    assert hinf_norm(ss([[-pole]], [[pole]], [[1]])).value == pytest.approx(1)
    assert hinf_norm(ss([[-pole]], [[1]], [[pole]])).value == pytest.approx(1)


def test_rates_far_apart_and_equal_modes():
    A = np.diag([-1e-9, -1e9, -1e17]) + np.triu(np.ones((3, 3)), 1)
    assert hinf_norm(ss(A, np.ones((3, 1)), np.ones((1, 3)))).value == pytest.approx(1e9 + 1)
    many = ss(-np.eye(8), np.ones((8, 2)), np.ones((2, 8)))
    assert hinf_norm(many).value == pytest.approx(16)
    all_pass = ss([[-1]], [[2]], [[-1]], 1)  # (s - 1)/(s + 1): the same gain everywhere
    assert hinf_norm(all_pass).value == pytest.approx(1, rel=1e-12)


def test_bad_input_is_refused():
    with pytest.raises(InvalidInputError, match=r"system: got ndarray.*control\.ss"):
        hinf_norm(np.eye(2))
    with pytest.raises(InvalidInputError, match=r"tolerance: got 0\.9"):
        hinf_norm(oscillator(1, 0.1), tolerance=0.9)
    system = oscillator(1, 0.1)
    system.A[0, 0] = np.nan
    with pytest.raises(InvalidInputError, match=r"system\.A.*nan"):
        hinf_norm(system)


# The H2 norm.


@pytest.mark.parametrize("w", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("zeta", [1e-12, 1e-6, 0.05])
def test_an_oscillator_has_its_textbook_norm(w, zeta):
    norm = h2_norm(ss([[0, 1], [-w * w, -2 * zeta * w]], [[0], [w * w]], [[1, 0]]))
    assert norm.value == pytest.approx(np.sqrt(w / (4 * zeta)), rel=1e-9)
    assert norm.lower <= norm.value <= norm.upper <= norm.lower * (1 + 2e-9)


@pytest.mark.parametrize(
    ("system", "value"),
    [
        (ss([[-2]], [[1]], [[1]]), 0.5),
        (ss([[0.6]], [[1]], [[1]], 0, True), 1.25),
        (ss([[0.6]], [[1]], [[1]], 2, 0.1), np.sqrt(1.25**2 + 4)),
        (ss(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 2, True), 2),
        (ss([[-1, 0], [0, -1]], [[1], [1]], [[1, -1]]), 0),
        (ss([[-1, 0], [0, -4]], np.eye(2), np.eye(2)), np.sqrt(0.5 + 0.125)),
    ],
)
def test_small_systems_h2(system, value):
    norm = h2_norm(system)
    assert norm.stable
    assert norm.value == pytest.approx(value, rel=1e-12)


def test_a_hidden_pole_on_the_axis_leaves_the_norm_finite_h2():
    norm = h2_norm(ss([[0, 0], [0, -2]], [[1], [1]], [[0, 1]]))
    assert norm.value == pytest.approx(0.5)
    assert not norm.stable


def test_the_open_loop_of_the_thesis_h2():
    plant = air_bearing(AirBearingParameters.as_published(), dissipation=0.01)
    assert h2_norm(plant.open_loop).value == pytest.approx(0.00294744, rel=2e-6)


def test_bad_input_is_refused_h2():
    with pytest.raises(InvalidInputError, match="system: got FrequencyResponseData"):
        h2_norm(control.frd([1, 2], [1, 2]))
    with pytest.raises(InvalidInputError, match="tolerance"):
        h2_norm(ss([[-1]], [[1]], [[1]]), tolerance=-1)


# Both norms by linear matrix inequalities.


def system(seed, feedthrough=0.0):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    A = rng.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.05) * np.eye(n)
    units, rate = 10.0 ** rng.uniform(-4, 4, n), 10.0 ** rng.uniform(-6, 6)
    B, C = rng.standard_normal((n, 2)), rng.standard_normal((2, n))
    return control.StateSpace(
        A * units / units[:, None] * rate,
        B / units[:, None] * rate,
        C * units,
        feedthrough * rng.standard_normal((2, 2)),
    )


@pytest.mark.parametrize("dissipation", [0.01, 0.001])
def test_the_open_loop_of_the_thesis_lmi(dissipation):
    G = air_bearing(AirBearingParameters.as_published(), dissipation=dissipation).open_loop
    hinf, h2 = hinf_norm_lmi(G), h2_norm_lmi(G)
    assert hinf.verified
    assert h2.verified
    assert hinf.value == pytest.approx(hinf_norm(G).value, rel=1e-4)
    assert h2.value == pytest.approx(h2_norm(G).value, rel=1e-4)
    assert lyapunov_lmi(G)


@pytest.mark.parametrize("equation", ["10.17", "10.44", "10.45"])
@pytest.mark.parametrize("seed", range(4))
def test_norms_agree(seed, equation):
    """What is verified is a proof in rational arithmetic, and hardly above the norm."""
    if equation == "10.45":
        G = system(seed)
        check, norm = h2_norm_lmi(G), h2_norm(G)
    else:
        G = system(seed, feedthrough=seed % 2)
        check, norm = hinf_norm_lmi(G, equation=equation), hinf_norm(G)
    assert check.verified
    assert norm.lower <= check.value <= norm.value * (1 + 1e-4)
    assert check.optimum == pytest.approx(norm.value, rel=1e-4)


def test_the_matrices_hold_in_the_units_given():
    G = system(1)
    K = hinf_norm_lmi(G).matrix
    gamma = hinf_norm_lmi(G).value * 1.0001
    T = 1 / np.sqrt(np.diag(K))  # even units, so that eigenvalues mean something
    A, B, C, K = G.A * T / T[:, None], G.B / T[:, None], G.C * T, K * T * T[:, None]
    rows = np.block([[A.T @ K + K @ A + C.T @ C, K @ B], [B.T @ K, -(gamma**2) * np.eye(2)]])
    weights = 1 / np.sqrt(abs(np.diag(rows)))
    assert np.linalg.eigvalsh(rows * weights * weights[:, None]).max() < 0
    check = h2_norm_lmi(G)
    P = check.matrix
    assert np.trace(G.C @ np.linalg.solve(P, G.C.T)) < check.value * (1 + 1e-9)


def test_unstable_systems_have_no_proof():
    G = control.ss([[1.0]], [[1.0]], [[1.0]], 0)
    assert not lyapunov_lmi(G)
    assert not hinf_norm_lmi(G)
    assert hinf_norm_lmi(G).value == np.inf
    assert not h2_norm_lmi(G)


def test_bad_input_is_refused_lmi():
    with pytest.raises(InvalidInputError, match="discrete"):
        hinf_norm_lmi(control.ss([[0.5]], [[1]], [[1]], 0, 0.1))
    with pytest.raises(InvalidInputError, match=r"system\.D"):
        h2_norm_lmi(control.ss([[-1]], [[1]], [[1]], 1))
    with pytest.raises(InvalidInputError, match="equation"):
        hinf_norm_lmi(system(0), equation="10.16")


# States, units and the order of signals do not matter.


def random_system(seed, sampled):
    rng = np.random.default_rng(seed)
    n, m, p = rng.integers(1, 7), rng.integers(1, 4), rng.integers(1, 4)
    A = rng.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + rng.choice([0.01, 0.3])) * np.eye(n)
    if sampled:
        A = np.linalg.solve(np.eye(n) - A, np.eye(n) + A)
    B, C = rng.standard_normal((n, m)), rng.standard_normal((p, n))
    D = rng.standard_normal((p, m)) if sampled else np.zeros((p, m))
    return rng, A, B, C, D


def norms(A, B, C, D, dt, exact=True):
    system = control.StateSpace(A, B, C, D, dt, remove_useless_states=False)
    return hinf_norm(system, exact=exact).value, h2_norm(system).value


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), sampled=st.booleans(), exact=st.booleans())
def test_norms_do_not_depend_on_the_realisation(seed, sampled, exact):
    rng, A, B, C, D = random_system(seed, sampled)
    dt, n = (0.1 if sampled else 0), len(A)
    reference = norms(A, B, C, D, dt)
    T = np.linalg.qr(rng.standard_normal((n, n)))[0]
    T = T * 10 ** rng.uniform(-4, 4, n)  # mixed states in any units
    back = np.linalg.inv(T)
    assert norms(back @ A @ T, back @ B, C @ T, D, dt, exact) == pytest.approx(reference, rel=1e-6)
    # The transposed system has the same singular values.
    assert norms(A.T, C.T, B.T, D.T, dt, exact) == pytest.approx(reference, rel=1e-8)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), sampled=st.booleans())
def test_norms_do_not_depend_on_order_and_follow_units(seed, sampled):
    rng, A, B, C, D = random_system(seed, sampled)
    dt, n = (0.1 if sampled else 0), len(A)
    hinf, h2 = norms(A, B, C, D, dt)
    x, u, y = (rng.permutation(size) for size in (n, B.shape[1], C.shape[0]))
    shuffled = A[np.ix_(x, x)], B[np.ix_(x, u)], C[np.ix_(y, x)], D[np.ix_(y, u)]
    assert norms(*shuffled, dt) == pytest.approx((hinf, h2), rel=1e-8)
    unit, rate = 10 ** rng.uniform(-6, 6), 1.0 if sampled else 10 ** rng.uniform(-6, 6)
    slower = norms(rate * A, rate * unit * B, C, unit * D, dt)
    assert slower == pytest.approx((unit * hinf, unit * np.sqrt(rate) * h2), rel=1e-8)


# Singular values of a frequency response.


def test_each_is_that_of_the_response():
    rng = np.random.default_rng(0)
    A = rng.standard_normal((4, 4)) * 100 - 300 * np.eye(4)
    system = control.ss(A, rng.standard_normal((4, 2)), rng.standard_normal((3, 4)), 0)
    hertz = np.array([0.0, 7.0, 300.0])
    found = rp.linear.singular_values(system, hertz)
    assert found.dims == ("frequency", "singular_value")
    for f, values in zip(hertz, found.values, strict=True):
        expected = np.linalg.svd(system(2j * np.pi * f), compute_uv=False)
        np.testing.assert_allclose(values, expected, rtol=1e-10)


def test_sampled_systems_count_in_hertz_too():
    system = control.ss(0.5, 1.0, 1.0, 0.0, 0.01)
    found = rp.linear.singular_values(system, [0.0, 50.0])  # the second is half the sampling rate
    np.testing.assert_allclose(found.isel(singular_value=0), [2.0, 1 / 1.5])


def test_the_grid_sees_a_narrow_resonance():
    zeta, w = 1e-6, 300.0
    system = control.ss([[0, 1], [-w * w, -2 * zeta * w]], [[0], [w * w]], [[1, 0]], 0)
    found = rp.linear.singular_values(system)
    assert float(found.max()) == pytest.approx(1 / (2 * zeta), rel=1e-3)
    frequency = found["frequency"].values
    assert frequency[0] <= w / (20 * np.pi) * 1.001
    assert frequency[-1] >= 10 * w / (2 * np.pi) * 0.999


def test_a_pole_on_the_boundary_has_an_infinite_gain():
    assert float(rp.linear.singular_values(control.ss(0.0, 1.0, 1.0, 0.0), [0.0])[0, 0]) == np.inf


@pytest.mark.parametrize("bad", [[-1.0], [np.nan], [[1.0, 2.0]]])
def test_bad_frequencies_are_named(bad):
    with pytest.raises(InvalidInputError, match="frequencies_hz: got"):
        rp.linear.singular_values(control.ss(-1.0, 1.0, 1.0, 0.0), bad)
