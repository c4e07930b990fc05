"""The generalised plant: its parts, its changes and its complaints."""

import copy

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from tests.models.plant.random_plants import random_plant


def test_state_feedback_loop_ignores_what_is_measured():
    plant = random_plant(np.random.default_rng(2))
    gain = np.random.default_rng(3).standard_normal((3, 4))
    loop = plant.state_feedback_loop(gain)
    np.testing.assert_allclose(loop.A, plant.A + plant.B2 @ gain)
    np.testing.assert_allclose(loop.C, plant.C1 + plant.D12 @ gain)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"measurements": 5}, "measurements: got 5, expected a whole number from 0 to 4"),
        ({"controls": -1}, "controls: got -1"),
        ({"controls": 1.5}, "controls: got 1.5"),
        ({"units": {"nothing": "m"}}, "units: got 'nothing'"),
        ({"system": "1/(s + 1)"}, "system: got str"),
    ],
)
def test_bad_plants_are_named(change, message):
    plant = random_plant(np.random.default_rng(5))
    arguments = {"system": plant.system, "measurements": 2, "controls": 3} | change
    with pytest.raises(InvalidInputError) as caught:
        rp.GeneralizedPlant(**arguments)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"A": [[1, 2, 3], [4, 5, 6]]}, r"A: got shape \(2, 3\)"),
        ({"B1": [[1.0]]}, r"B1: got shape \(1, 1\)"),
        ({"C2": [[1, np.nan]]}, "C2: got nan at row 0, column 1"),
        ({"B2": [["a"], ["b"]]}, "B2: got"),
        ({"A": np.eye(2) * 1j}, "A: got complex entries"),
        ({"states": ["x", "x"]}, "states: got"),
        ({"states": "xy"}, "states: got 'xy'"),
    ],
)
def test_bad_matrices_are_named(change, message):
    good = {
        "A": -np.eye(2),
        "B1": [[1], [0]],
        "B2": [[0], [1]],
        "C1": [[1, 0]],
        "C2": [[0, 1]],
    }
    with pytest.raises(InvalidInputError, match=message):
        rp.GeneralizedPlant.from_matrices(**(good | change))


def named_plant():
    return random_plant(np.random.default_rng(5)).replace(
        states=["a", "b", "c", "d"],
        disturbances=["F", "G"],
        units={"a": "m", "F": "N", "z1": "m", "y2": "V"},
    )


def test_replaced_names_keep_every_matrix_and_unit():
    plant = named_plant()
    assert plant.system.input_labels == ["F", "G", "u1", "u2", "u3"]
    again = plant.replace(measurements=["one", "y2"], units={"one": "V", "F": "kN"})
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(again.system, name), getattr(plant.system, name))
    assert again.measurement_names == ("one", "y2")
    assert dict(again.units) == {"a": "m", "F": "kN", "z1": "m", "y2": "V", "one": "V"}
    assert (again.states, again.disturbance_names) == (plant.states, ("F", "G"))


def test_replaced_matrices_keep_all_others():
    plant = named_plant()
    wider = np.hstack([plant.B1, plant.B1[:, :1]])
    again = plant.replace(
        B1=wider,
        D11=np.zeros((2, 3)),
        D21=np.zeros((2, 3)),
        disturbances=["F", "G", "H"],
    )
    np.testing.assert_array_equal(again.B1, wider)
    for name in ("A", "B2", "C1", "C2", "D12", "D22"):
        np.testing.assert_array_equal(getattr(again, name), getattr(plant, name))
    assert dict(again.units) == dict(plant.units)
    assert plant.replace(C1=plant.C1 * 2, D11=plant.D11 * 2).performance_names == ("z1", "z2")
    assert plant.replace(dt=0.1).dt == 0.1
    assert plant.replace(dt=0.1).replace(A=np.eye(4)).dt == 0.1


def test_a_feedthrough_of_zeros_takes_the_new_size():
    plant = rp.air_bearing()
    again = plant.replace(B1=plant.B1[:, :1], disturbances=["F_x"])
    assert again.D11.shape == (6, 1)
    assert again.D21.shape == (12, 1)
    assert again.units["F_x"] == "N"
    assert "F_y" not in again.units


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"B1": np.zeros((4, 3))}, "D11"),
        ({"A": np.zeros((3, 3))}, "B1"),
        ({"C1": np.zeros((3, 4)), "D11": np.zeros((3, 2)), "D12": np.zeros((3, 3))}, "performance"),
        ({"disturbances": ["F"]}, "disturbances"),
        ({"units": {"nobody": "m"}}, "nobody"),
    ],
)
def test_bad_replacements_are_named(change, message):
    with pytest.raises(InvalidInputError, match=message):
        named_plant().replace(**change)


def test_an_unknown_argument_is_not_swallowed():
    with pytest.raises(TypeError, match="disturbance_names"):
        named_plant().replace(disturbance_names=["F"])


def test_a_part_has_the_rows_and_columns_of_the_whole():
    plant = named_plant()
    part = plant.part(disturbances=[1], performance=[1, 0], measurements=[], controls=[2, 0])
    assert part.system.input_labels == ["G", "u3", "u1"]
    assert part.system.output_labels == ["z2", "z1"]
    np.testing.assert_array_equal(part.D12, plant.D12[[1, 0]][:, [2, 0]])
    np.testing.assert_array_equal(part.B1, plant.B1[:, [1]])
    assert dict(part.units) == {"a": "m", "z1": "m"}
    alone = plant.part(states=[], disturbances=[0])
    assert (alone.nx, alone.nw, alone.ny) == (0, 1, 2)
    np.testing.assert_array_equal(alone.D11, plant.D11[:, [0]])


def test_states_without_inputs_are_kept():
    plant = random_plant(np.random.default_rng(6))
    closed = plant.part(disturbances=[], controls=[], performance=[], measurements=[])
    assert closed.nx == 4


def test_plants_are_copied():
    plant = rp.air_bearing()
    again = copy.copy(plant)
    np.testing.assert_array_equal(again.A, plant.A)
    assert again.units == plant.units
