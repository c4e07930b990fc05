import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import lsim

from robustpolish.identification.observer.kalman import Level, LinearObserver, PortForces, Scales
from tests.identification.oscillators import PLACE, oscillator

DT, SAMPLES = 0.01, 300
SCALES = Scales(np.array([1e-4]), np.array([1.0]), np.array([1.0]), 25.0, 0.5, np.zeros(1))
RANDOM = np.random.default_rng(2)
FORCE = RANDOM.standard_normal((SAMPLES, 1))
START = np.array([2e-3, -0.05, 0.0])


def observer(level=0.1):
    return LinearObserver(oscillator(), DT, Level(level), SCALES)


def measured(forces=FORCE, start=START):
    """What an oscillator shows whose force is linear between the samples, by SciPy."""
    system = ([[0.0, 1.0], [-400.0, -1.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    return lsim(system, forces, DT * np.arange(SAMPLES), start[:2])[1][:, None]


def test_the_model_s_own_data_leave_no_innovations():
    states, errors = observer().innovations(measured(), FORCE, None, START)
    np.testing.assert_allclose(errors, 0.0, atol=1e-12)
    np.testing.assert_allclose(states[0], START)


def test_a_known_force_is_no_innovation():
    push = RANDOM.standard_normal((1, SAMPLES))
    Y = measured(FORCE + push.T)
    known = PortForces(np.ones((1, 1)), [PLACE], push)
    errors = observer().innovations(Y, FORCE, known, START)[1]
    np.testing.assert_allclose(errors, 0.0, atol=1e-12)
    assert known.head(10).values.shape == (1, 10)


def test_responses_are_what_forces_outputs_and_starts_add_to_the_innovations():
    seen, Y = observer(), RANDOM.standard_normal((SAMPLES, 1))
    plain = seen.innovations(Y, FORCE, None)[1]
    push = RANDOM.standard_normal((1, SAMPLES))
    known = seen.innovations(Y, FORCE, PortForces(np.ones((1, 1)), [PLACE], push))[1]
    found = seen.respond(np.ones((1, 1)), [PLACE], push[None])[0]
    np.testing.assert_allclose(found, plain - known, atol=1e-12)
    moved = seen.innovations(Y + push.T, FORCE, None)[1]
    np.testing.assert_allclose(seen.respond_outputs(push[None])[0], moved - plain, atol=1e-12)
    for i, found in enumerate(seen.respond_start(SAMPLES)):
        other = seen.innovations(Y, FORCE, None, np.eye(3)[i])[1]
        np.testing.assert_allclose(found, plain - other, atol=1e-11)


def test_the_start_is_found_from_the_innovations():
    seen = observer()
    errors = seen.innovations(measured(), FORCE, None)[1]
    found = seen.likeliest_start(errors, np.full(2, np.inf))
    np.testing.assert_allclose(found, START, atol=1e-6)
    held = seen.likeliest_start(errors, np.array([1e-9, 1.0]))
    assert abs(held[0]) < 1e-6  # what cannot move does not


def test_smoothing_is_the_mean_of_all_states_given_all_data():
    """Against one dense Gaussian of all states and outputs."""
    seen, count = observer(), 12
    P, S, C = seen.gain.covariance, seen.gain.innovation, seen.system.C
    F = expm(seen.system.A * DT)
    Q = P - F @ P @ F.T + F @ P @ C.T @ np.linalg.solve(S, C @ P @ F.T)
    R = S - C @ P @ C.T
    covariance = np.zeros((3 * count, 3 * count))
    here = P
    for k in range(count):
        block = here
        for j in range(k, count):
            covariance[3 * j : 3 * j + 3, 3 * k : 3 * k + 3] = block
            covariance[3 * k : 3 * k + 3, 3 * j : 3 * j + 3] = block.T
            block = F @ block
        here = F @ here @ F.T + Q
    shows = np.kron(np.eye(count), C)
    Y = 1e-3 * RANDOM.standard_normal((count, 1))
    gain = (
        covariance
        @ shows.T
        @ np.linalg.inv(shows @ covariance @ shows.T + np.kron(np.eye(count), R))
    )
    expected = (gain @ Y.ravel()).reshape(count, 3)
    found = seen.smooth(*seen.innovations(Y, np.zeros((count, 1)), None))
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("level", [0.01, 1.0])
def test_the_observer_forgets(level):
    assert np.max(np.abs(np.linalg.eigvals(observer(level).L))) < 1
