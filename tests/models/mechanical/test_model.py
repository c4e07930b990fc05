"""Mechanical models as users make them."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.machines.effects.effect import lookup
from robustpolish.machines.effects.user_defined import own_kind
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output


def test_a_model_without_springs_integrates():
    model = MechanicalModel(
        [Dof("q", 95.0)],
        dampers=[Damper(("q", "ground"), 203.5)],
        inputs=[Input("V", ("q", "ground"), gain=35.15, unit="V")],
        outputs=[Output("q", ("q", "ground"))],
    )
    assert 0 in np.linalg.eigvals(model.state_space().A)
    assert model.unit_of(model.inputs[0]) == "V"


def test_an_effect_may_be_given_by_its_kind():
    base = MechanicalModel([Dof("x", 2.0)], outputs=[Output("x", ("x", "ground"))])
    named = base.with_effect("cubic_stiffness", "x", {"stiffness": 3.0})
    assert base.with_effect(lookup("cubic_stiffness"), "x", {"stiffness": 3.0}) == named
    assert named.effects[0].own is None


def test_a_channel_is_added_once():
    kind = own_kind({"formula": "f = -c*u*v", "units": {"c": "N s/(m V)"}, "channels": {"u": "V"}})
    base = MechanicalModel([Dof("x", 2.0)], outputs=[Output("x", ("x", "ground"))])
    twice = base.with_effect(kind, "x", {"c": 1.0}).with_effect(kind, "x", {"c": 2.0})
    assert twice.dof_names == ("x", "u")
    assert twice.input_names == ("u",)
    assert twice.unit_of(twice.inputs[0]) == "V"
    assert base.with_channel("u", "V").without_effects() == twice.without_effects()
    with pytest.raises(InvalidInputError, match="Rename"):
        twice.with_channel("u", "V")
