"""Machines and plants: parameters, air bearing, generalised plant, linearisation."""

from robustpolish.models.air_bearing import air_bearing
from robustpolish.models.air_bearing_parameters import AirBearingParameters, DampingCoefficients
from robustpolish.models.generalized_plant import GeneralizedPlant
from robustpolish.models.linearization import Linearization, linearize

__all__ = [
    "AirBearingParameters",
    "DampingCoefficients",
    "GeneralizedPlant",
    "Linearization",
    "air_bearing",
    "linearize",
]
