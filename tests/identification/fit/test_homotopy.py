import numpy as np
import pytest

from robustpolish.identification import compare
from robustpolish.identification.fit.homotopy import (
    best_stage,
    free_rms,
    guided_rms,
    homotopy,
    judged,
)
from robustpolish.identification.fit.prepared import prepare
from robustpolish.identification.observer.kalman import FREE, Level
from robustpolish.identification.policy import POLICY
from robustpolish.identification.record import record_of
from tests.identification.oscillators import double_well, oscillator, record

LEVELS = (Level(1.0), Level(0.1), FREE)


def prepared_of(model, data):
    return prepare(model, record_of(model, data), POLICY)


def fitted(model, **options):
    prepared = prepared_of(model, record(2000, noise=0.01))
    return prepared, homotopy(model, prepared, prepared.trial, model, LEVELS, **options)


def test_a_distant_model_is_led_to_the_data_and_then_let_go():
    """At 150 instead of 400 N/m a free run is out of phase after a second."""
    prepared, stages = fitted(oscillator(stiffness=150.0))
    assert len(stages) == 3
    found = best_stage(stages, prepared)
    numbers = found.model.parameters
    assert numbers["spring[0].stiffness"] / numbers["dof.x.mass"] == pytest.approx(400, rel=0.01)
    assert found.reproducible
    noise = 0.01 * np.std(record(2000)["x"].values)
    np.testing.assert_allclose(found.error, noise, rtol=0.1)
    np.testing.assert_array_equal(found.error, found.free)


def test_what_is_not_worth_while_is_given_up():
    asked = []

    def enough(level, fit):
        asked.append(level)
        return level != LEVELS[1]

    assert fitted(oscillator(), enough=enough)[1] == []
    assert asked == list(LEVELS[:2])


def test_a_wrong_model_is_led_closer_than_it_runs():
    prepared, stages = fitted(oscillator())
    right, wrong = judged(stages[-1], prepared), oscillator(stiffness=150.0)
    free, calm = free_rms(wrong, prepared, prepared.held_out)
    led = guided_rms(wrong, prepared, prepared.held_out, Level(1.0))
    assert calm
    assert right.error < led < 0.1 * free


@pytest.mark.parametrize("length", [50, 66, 74, 100])
def test_comparison_and_diagnosis_agree_on_what_is_reproducible(length):
    model, data = double_well(length)
    prepared = prepared_of(model, data)
    calm = free_rms(model, prepared, prepared.everything)[1]
    assert calm == compare(model, data).reproducible
