import numpy as np
import pytest
import xarray as xr

from robustpolish.identification.observer.run import (
    StartedPiece,
    fitted_start,
    free_run,
    lengths,
    rest,
)
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


def case(effect=None, start=(2e-3, 0.1)):
    model = MechanicalModel(
        [Dof("x", 1.0)],
        [Spring(PLACE, 400.0)],
        [Damper(PLACE, 0.8)],
        [Input("F", PLACE)],
        [Output("x", PLACE)],
    )
    if effect:
        model = model.with_effect(*effect)
    time = np.arange(1200) * 5e-3
    force = np.random.default_rng(0).standard_normal(time.size)
    data = xr.Dataset({"F": ("time", force)}, {"time": time})
    data["x"] = ("time", 2e-3 * np.ones(time.size))  # decides on the steps, as below
    x = simulate(model, data, initial_state=start).outputs[:, 0]
    return model, record_of(model, data.assign(x=("time", x)))


@pytest.mark.parametrize("effect", [None, ("cubic_stiffness", PLACE, {"stiffness": 1e7})])
def test_the_start_is_found_from_rest(effect):
    model, record = case(effect)
    run = free_run(model, record)
    found = fitted_start(run, record, [rest(model)], np.array([1e-3, 0.02]))
    np.testing.assert_allclose(found.state, [2e-3, 0.1], rtol=1e-3)
    assert np.max(np.abs(run.errors(StartedPiece(record, found)))) < 1e-6


def test_the_best_guess_is_where_the_search_begins():
    model, record = case(("coulomb_friction", PLACE, {"force": 0.2}))
    run = free_run(model, record)
    right, wrong = rest(model).with_vector(np.array([2e-3, 0.1])), rest(model)
    sizes = np.array([1e-3, 0.02])
    for guesses in ([wrong, right], [right, wrong]):
        found = fitted_start(run, record, guesses, sizes)
        np.testing.assert_allclose(found.state, [2e-3, 0.1], rtol=1e-2)


def test_stretches_grow_twofold_up_to_the_whole():
    assert lengths(30) == [30]
    assert lengths(8000) == [62, 125, 250, 500, 1000, 2000, 4000, 8000]
