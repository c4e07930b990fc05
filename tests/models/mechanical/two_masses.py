"""A small machine for tests, changed part by part."""

from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring

GROUND = ("x", "ground")


def two_masses(**changes):
    """Return a bearing on a spring and a tool on the bearing, with other parts where named."""
    parts = {
        "dofs": [Dof("x_m", 0.6), Dof("x", 0.2)],
        "springs": [Spring(("x_m", "ground"), 1e5), Spring(("x_m", "x"), 3e4)],
        "dampers": [Damper(("x_m", "ground"), 13.0), Damper(("x", "x_m"), 2.0)],
        "inputs": [Input("F", ("x", "ground"), gain=-1.0)],
        "outputs": [Output("x", ("x", "ground"))],
    }
    return MechanicalModel(**{**parts, **changes})
