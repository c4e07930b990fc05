import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.identification.free_runs import simulated_record
from robustpolish.identification.observer.runs import free_run
from robustpolish.identification.record import record_of
from tests.identification.oscillators import oscillator, record


def simulated(method, span=None, model=None, data=None):
    model = model or oscillator()
    held = record_of(model, record(1010, (0.02, -0.3)) if data is None else data)
    return simulated_record(free_run(model, held), held, method, span)


def test_a_free_run_begins_where_the_record_does():
    found = simulated("free run")
    np.testing.assert_allclose(found.starts, [[0.02, -0.3]], atol=2e-5)
    np.testing.assert_allclose(found.outputs, found.record.Y, atol=1e-5)
    assert (found.first, found.found.reproducible) == (0, True)


def test_windows_follow_each_other_without_a_rest():
    found = simulated("windows", 0.5)
    assert [p.record.samples for p in found.pieces] == [250, 250, 250, 260]
    assert found.starts.shape == (4, 2)


def test_predictions_begin_after_the_first_horizon():
    found = simulated("prediction", 0.1)
    assert found.first == 50
    assert np.isnan(found.outputs[:50]).all()
    assert np.isfinite(found.outputs[50:]).all()


@pytest.mark.parametrize("span", [1e-3, 10.0])
def test_windows_have_to_fit_the_record(span):
    with pytest.raises(InvalidInputError, match="window"):
        simulated("windows", span)
