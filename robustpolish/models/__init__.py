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
from robustpolish.models.machines.rotating_beam import rotating_beam, spindle_rotor
from robustpolish.models.mechanical.model import MechanicalModel
from robustpolish.models.mechanical.parts import CoupledInertia, Damper, Dof, Input, Output, Spring
from robustpolish.models.plant.plant import GeneralizedPlant
from robustpolish.models.rotor.campbell import Campbell
from robustpolish.models.rotor.parts import RotorBearing, RotorDisc, ShaftSegment
from robustpolish.models.rotor.reduced import ReducedRotor, ReductionError
from robustpolish.models.rotor.rotor import RotorModel
from robustpolish.models.rotor.whirl import RotorModes, WhirlMode
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
    "Campbell",
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
    "ReducedRotor",
    "ReductionError",
    "RotorBearing",
    "RotorDisc",
    "RotorModel",
    "RotorModes",
    "ShaftSegment",
    "Spring",
    "UncertainSystem",
    "WhirlMode",
    "air_bearing",
    "append",
    "cover",
    "feedback",
    "lft",
    "linearize",
    "mixed_sensitivity",
    "parallel",
    "polishing_plant",
    "rotating_beam",
    "series",
    "spindle_rotor",
    "uncertain_complex",
    "uncertain_dynamics",
    "uncertain_ellipsoid",
    "uncertain_real",
    "uncertain_system",
    "weight",
]
