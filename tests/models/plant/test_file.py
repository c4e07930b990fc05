"""Plants as plain values."""

import json

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.models.plant.file import plant_arguments, plant_content
from robustpolish.saved_file import Fields, plain


def read(plant, **changes):
    content = json.loads(json.dumps(plain(plant_content(plant)))) | changes
    return rp.GeneralizedPlant(*plant_arguments(Fields(content, "a.json")))


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
