import numpy as np
import pytest
from scipy.signal import lfilter

from robustpolish.identification.observer.kalman import FREE, Level, LinearObserver
from robustpolish.identification.policy import POLICY
from robustpolish.identification.structure.screening import (
    FilteredRecord,
    autoregression,
    candidate_columns,
    has_lightly_damped_mode,
    nuisance_columns,
    null_score,
)
from robustpolish.machines.effects.effect import lookup
from tests.identification.discover.searches import prepared_of
from tests.identification.oscillators import PLACE, of_rig, oscillator, record, rig

DATA = of_rig(3000, noise=2.0)
X, V = DATA["x"].values, DATA["v"].values
CUBIC = DATA.assign(f=DATA["f"] + 40 * DATA["x"] ** 3)


def seen_of(model, data):
    prepared = prepared_of(model, data)
    motion = prepared.motion(model, prepared.record)
    return FilteredRecord(model, prepared, prepared.record, FREE, motion), motion


def test_the_model_s_own_errors_are_taken_out():
    """Three per cent of the stiffness and ten of the damping are no missing effect."""
    seen, _ = seen_of(rig(48.5, 4.4), DATA)
    assert np.std(seen.errors) > 1.1 * 2.0
    assert np.std(seen.residual(None)[0]) == pytest.approx(2.0, rel=0.03)


def test_an_effect_and_the_model_s_numbers_share_the_data_as_in_a_regression():
    seen, motion = seen_of(rig(), CUBIC)
    record = prepared_of(rig(), CUBIC).record
    (cubic,) = candidate_columns(rig(), lookup("cubic_stiffness"), PLACE, motion, record)
    rest, found = seen.residual(seen.weighted(seen.respond(cubic)))
    error = CUBIC["f"].values - 50 * X - 4 * V
    columns = np.column_stack([X, V, X**3])
    expected = np.linalg.lstsq(columns, error, rcond=None)[0]
    np.testing.assert_allclose(found, expected[2], rtol=0.01)
    assert np.std(rest[:, 0] - (error - columns @ expected)) < 0.02
    (offset,) = candidate_columns(rig(), lookup("sensor_offset"), ("f",), motion, record)
    np.testing.assert_allclose(seen.respond(offset)[0], 1.0)


def test_what_hides_behind_the_model_s_own_numbers_is_no_candidate():
    model = rig().with_effect("cubic_stiffness", PLACE, {"stiffness": 30.0})
    seen, _ = seen_of(model, CUBIC)
    assert np.std(seen.residual(None)[0]) == pytest.approx(2.0, rel=0.03)
    cubic = seen.weighted((X**3)[None, :, None])
    assert np.isnan(seen.residual(cubic)[1]).all()


def test_along_a_motion_that_no_observer_followed_nothing_is_a_candidate():
    seen, _ = seen_of(rig(), CUBIC)
    lost = np.full((2, *seen.errors.shape), np.nan)
    rest, found = seen.residual(seen.weighted(lost))
    assert np.isnan(found).all()
    assert rest is seen.errors


def test_an_error_of_a_spring_leaves_what_a_softer_model_would():
    """The column of a stiffness is the derivative of the innovations to it."""
    model, data = oscillator(), record(samples=800, noise=0.01)
    prepared = prepared_of(model, data)
    motion = prepared.motion(model, prepared.record)
    columns, ridge = nuisance_columns(
        model, POLICY, LinearObserver(model, 1 / 500, FREE, prepared.scales), motion,
        prepared.record,
    )  # fmt: skip
    innovations = []
    for stiffness in (400.0, 400.4):
        observer = LinearObserver(oscillator(stiffness), 1 / 500, FREE, prepared.scales)
        start = np.array([motion.q[0, 0], motion.v[0, 0], 0.0])
        innovations.append(observer.innovations(prepared.record.Y, motion.inputs, None, start)[1])
    change = (innovations[0] - innovations[1])[:, 0] / 0.4
    assert np.std(columns[0, :, 0] - change) < 0.05 * np.std(change)
    # spring, damper, mass, gain of the force, and two of the start
    np.testing.assert_allclose(ridge, [1 / 40, 1 / 0.5, 1 / 0.05, 1 / 0.05, 0.0, 0.0])


def test_a_better_model_is_likelier():
    data = record(noise=0.01).isel(time=slice(None, None, 10))
    right, wrong = (
        null_score(model, prepared_of(model, data))
        for model in (oscillator(), oscillator(stiffness=150.0))
    )
    assert right < wrong - 50


@pytest.mark.parametrize("level", [FREE, Level(0.1)])
def test_information_criteria_count_parameters_and_colour(level):
    prepared = prepared_of(oscillator(), record(noise=0.01))
    motion = prepared.motion(oscillator(), prepared.record)
    seen = FilteredRecord(oscillator(), prepared, prepared.record, level, motion)
    white = np.random.default_rng(0).standard_normal((5000, 1))
    scores = seen.scores(3.0 * white, 2, (0, 1))
    expected = 5000 * np.log(9 * np.mean(white**2)) + 2 * np.log(5000)
    assert scores[0] == pytest.approx(expected)
    assert scores[1] > scores[0]
    coloured = lfilter([1.0], [1.0, -0.9], white, axis=0)
    scores = seen.scores(coloured, 0, (0, 1))
    assert scores[0] - scores[1] == pytest.approx(5000 * np.log(1 / 0.19), rel=0.05)
    assert seen.scores(np.full((9, 1), np.nan), 0, (0, 1)) == {0: np.inf, 1: np.inf}


def test_a_noise_model_is_found():
    e = lfilter([1.0], [1.0, -1.2, 0.5], np.random.default_rng(0).standard_normal(100_000))
    np.testing.assert_allclose(autoregression(e, 2), [1.0, -1.2, 0.5], atol=0.01)
    np.testing.assert_array_equal(autoregression(e, 0), [1.0])


@pytest.mark.parametrize("damping", [0.2, 0.5])
def test_noise_that_resonates_is_a_machine(damping):
    pole = np.exp(0.3 * (-damping + 1j * np.sqrt(1 - damping**2)))
    a = np.poly([pole, pole.conjugate(), 0.9]).real
    assert has_lightly_damped_mode(a, 0.35) == (damping < 0.35)
    assert not has_lightly_damped_mode(np.ones(1), 0.35)
