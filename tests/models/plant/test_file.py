"""Plants and systems with names in files."""

import json

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.base.saved import Fields, plain
from robustpolish.errors import InvalidInputError
from robustpolish.plants.blocks import named_system
from robustpolish.plants.plant import plant_content, plant_from, system_content, system_from


def read(plant, **changes):
    content = json.loads(json.dumps(plain(plant_content(plant)))) | changes
    return plant_from(Fields(content, "a.json"))


def test_a_plant_comes_back():
    plant = rp.air_bearing()
    again = read(plant)
    for name in ("A", "B1", "B2", "C1", "C2"):
        np.testing.assert_array_equal(getattr(again, name), getattr(plant, name))
    assert dict(again.units) == dict(plant.units)
    assert again.control_names == plant.control_names
    assert again.measurement_names == plant.measurement_names


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"controls": 1.5}, "controls: got 1.5, expected a whole number"),
        ({"controls": 99}, "controls: got 99"),
        ({"units": {"x": 3}}, "units: x: got 3, expected a text"),
        ({"system": []}, "system: got"),
    ],
)
def test_a_damaged_plant_is_refused(change, told):
    with pytest.raises(InvalidInputError, match=told):
        read(rp.air_bearing(), **change)


def there_and_back(system, **changes):
    content = json.loads(json.dumps(plain(system_content(system)))) | changes
    return system_from(Fields(content, "a.json"))


def test_states_without_effect_are_kept():
    system = named_system(([[0.0]], [[0.0]], [[0.0]], [[2.0]]), 0, ["u"], ["y"], ["lost"])
    assert (system.nstates, system.state_labels) == (1, ["lost"])


@pytest.mark.parametrize("dt", [0, 0.1, True])
def test_every_entry_and_name_comes_back(dt):
    rng = np.random.default_rng(0)
    matrices = [rng.standard_normal(shape) for shape in ((3, 3), (3, 2), (1, 3), (1, 2))]
    system = named_system(matrices, dt, ["F", "G"], ["x"], ["a", "b", "c"])
    again = there_and_back(system)
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(again, name), getattr(system, name))
    assert again.dt == dt
    assert again.state_labels == ["a", "b", "c"]
    assert (again.input_labels, again.output_labels) == (["F", "G"], ["x"])


def test_a_gain_without_states_comes_back():
    again = there_and_back(named_system(([], [], [], [[1.0, 2.0]]), 0, ["a", "b"], ["y"]))
    assert again.nstates == 0
    np.testing.assert_array_equal(again.D, [[1.0, 2.0]])


def test_an_unspecified_sampling_time_is_continuous():
    assert system_content(control.StateSpace(-1, 1, 1, 0, None))["dt"] == 0


def test_shapes_that_do_not_fit_the_names_are_named():
    system = named_system((-1, 1, 1, 0), 0, ["u"], ["y"], ["x"])
    with pytest.raises(InvalidInputError, match=r"A: got shape \(1, 1\)"):
        there_and_back(system, states=["x", "v"])
