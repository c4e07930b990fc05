"""Controls and measurements by name and by number."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.plants.blocks import chosen_names, sorted_signals

INS, OUTS = ["F", "d", "n", "V"], ["y", "z", "x"]


def system():
    rng = np.random.default_rng(1)
    matrices = [rng.standard_normal(shape) for shape in ((3, 3), (3, 4), (3, 3), (3, 4))]
    return control.ss(*matrices, inputs=INS, outputs=OUTS, states=["a", "b", "c"])


def test_named_signals_go_last_in_the_order_of_their_names():
    whole, ny, nu = sorted_signals(system(), ["x", "y"], ("V", "F"))
    assert (whole.output_labels, whole.input_labels) == (["z", "x", "y"], ["d", "n", "V", "F"])
    assert (ny, nu) == (2, 2)
    assert whole.state_labels == ["a", "b", "c"]
    point = 1.3j
    old, new = system()(point), whole(point)
    for i, output in enumerate(whole.output_labels):
        for j, given in enumerate(whole.input_labels):
            assert new[i, j] == pytest.approx(old[OUTS.index(output), INS.index(given)])


def test_names_that_stand_last_already_move_nothing():
    given = system()
    assert sorted_signals(given, "x", ["n", "V"])[0] is given
    assert sorted_signals(given, 1, 2) == (given, 1, 2)
    assert sorted_signals(given, np.int64(1), 0)[1:] == (1, 0)


def test_a_single_name_stands_for_itself_and_units_stay():
    plant = rp.GeneralizedPlant(system(), "y", "F", {"y": "m", "F": "N", "a": "m"})
    assert (plant.measurement_names, plant.control_names) == (("y",), ("F",))
    assert (plant.performance_names, plant.disturbance_names) == (("z", "x"), ("d", "n", "V"))
    assert plant.measurements == plant.controls == 1
    assert plant.units["y"] == "m"


def test_a_count_for_one_and_names_for_the_other():
    plant = rp.GeneralizedPlant(system(), measurements=1, controls=["d"])
    assert (plant.measurement_names, plant.control_names) == (("x",), ("d",))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"measurements": "w"}, "measurements: got 'w', expected names among .* y, z, x"),
        ({"measurements": ["y", "y"]}, "measurements: got y, y, with a name twice"),
        ({"controls": ["F", "y"]}, "controls: got 'y', expected names among .* F, d, n, V"),
        ({"controls": [0]}, "controls: got 0, expected names"),
        ({"controls": 5}, "controls: got 5, expected a whole number from 0 to 4"),
        ({"controls": True}, "controls: got True, expected a whole number"),
        ({"controls": None}, "controls: got None"),
        ({"measurements": 1.0}, "measurements: got 1.0"),
        ({"measurements": object}, "measurements: got <class 'object'>"),
    ],
)
def test_what_is_neither_is_refused(change, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        rp.GeneralizedPlant(system(), **({"measurements": "y", "controls": "F"} | change))


def test_names_out_of_any_sequence():
    assert chosen_names("name", np.array(["V", "F"]), INS, "inputs") == ["V", "F"]
    assert chosen_names("name", [], INS, "inputs") == []
