from .machines.rotor.assembly import (
    RotorBearing as RotorBearing,
)
from .machines.rotor.assembly import (
    RotorDisc as RotorDisc,
)
from .machines.rotor.assembly import (
    ShaftSegment as ShaftSegment,
)
from .machines.rotor.modes import (
    Campbell as Campbell,
)
from .machines.rotor.modes import (
    RotorModes as RotorModes,
)
from .machines.rotor.modes import (
    WhirlMode as WhirlMode,
)
from .machines.rotor.rotor import (
    ReducedRotor as ReducedRotor,
)
from .machines.rotor.rotor import (
    ReductionError as ReductionError,
)
from .machines.rotor.rotor import (
    RotorModel as RotorModel,
)

__all__ = [
    "Campbell",
    "ReducedRotor",
    "ReductionError",
    "RotorBearing",
    "RotorDisc",
    "RotorModel",
    "RotorModes",
    "ShaftSegment",
    "WhirlMode",
]
