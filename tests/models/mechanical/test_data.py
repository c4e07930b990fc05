"""The data of a model: copied, sent, changed."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Dof, Input, Output, Spring
from tests.models.mechanical.two_masses import two_masses


def test_rotation_has_its_units():
    model = MechanicalModel(
        [Dof("phi", 0.01, rotational=True)],
        [Spring(("phi", "ground"), 3.0)],
        inputs=[Input("T", ("phi", "ground"))],
        outputs=[Output("phi", ("phi", "ground"), "angle")],
    )
    assert model.outputs[0].quantity == "displacement"
    assert [model.unit_of(i) for i in (*model.inputs, *model.outputs)] == ["N m", "rad"]


def test_models_travel_to_other_processes():
    model = two_masses().with_effect("coulomb_friction", ("x", "ground"), {"force": 3.0})
    model.state_space()
    again = pickle.loads(pickle.dumps(model))
    assert again == model
    assert "matrices" not in vars(again)  # made anew where they are needed
    np.testing.assert_array_equal(again.matrices.K, model.matrices.K)
    assert copy.deepcopy(model) == model
    assert isinstance(replace(model, name="other"), MechanicalModel)


def test_a_replaced_part_gives_new_matrices():
    model = two_masses()
    assert model.matrices.K[0, 0] == 1.3e5
    stiffer = replace(model, springs=[Spring(("x_m", "ground"), 2e5)])
    assert stiffer.springs == (Spring(("x_m", "ground"), 2e5),)
    assert stiffer.matrices.K[0, 0] == 2e5


def test_parameters_by_key_and_back():
    model = two_masses().with_effect("coulomb_friction", ("x", "ground"), {"force": 3.0})
    keys = model.parameters
    assert keys["dof.x.mass"] == 0.2
    assert keys["spring[1].stiffness"] == 3e4
    assert keys["effect[0].force"] == 3.0
    changed = model.with_parameters({"dof.x.mass": 0.3, "effect[0].force": 4.0})
    assert changed.parameters["dof.x.mass"] == 0.3
    assert changed.effects[0].parameters["force"] == 4.0
    assert model.parameters["dof.x.mass"] == 0.2
    with pytest.raises(InvalidInputError, match=r"dof\.y\.mass"):
        model.with_parameters({"dof.y.mass": 1.0})


def test_a_number_that_was_left_at_its_default_can_be_changed_too():
    model = two_masses().with_effect("coulomb_friction", ("x", "ground"), {"force": 3.0})
    changed = model.with_parameters({"effect[0].width": 0.1})
    assert changed.parameters["effect[0].width"] == 0.1
    assert changed.parameters["effect[0].force"] == 3.0


@pytest.mark.parametrize("bad", [True, "2", float("nan"), float("inf"), -1.0, 0.0, 1e200])
def test_a_mass_that_is_changed_is_checked(bad):
    with pytest.raises(InvalidInputError, match=r"dof\.x\.mass"):
        two_masses().with_parameters({"dof.x.mass": bad})


def test_the_matrices_are_those_of_the_changed_numbers():
    model = two_masses().with_effect("coulomb_friction", ("x", "ground"), {"force": 3.0})
    known = model.matrices
    stiffer = model.with_parameters({"spring[1].stiffness": 6e4})
    assert stiffer.matrices.K[1, 1] == 2 * known.K[1, 1]
    assert model.with_parameters({"effect[0].force": 4.0}).matrices is known
    with pytest.raises(ValueError, match="read-only"):
        known.inverse_mass[0, 0] = 1.0


def test_a_channel_is_a_signal_in_a_unit_of_its_own_that_nothing_holds():
    base = MechanicalModel(
        [Dof("x", 2.0), Dof("u", 0.0)],
        [Spring(("x", "ground"), 3.0)],
        inputs=[Input("u", ("u", "ground"), "displacement", unit="V")],
        outputs=[Output("x", ("x", "ground"))],
    )
    assert base.channels == ("u",)
    held = replace(base, springs=(Spring(("x", "u"), 3.0),))
    seen = replace(base, outputs=(Output("x", ("x", "u")),))
    table = replace(base, inputs=(Input("u", ("u", "ground"), "displacement"),))
    metres = replace(base, inputs=(Input("u", ("u", "ground"), "displacement", unit="m"),))
    sensor = replace(base, inputs=(Input("u", ("u", "ground"), "displacement", 2e-3, "V"),))
    assert [m.channels for m in (held, seen, table, metres, sensor)] == [()] * 5
