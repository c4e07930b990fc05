"""Observers and free runs against closed forms and second integrators."""

import numpy as np
import pytest
import xarray as xr
from scipy.linalg import expm, solve_discrete_are
from scipy.signal import lsim

import robustpolish as rp
from robustpolish.identification.observer.kalman import (
    Level,
    LinearObserver,
    PortForces,
    Scales,
    riccati,
    scales_of,
)
from robustpolish.identification.observer.runs import StartedPiece, free_run, reproducibility, rest
from robustpolish.identification.observer.starts import smooth
from robustpolish.identification.record import record_of
from tests.identification.oscillators import PLACE, RATE, oscillator, record


@pytest.mark.parametrize("units", [1.0, 1e-9])
def test_the_riccati_equation_is_solved(units):
    """Against SciPy's solver in ordinary units; in odd ones the solution scales with them."""
    random = np.random.default_rng(1)
    F, C = random.standard_normal((5, 5)) / 2, random.standard_normal((2, 5))
    root = random.standard_normal((7, 7))
    joint = root @ root.T  # of noise on the states and on the outputs
    Q, N, R = joint[:5, :5], joint[:5, 5:], joint[5:, 5:]
    expected = solve_discrete_are(F.T, C.T, Q, R, s=N)
    T = np.diag([1.0, units, 1.0, 1 / units, 1.0])
    F, C = T @ F @ np.linalg.inv(T), units * C @ np.linalg.inv(T)
    found = riccati(F, C, T @ Q @ T, units**2 * R, units * T @ N)
    np.testing.assert_allclose(found, T @ expected @ T, rtol=1e-6)


DT, SAMPLES = 0.01, 300
SCALES = Scales(np.array([1e-4]), np.array([1.0]), np.array([1.0]), 25.0, 0.5, np.zeros(1), 1.0)
RANDOM = np.random.default_rng(2)
FORCE = RANDOM.standard_normal((SAMPLES, 1))
START = np.array([2e-3, -0.05, 0.0])


def observer(level=0.1):
    return LinearObserver(oscillator(), DT, Level(level), SCALES)


