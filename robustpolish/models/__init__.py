"""Machines and plants: parameters, air bearing, generalised plant, linearisation."""

from robustpolish.models.air_bearing import air_bearing
from robustpolish.models.air_bearing_parameters import AirBearingParameters, DampingCoefficients
from robustpolish.models.generalized_plant import GeneralizedPlant
from robustpolish.models.linearization import Linearization, linearize
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical_parts import Damper, Dof, Input, Output, Spring

__all__ = [
    "AirBearingParameters",
    "Damper",
    "DampingCoefficients",
    "Dof",
    "GeneralizedPlant",
    "Input",
    "Linearization",
    "MechanicalModel",
    "Output",
    "Spring",
    "air_bearing",
    "linearize",
]
