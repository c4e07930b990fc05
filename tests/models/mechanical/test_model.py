"""Mechanical models as users make them."""

import numpy as np

from robustpolish.models import (
    Damper,
    Dof,
    Input,
    MechanicalModel,
    Output,
)


def test_a_model_without_springs_integrates():
    model = MechanicalModel(
        [Dof("q", 95.0)],
        dampers=[Damper(("q", "ground"), 203.5)],
        inputs=[Input("V", ("q", "ground"), gain=35.15, unit="V")],
        outputs=[Output("q", ("q", "ground"))],
    )
    assert 0 in np.linalg.eigvals(model.state_space().A)
    assert model.unit_of(model.inputs[0]) == "V"
