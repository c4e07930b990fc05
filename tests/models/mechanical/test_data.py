"""The data of a model: copied, sent, changed."""

import copy
import pickle
from dataclasses import replace

import numpy as np

from robustpolish.models import (
    Dof,
    Input,
    MechanicalModel,
    Output,
    Spring,
)
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
