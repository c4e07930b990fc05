import numpy as np
import pytest
import xarray as xr

from robustpolish.identification.fit.prepared import prepare
from robustpolish.identification.observer.kalman import Level
from robustpolish.identification.observer.runs import StartedPiece, free_run, rest
from robustpolish.identification.policy import POLICY
from robustpolish.identification.record import record_of
from robustpolish.machines.simulation.run import simulate_model as simulate
from tests.identification.observer.runs import case
from tests.identification.oscillators import PLACE, oscillator


def delayed(samples=400):
    model = oscillator(damping=0.8).with_effect("input_delay", "F", {"delay": 0.05})
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
    errors = np.concatenate([run.errors(piece) for piece in pieces])
    np.testing.assert_array_equal(run.all_errors(pieces), errors)


def test_a_led_run_over_windows_is_led_in_each():
    model, record = case(("cubic_stiffness", PLACE, {"stiffness": 1e7}))
    prepared = prepare(model, record, POLICY)
    run = prepared.runner(model, Level(1.0)).run(model)
    pieces = [StartedPiece(record.part(*part), rest(model)) for part in ((0, 500), (500, 1200))]
    expected = np.concatenate([run.errors(piece) for piece in pieces])
    np.testing.assert_array_equal(run.all_errors(pieces), expected)
    free = free_run(model, record).all_errors(pieces)
    assert np.std(expected) < 0.5 * np.std(free)  # the wrong starts are mended
