import numpy as np
import pytest
from scipy.linalg import expm

from robustpolish.errors import InvalidInputError
from robustpolish.identification.compare import compare
from robustpolish.identification.free_runs import predict
from robustpolish.identification.observer.missing_force import best_observer_run
from robustpolish.identification.observer.runs import free_run
from robustpolish.identification.record import record_of
from tests.identification.oscillators import RATE, of_rig, oscillator, record, rig


def predicted(model, data, horizon):
    held = record_of(model, data)
    return predict(free_run(model, held), held, horizon)[0][:, 0]


def test_each_prediction_is_a_free_decay_from_what_the_observer_saw():
    """Without an input that is the matrix exponential; the missing force is not carried on."""
    model, data = oscillator(stiffness=300.0, inputs=[]), record(samples=600, noise=0.01)
    seen = best_observer_run(model, record_of(model, data))
    assert np.abs(seen.states[:, 2]).max() > 0.1  # the observer takes the input for missing
    step = expm(np.array([[0.0, 1.0], [-300.0, -1.0]]) * 20 / RATE)
    found = predicted(model, data, 20 / RATE)
    assert np.isnan(found[:20]).all()
    np.testing.assert_allclose(found[20:], seen.states[:-20, :2] @ step[0], rtol=1e-8, atol=1e-12)


def test_no_horizon_is_one_sample_ahead():
    model, data = oscillator(), record(samples=600)
    found = predicted(model, data, 0.0)
    assert np.flatnonzero(np.isnan(found)).tolist() == [0]
    np.testing.assert_array_equal(found[1:], predicted(model, data, 1 / RATE)[1:])


def test_what_has_no_state_is_predicted_from_its_inputs_at_once():
    found = predicted(rig(), of_rig(), 0.1)
    np.testing.assert_allclose(found, of_rig()["f"], rtol=1e-9, atol=1e-9)


def test_predictions_get_worse_with_the_horizon():
    data = record(samples=2000, noise=0.01)
    wrong = oscillator(stiffness=300.0)
    near, far = (compare(wrong, data, horizon=h) for h in (0.0, 0.1))
    assert near.method == "prediction"
    assert near.nrmse < 0.1 < far.nrmse
    assert np.isnan(far.simulated["x"][:50]).all()
    assert np.isfinite(far.simulated["x"][51:]).all()


def test_the_horizon_ends_before_the_record():
    with pytest.raises(InvalidInputError, match="600 samples"):
        predicted(oscillator(), record(samples=600), 600 / RATE)
