"""The H-infinity norm: known values, odd systems, the thesis's numbers, bad input."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robustpolish.errors import InvalidInputError
from robustpolish.linear.norms import peak as certified_peak
from robustpolish.linear.norms import peak as peak_search
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.polishing.air_bearing import AirBearingParameters, air_bearing


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


@pytest.mark.parametrize(
    ("system", "told"),
    [
        (ss([[0]], [[1]], [[1]]), "pole 0 rad/s on the imaginary axis"),
        (ss([[0, 1], [-4, 0]], [[0], [1]], [[1, 0]]), "2j rad/s on the imaginary axis"),
        (ss([[3]], [[1]], [[0]]), "pole 3 rad/s in the right half-plane"),  # hidden, yet unstable
        (ss([[1e-20]], [[1]], [[1]]), "1e-20 rad/s in the right half-plane"),
        (ss([[-1]], [[1]], [[1]], 0, True), "pole -1 on the unit circle"),
        (ss([[2]], [[1]], [[1]], 0, True), "pole 2 outside the unit circle"),
    ],
)
def test_infinite_norms_say_why(system, told):
    norm = hinf_norm(system)
    assert norm.value == np.inf
    assert not norm.stable
    assert told in norm.reason


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


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    states=st.integers(1, 6),
    time=st.floats(-9, 9),
    sampled=st.booleans(),
)
def test_units_do_not_change_the_norm(seed, states, time, sampled):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((states, states))
    A -= (np.linalg.eigvals(A).real.max() + rng.choice([1e-6, 0.1])) * np.eye(states)
    if sampled:
        A = np.linalg.solve(np.eye(states) - A, np.eye(states) + A)
    B, C = rng.standard_normal((states, 2)), rng.standard_normal((2, states))
    D = rng.standard_normal((2, 2)) * rng.choice([0, 1])
    # powers of two, so that both systems are the same to the last bit
    units = 2.0 ** rng.integers(-40, 40, states)
    rate = 1.0 if sampled else float(2.0 ** np.round(time * 3.3))
    dt = 1.0 if sampled else 0
    one = hinf_norm(ss(A, B, C, D, dt))
    other = hinf_norm(
        ss(A * units / units[:, None] * rate, B / units[:, None] * rate, C * units, D, dt)
    )
    assert other.value == pytest.approx(one.value, rel=2e-9)
    estimate = hinf_norm(ss(A, B, C, D, dt), exact=False)
    assert estimate.lower <= one.upper
    assert one.lower <= estimate.upper
    assert estimate.value == pytest.approx(one.value, rel=1e-6)


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


def large_system():
    rng = np.random.default_rng(0)
    A = rng.standard_normal((100, 100)) - 12 * np.eye(100)
    return ss(A, rng.standard_normal((100, 3)), rng.standard_normal((2, 100)))


def sampled_gain(system):
    return max(np.linalg.norm(system(1j * x), 2) for x in np.linspace(0, 40, 400))


@pytest.mark.parametrize("exact", [True, False])
def test_large_systems_take_no_hamiltonian(monkeypatch, exact):
    """Modal coordinates do, even for a bracket that is proven and narrow."""
    monkeypatch.setattr(peak_search, "hamiltonian", None)
    norm = hinf_norm(large_system(), exact=exact)
    assert sampled_gain(large_system()) <= norm.upper <= norm.lower * (1 + 2e-9)
    assert ("errors enclosed" in norm.reason) is exact


def test_without_modal_coordinates_it_takes_few_hamiltonians(monkeypatch):
    sizes = []

    def counted(model, gamma, hamiltonian=peak_search.hamiltonian):
        sizes.append(model.states)
        return hamiltonian(model, gamma)

    monkeypatch.setattr(peak_search, "hamiltonian", counted)
    monkeypatch.setattr(certified_peak, "modal_form", lambda *_: None)
    norm = hinf_norm(large_system())
    assert 2 <= len(sizes) <= 8
    assert set(sizes) == {100}
    assert sampled_gain(large_system()) <= norm.upper <= norm.lower * (1 + 1e-6)


def test_bad_input_is_refused():
    with pytest.raises(InvalidInputError, match=r"system: got TransferFunction.*control\.ss"):
        hinf_norm(control.tf([1], [1, 1]))
    with pytest.raises(InvalidInputError, match=r"tolerance: got 0\.9"):
        hinf_norm(oscillator(1, 0.1), tolerance=0.9)
    system = oscillator(1, 0.1)
    system.A[0, 0] = np.nan
    with pytest.raises(InvalidInputError, match=r"system\.A.*nan"):
        hinf_norm(system)
