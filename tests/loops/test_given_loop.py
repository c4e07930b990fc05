"""Everything that users call a plant and a controller, and what is none."""

from typing import Any

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.loops.loop import Loop, loop_of, measured_plant
from tests.loops.loops_for_tests import SATELLITE, TEXTBOOK, s


def test_everything_that_is_a_plant_and_a_controller():
    design = rp.given_controller(
        rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]]), [[-3.0]]
    )
    for plant, controller in [
        (design, None),
        (design.plant, design.controller),
        (design.plant, design),
        (control.ss([[1.0]], [[1.0]], [[1.0]], 0), -3),
        (control.tf([1], [1, -1]), control.tf([-3], [1])),
        (control.tf([1], [1, -1]), [[-3.0]]),
        (control.ss([[1.0]], [[1.0]], [[1.0]], 0, None), np.array(-3.0)),
    ]:
        loop = loop_of(plant, controller)
        assert isinstance(loop, Loop)
        np.testing.assert_allclose(loop.rates, [-2.0])


@pytest.mark.parametrize(
    ("plant", "controller", "message"),
    [
        (TEXTBOOK, None, "controller: got None"),
        (3.0, -1, "plant: got float"),
        (TEXTBOOK, control.frd(TEXTBOOK, np.logspace(-1, 1, 9)), "FrequencyResponseData"),
        (s, -1, "improper"),
        (TEXTBOOK, -s, "improper"),
        (TEXTBOOK, [[1.0, 2.0]], r"shape \(1, 2\)"),
        (TEXTBOOK, np.nan, "finite"),
        (TEXTBOOK, "K", "real matrix"),
        (SATELLITE, -1, r"\(2, 2\)"),
        (SATELLITE, control.ss([[-1.0]], [[1.0]], [[1.0]], 0), "1 inputs and 1 outputs"),
        (TEXTBOOK, control.tf([1], [1, -0.5], 0.1), "discrete time with a step of 0.1 s"),
        (control.tf([1], [1, -0.5], 0.1), control.tf([1], [1, 1]), "continuous time"),
        (control.tf([1], [1, -0.5], 0.1), control.ss([[0.5]], [[1.0]], [[1.0]], 0, 0.2), "0.2 s"),
        (control.ss([], [], [], [[1.0]]), 1, "singular"),
        (rp.GeneralizedPlant(SATELLITE, measurements=0, controls=1), -1, "at least one"),
    ],
)
def test_bad_input_is_told(plant, controller, message):
    with pytest.raises(rp.InvalidInputError, match=message):
        loop_of(plant, controller)


def test_a_design_brings_its_controller_and_a_gain_of_states_is_known():
    plant = rp.GeneralizedPlant.from_matrices(
        [[0, 1.0], [-4, -0.4]], [[0], [1.0]], [[0], [1.0]], [[1.0, 0]], [[1.0, 0]]
    )
    design = rp.given_controller(plant, [[-1.0]])
    with pytest.raises(rp.InvalidInputError, match="design alone"):
        loop_of(design, -1)
    with pytest.raises(rp.InvalidInputError, match="with_full_state"):
        loop_of(plant, [[-1.0, -2.0]])


def test_a_measured_plant_is_told_from_a_model():
    response: Any = control.frd([1.0, 0.5 - 0.5j], [0.1, 1.0])
    whole = rp.GeneralizedPlant(response, measurements=1, controls=1)
    assert measured_plant(whole) is whole
    found = measured_plant(response)
    assert found is not None
    assert (found.nu, found.ny) == (1, 1)
    assert measured_plant(TEXTBOOK) is None
    with pytest.raises(rp.InvalidInputError, match="at least one"):
        measured_plant(rp.GeneralizedPlant(response, measurements=1, controls=0))
