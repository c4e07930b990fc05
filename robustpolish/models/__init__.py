"""Machines and plants: parameters, air bearing, generalised plant, linearisation."""

from robustpolish.models.cover.cover import Cover, cover
from robustpolish.models.linearization import Linearization, linearize
from robustpolish.models.machines.air_bearing import air_bearing
from robustpolish.models.machines.air_bearing_parameters import (
    AirBearingParameters,
    DampingCoefficients,
)
from robustpolish.models.machines.polishing_hardware import PolishingHardware
from robustpolish.models.machines.polishing_plant import polishing_plant
from robustpolish.models.mechanical.model import MechanicalModel
from robustpolish.models.mechanical.parts import CoupledInertia, Damper, Dof, Input, Output, Spring
from robustpolish.models.plant.plant import GeneralizedPlant
from robustpolish.models.uncertain.connections import (
    append,
    feedback,
    lft,
    parallel,
    series,
    uncertain_system,
)
from robustpolish.models.uncertain.ellipsoid import Ellipsoid, uncertain_ellipsoid
from robustpolish.models.uncertain.parameters import (
    uncertain_complex,
    uncertain_dynamics,
    uncertain_real,
)
from robustpolish.models.uncertain.system import UncertainSystem
from robustpolish.models.weights.mixed_sensitivity import mixed_sensitivity
from robustpolish.models.weights.weight import weight

__all__ = [
    "AirBearingParameters",
    "CoupledInertia",
    "Cover",
    "Damper",
    "DampingCoefficients",
    "Dof",
    "Ellipsoid",
    "GeneralizedPlant",
    "Input",
    "Linearization",
    "MechanicalModel",
    "Output",
    "PolishingHardware",
    "Spring",
    "UncertainSystem",
    "air_bearing",
    "append",
    "cover",
    "feedback",
    "lft",
    "linearize",
    "mixed_sensitivity",
    "parallel",
    "polishing_plant",
    "series",
    "uncertain_complex",
    "uncertain_dynamics",
    "uncertain_ellipsoid",
    "uncertain_real",
    "uncertain_system",
    "weight",
]
