import numpy as np
import xarray as xr

from robustpolish.identification.observer.run import StartedPiece, free_run, rest
from robustpolish.identification.record import record_of
from robustpolish.models import Damper, Dof, Input, MechanicalModel, Output, Spring
from robustpolish.simulation.run import simulate

PLACE = ("x", "ground")


def delayed(samples=400):
    model = MechanicalModel(
        [Dof("x", 1.0)],
        [Spring(PLACE, 400.0)],
        [Damper(PLACE, 0.8)],
        [Input("F", PLACE)],
        [Output("x", PLACE)],
    ).with_effect("input_delay", "F", {"delay": 0.05})
    time = np.arange(samples) * 5e-3
    force = np.sin(30 * time) + np.random.default_rng(1).standard_normal(samples)
    data = xr.Dataset({"F": ("time", force), "x": ("time", np.zeros(samples))}, {"time": time})
    return model, data


def test_a_run_over_a_record_is_a_simulation():
    model, data = delayed()
    record = record_of(model, data)
    outputs = free_run(model, record).over(StartedPiece(record, rest(model))).outputs
    np.testing.assert_array_equal(outputs, simulate(model, data).outputs)


def test_a_part_goes_on_where_the_one_before_ended():
    """Late inputs and their derivatives come from the whole record, not from the part."""
    model, data = delayed()
    record = record_of(model, data)
    run = free_run(model, record)
    whole = run.over(StartedPiece(record, rest(model)), keep=True)
    middle = rest(model).with_vector(whole.states[150])
    later = run.over(StartedPiece(record.part(150, 400), middle)).outputs
    np.testing.assert_allclose(later, whole.outputs[150:], rtol=1e-9, atol=1e-15)
