"""Linear systems with named signals, and in files."""

import json

import control
import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.models.plant.systems import named_system, system_content, system_from
from robustpolish.saved_file import Fields, plain


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
