from .linearization import Linearization as Linearization
from .linearization import linearize as linearize
from .plant import GeneralizedPlant as GeneralizedPlant
from .uncertain.build import Ellipsoid as Ellipsoid
from .uncertain.build import append as append
from .uncertain.build import feedback as feedback
from .uncertain.build import lft as lft
from .uncertain.build import parallel as parallel
from .uncertain.build import series as series
from .uncertain.build import uncertain_complex as uncertain_complex
from .uncertain.build import uncertain_dynamics as uncertain_dynamics
from .uncertain.build import uncertain_ellipsoid as uncertain_ellipsoid
from .uncertain.build import uncertain_real as uncertain_real
from .uncertain.build import uncertain_system as uncertain_system
from .uncertain.cover import Cover as Cover
from .uncertain.cover import cover as cover
from .uncertain.system import UncertainSystem as UncertainSystem
from .weights import mixed_sensitivity as mixed_sensitivity
from .weights import weight as weight

__all__ = [
    "Cover",
    "Ellipsoid",
    "GeneralizedPlant",
    "Linearization",
    "UncertainSystem",
    "append",
    "cover",
    "feedback",
    "lft",
    "linearize",
    "mixed_sensitivity",
    "parallel",
    "series",
    "uncertain_complex",
    "uncertain_dynamics",
    "uncertain_ellipsoid",
    "uncertain_real",
    "uncertain_system",
    "weight",
]
