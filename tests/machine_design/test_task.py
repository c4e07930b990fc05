"""Tasks: the plant as it is wired, weights, and what cannot be asked for."""

import numpy as np
import pytest

import robustpolish as rp
from tests.machine_design.machines import SPINDLE

MODEL = rp.MechanicalModel.from_toml(SPINDLE)


def test_a_machine_is_wired_as_by_hand():
    task = rp.results.DesignTask(
        MODEL,
        controls=["F"],
        measurements="x",
        actuators={"F": {"bandwidth_hz": 500.0, "limit": 100.0}},
        sensors={"x": {"bandwidth_hz": 2e3, "noise": 1e-9}},
        delays={"F": 1e-4},
    )
    plant = MODEL.linearize(["F"])
    by_hand = plant.part(measurements=[0]).with_actuator("F", 500.0, limit=100.0)
    by_hand = by_hand.with_sensor("measured_x", 2e3, noise=1e-9).with_delay("F", 1e-4)
    np.testing.assert_allclose(task.plant.system.A, by_hand.system.A)
    np.testing.assert_allclose(task.plant.system.D, by_hand.system.D)
    assert dict(task.plant.limits) == {"F": 100.0}
    assert any("Pade" in note for note in task.notes)
    assert "3 states" not in repr(task)


def test_weights_of_mixed_sensitivity_and_of_channels():
    low = {"low": 10.0, "crossover_hz": 5.0, "high": 0.1}
    weights = {"performance": {"x": low}, "effort": 1e-5, "robustness": [None, 0.5]}
    task = rp.results.DesignTask(MODEL, controls=["F"], weights=weights)
    names = task.weighted.performance_names
    assert names == ("performance_measured_x", "effort_F", "robustness_measured_acc")
    own = {"channels": {"F_cut": 3.0, "spindle": low}}
    channels = rp.results.DesignTask(MODEL, controls=["F"], weights=own)
    np.testing.assert_allclose(channels.weighted.B1, 3 * channels.plant.B1[[*range(4), 0]] * [
        [1], [1], [1], [1], [0]])  # fmt: skip
    assert channels.weighted.nx == channels.plant.nx + 1


def test_which_controller_is_meant():
    kinds = {
        "output feedback": {"measurements": ["x"]},
        "state feedback": {"measurements": ["slide", "dslide", "spindle", "dspindle"]},
        "order 2": {"order": 2},
    }
    for kind, extra in kinds.items():
        assert rp.results.DesignTask(MODEL, controls=["F"], **extra).kind == kind
    whole = rp.results.DesignTask(MODEL, controls=["F"], full_state=True)
    assert (whole.kind, whole.plant.ny) == ("state feedback", 4)
    heard = rp.results.DesignTask(
        MODEL, controls=["F"], measurement_noise=1e-6, **kinds["state feedback"]
    )
    assert heard.kind == "output feedback"


def test_prices_by_name_and_effects_that_are_linearised():
    model = MODEL.with_effect("cubic_stiffness", ("slide", "ground"), {"stiffness": 1e9})
    task = rp.results.DesignTask(model, controls=["F", "slide"], control_weight={"slide": 2.0})
    assert task.prices is not None
    np.testing.assert_array_equal(task.prices, [0.0, 2.0])
    assert "linearised about the state of rest: cubic_stiffness" in task.notes[0]
    both = rp.read_design_task(task, control_weight=3.0)
    assert both.prices is not None
    np.testing.assert_array_equal(both.prices, [3.0, 3.0])


@pytest.mark.parametrize(
    ("extra", "says"),
    [
        ({"norm": "h3"}, "norm"),
        ({"method": "best"}, "method"),
        ({"order": -1}, "order"),
        ({"order": 2, "method": "lmi"}, "besides an order"),
        ({"full_state": True, "measurements": ["x"]}, "besides full_state"),
        ({"full_state": True, "order": 2}, "besides full_state"),
        ({"full_state": True, "method": "slycot"}, "slycot"),
        ({"full_state": True, "weights": {"effort": 1.0}}, "mixed sensitivity"),
        ({"full_state": True, "delays": {"F": 1e-4}}, "infinitely many states"),
        ({"actuators": {"G": {"bandwidth_hz": 1}}}, "actuators: got 'G'"),
        ({"actuators": {"F": {"bandwidth": 1}}}, r"actuators\.F\.bandwidth.*bandwidth_hz"),
        ({"actuators": {"F": {"bandwidth_hz": -1}}}, r"actuators\.F\.bandwidth_hz"),
        ({"sensors": {"x": {"limit": 1}}}, r"sensors\.x\.limit"),
        ({"sensors": {"x": 1}}, "a table"),
        ({"delays": {"Fx": 1e-3}}, "delays: got 'Fx'"),
        ({"delays": {"F": -1}}, r"delays\.F"),
        ({"weights": {"preformance": 1.0}}, "preformance.*Write performance"),
        ({"weights": {"effort": 1.0, "channels": {}}}, "of mixed sensitivity, or of channels"),
        ({"weights": {"channels": {"F_cat": 1.0}}}, "weights.channels.*F_cut"),
        ({"weights": {"effort": {"G": 2.0}}}, r"weights\.effort"),
        ({"control_weight": {"G": 1.0}}, "control_weight"),
        ({"control_weight": -1.0}, "control_weight"),
        ({"computation_delay": 1e-4}, "without a sampling rate"),
        ({"sample_rate_hz": 0}, "sample_rate_hz"),
        ({"full_state": "yes"}, "true or false"),
        ({"controls": 3}, "names of signals"),
    ],
)
def test_what_cannot_be_asked_for(extra, says):
    with pytest.raises(rp.InvalidInputError, match=says):
        rp.results.DesignTask(MODEL, **{"controls": ["F"], **extra})


def test_no_machine():
    with pytest.raises(rp.InvalidInputError, match="MechanicalModel or a GeneralizedPlant"):
        rp.results.DesignTask("machine")  # type: ignore[arg-type]
    with pytest.raises(rp.InvalidInputError, match="Write controls"):
        rp.read_design_task(rp.results.DesignTask(MODEL, controls=["F"]), control=["F"])
