"""The numbers of a model by key."""

import pytest

from robustpolish.errors import InvalidInputError
from tests.models.mechanical.two_masses import two_masses


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
