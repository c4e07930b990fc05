from .effects.effect import (
    Effect as Effect,
)
from .effects.effect import (
    energy_per_cycle as energy_per_cycle,
)
from .effects.effect import (
    equivalent_damping as equivalent_damping,
)
from .effects.effect import (
    kinds as kinds,
)
from .effects.effect import (
    lookup as lookup,
)
from .effects.effect import (
    loss_damping as loss_damping,
)
from .effects.effect import (
    register as register,
)
from .effects.effect import (
    share_damping as share_damping,
)
from .effects.effect import (
    unregister as unregister,
)
from .effects.evaluate import (
    call_law as call_law,
)
from .effects.evaluate import (
    compiled_law as compiled_law,
)
from .effects.evaluate import (
    force_along as force_along,
)
from .effects.evaluate import (
    force_with as force_with,
)
from .effects.evaluate import (
    shapes_along as shapes_along,
)
from .effects.formula_language import (
    OWN_KEYS as OWN_KEYS,
)
from .effects.kind import (
    CONSTANT as CONSTANT,
)
from .effects.kind import (
    GROUND as GROUND,
)
from .effects.kind import (
    EffectKind as EffectKind,
)
from .effects.kind import (
    Motion as Motion,
)
from .effects.kind import (
    Parameter as Parameter,
)
from .effects.kind import (
    Scan as Scan,
)
from .effects.kind import (
    Shape as Shape,
)
from .effects.kind import (
    SignalSlope as SignalSlope,
)
from .effects.kind import (
    Timing as Timing,
)
from .effects.learned_law import (
    Formula as Formula,
)
from .effects.learned_law import (
    LearnedLaw as LearnedLaw,
)
from .effects.user_defined import (
    effect as effect,
)
from .effects.user_defined import (
    own_kind as own_kind,
)
from .effects.user_defined import (
    own_table as own_table,
)
from .mechanical.equations import (
    Equations as Equations,
)
from .mechanical.model import (
    MechanicalModel as MechanicalModel,
)
from .mechanical.parts import (
    CoupledInertia as CoupledInertia,
)
from .mechanical.parts import (
    Damper as Damper,
)
from .mechanical.parts import (
    Dof as Dof,
)
from .mechanical.parts import (
    Input as Input,
)
from .mechanical.parts import (
    Output as Output,
)
from .mechanical.parts import (
    Ratio as Ratio,
)
from .mechanical.parts import (
    Spring as Spring,
)
from .rotor.assembly import (
    RotorBearing as RotorBearing,
)
from .rotor.assembly import (
    RotorDisc as RotorDisc,
)
from .rotor.assembly import (
    ShaftSegment as ShaftSegment,
)
from .rotor.modes import (
    Campbell as Campbell,
)
from .rotor.modes import (
    RotorModes as RotorModes,
)
from .rotor.modes import (
    WhirlMode as WhirlMode,
)
from .rotor.rotor import (
    ReducedRotor as ReducedRotor,
)
from .rotor.rotor import (
    ReductionError as ReductionError,
)
from .rotor.rotor import (
    RotorModel as RotorModel,
)
from .simulation import (
    NonlinearResponse as NonlinearResponse,
)
from .simulation import (
    simulate_model as simulate_model,
)

__all__ = [
    "CONSTANT",
    "GROUND",
    "OWN_KEYS",
    "Campbell",
    "CoupledInertia",
    "Damper",
    "Dof",
    "Effect",
    "EffectKind",
    "Equations",
    "Formula",
    "Input",
    "LearnedLaw",
    "MechanicalModel",
    "Motion",
    "NonlinearResponse",
    "Output",
    "Parameter",
    "Ratio",
    "ReducedRotor",
    "ReductionError",
    "RotorBearing",
    "RotorDisc",
    "RotorModel",
    "RotorModes",
    "Scan",
    "ShaftSegment",
    "Shape",
    "SignalSlope",
    "Spring",
    "Timing",
    "WhirlMode",
    "call_law",
    "compiled_law",
    "effect",
    "energy_per_cycle",
    "equivalent_damping",
    "force_along",
    "force_with",
    "kinds",
    "lookup",
    "loss_damping",
    "own_kind",
    "own_table",
    "register",
    "shapes_along",
    "share_damping",
    "simulate_model",
    "unregister",
]
