"""Plants that are known by their frequency response only."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.plants.blocks import finite, interpolate_response, rearranged

OMEGA = 2 * np.pi * np.linspace(1.0, 5.0, 9)


def response():
    values = np.arange(2 * 3 * OMEGA.size).reshape(2, 3, OMEGA.size) * (1 + 0.5j)
    return control.frd(values, OMEGA, inputs=["F", "d", "e"], outputs=["x", "z"])


def test_signals_are_sorted_by_name_as_of_any_plant():
    plant = rp.GeneralizedPlant(response(), measurements="x", controls="F", units={"x": "m"})
    assert (plant.nw, plant.nu, plant.nz, plant.ny) == (2, 1, 1, 1)
    assert plant.disturbance_names == ("d", "e")
    found = plant.frequency_response([1.0, 3.0, 5.0])
    np.testing.assert_allclose(
        found.sel(output="x", input="F").values, np.asarray(response().frdata)[0, 0, [0, 4, 8]]
    )
    assert "a frequency response" in str(plant)
    assert "states" not in str(plant)


def test_between_the_lines_it_is_straight_and_beyond_them_unknown():
    values = interpolate_response(response(), 2 * np.pi * np.array([1.25]))
    expected = np.asarray(response().frdata)[..., :2].mean(axis=-1)
    np.testing.assert_allclose(values[0], expected)
    plant = rp.GeneralizedPlant(response(), 1, 1)
    with pytest.raises(rp.InvalidInputError, match=r"frequency: got 0.5 to 0.5 Hz, .* 1 to 5 Hz"):
        plant.frequency_response([0.5])


def test_signals_in_another_order():
    turned = rearranged(response(), [1, 0], [2, 0, 1])
    assert (turned.output_labels, turned.input_labels) == (["z", "x"], ["e", "F", "d"])
    np.testing.assert_array_equal(turned.frdata[0, 0], response().frdata[1, 2])


@pytest.mark.parametrize(
    "call",
    [
        lambda p: p.nx,
        lambda p: p.A,
        lambda p: p.D22,
        lambda p: p.closed_loop([[1.0]]),
        lambda p: p.with_actuator("F", 5.0),
        lambda p: p.save("never.json"),
        lambda p: p.part(disturbances=[0]),
        lambda p: rp.output_feedback(p),
        lambda p: rp.mixed_sensitivity(p, 1.0),
        lambda p: rp.loop_shaping(p),
        lambda p: rp.certify(p, [[1.0]]),
    ],
)
def test_what_needs_states_refuses_it(call):
    plant = rp.GeneralizedPlant(response(), "x", "F")
    with pytest.raises(rp.InvalidInputError, match="plant: got a frequency response, which has no"):
        call(plant)


def test_values_that_are_not_finite_are_refused():
    values = np.ones((1, 1, OMEGA.size), complex)
    values[0, 0, 3] = np.nan
    with pytest.raises(rp.InvalidInputError, match="system: got a response with values"):
        finite("system", control.frd(values, OMEGA))