def measured(forces=FORCE, start=START):
    """What an oscillator shows whose force is linear between the samples, by SciPy."""
    system = ([[0.0, 1.0], [-400.0, -1.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    return lsim(system, forces, DT * np.arange(SAMPLES), start[:2])[1][:, None]


def test_a_known_force_is_no_innovation():
    push = RANDOM.standard_normal((1, SAMPLES))
    Y = measured(FORCE + push.T)
    known = PortForces(np.ones((1, 1)), [PLACE], push)
    errors = observer().innovations(Y, FORCE, known, START)[1]
    np.testing.assert_allclose(errors, 0.0, atol=1e-12)


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


SECONDS = np.arange(3000) / RATE
LEVELS = tuple(Level(share) for share in (0.01, 0.1, 1.0))


def pushed(hidden, noise=1e-3):
    """An oscillator under a known force and a hidden one, by SciPy; and its true motion."""
    force = np.sin(9 * SECONDS) + np.sin(31 * SECONDS)
    system = ([[0.0, 1.0], [-400.0, -1.0]], [[0.0], [1.0]], np.eye(2), np.zeros((2, 1)))
    motion = lsim(system, force + hidden, SECONDS)[1].T
    x = motion[0] + noise * np.std(motion[0]) * np.random.default_rng(0).standard_normal(3000)
    data = xr.Dataset({"F": ("time", force), "x": ("time", x)}, {"time": SECONDS})
    return data, motion


def smoothed(model, data, levels=LEVELS):
    held = record_of(model, data)
    return smooth(model, held, scales_of(model, held), levels)


def test_a_hidden_force_is_found_with_the_motion():
    hidden = 0.5 * np.sin(13 * SECONDS)
    data, motion = pushed(hidden)
    found = smoothed(oscillator(), data)
    middle = slice(300, -300)
    assert np.std(found.force[0, middle] - hidden[middle]) < 0.1 * np.std(hidden)
    np.testing.assert_allclose(found.q[0], motion[0], atol=2e-3 * np.std(motion[0]))
    np.testing.assert_allclose(found.outputs[:, 0], found.q[0])
    # what model and record say of the acceleration, the hidden force left out
    expected = data["F"].values - 400 * found.q[0] - found.v[0]
    np.testing.assert_allclose(found.a[0], expected)
    start = found.start(oscillator(), 700)
    np.testing.assert_array_equal(start.state, [found.q[0, 700], found.v[0, 700]])


def judged(model, data, outputs=None, **options):
    held = record_of(model, data)
    run, piece = free_run(model, held), StartedPiece(held, rest(model))
    outputs = run.over(piece).outputs if outputs is None else outputs
    return reproducibility(run, piece, outputs, **options)


def test_changes_grow_as_the_matrix_exponential_says():
    """Poles at +5 and -5 1/s; what is beyond a thousandth of the output's size matters."""
    model, held = oscillator(stiffness=-25.0, damping=0.0), record_of(oscillator(), record(1000))
    run, piece = free_run(model, held), StartedPiece(held, rest(model))
    seen = run.over(piece, keep=True)
    found = reproducibility(run, piece, seen.outputs)
    moved = 1e-6 * np.std(seen.states, axis=0)
    time = np.arange(1000) / RATE
    change = (moved[0] * np.cosh(5 * time) + moved[1] * np.sinh(5 * time) / 5) / np.std(held.Y)
    assert found.growth == pytest.approx(1e6 * change.max(), rel=1e-4)
    assert found.diverged_after == pytest.approx(time[change > 1e-3][0])
    assert not found.reproducible
    assert f"within {found.diverged_after:.4g} s" in found.reason
    assert judged(model, record(1000), span=0.1).reproducible


# A record of an oscillator that started in motion, with an effect or without.


def case(effect=None, start=(2e-3, 0.1)):
    model = oscillator(damping=0.8)
    if effect:
        model = model.with_effect(*effect)
    time = np.arange(1200) * 5e-3
    force = np.random.default_rng(0).standard_normal(time.size)
    data = xr.Dataset({"F": ("time", force)}, {"time": time})
    data["x"] = ("time", 2e-3 * np.ones(time.size))  # decides on the steps, as below
    x = rp.simulation.simulate_model(model, data, initial_state=start).outputs[:, 0]
    return model, record_of(model, data.assign(x=("time", x)))


@pytest.mark.parametrize(
    "effect",
    [None, ("cubic_stiffness", PLACE, {"stiffness": 1e7}), ("dahl_friction", PLACE,
     {"force": 0.2, "stiffness": 4e3}), ("input_delay", ("F",), {"delay": 0.013})],
)  # fmt: skip
@pytest.mark.parametrize("keep", [True, False])
def test_windows_run_together_are_those_run_one_by_one(effect, keep):
    """Bit for bit, of any lengths, each from its own start."""
    model, record = case(effect)
    run, random = free_run(model, record), np.random.default_rng(2)
    pieces = []
    for begin, end in ((0, 7), (7, 300), (300, 301), (250, 1200)):
        start = rest(model)
        vector = start.vector + random.standard_normal(start.vector.size) * 1e-3
        pieces.append(StartedPiece(record.part(begin, end), start.with_vector(vector)))
    together = run.over_all(pieces, keep)
    alone = [run.over(piece, keep) for piece in pieces]
    for name in ("outputs", "states", "internal"):
        expected = np.concatenate([getattr(one, name) for one in alone])
        np.testing.assert_array_equal(getattr(together, name), expected)
    measured = np.concatenate([piece.record.Y for piece in pieces])
    np.testing.assert_array_equal(run.all_errors(pieces), measured - together.outputs)
