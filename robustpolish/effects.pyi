from .machines.effects.effect import (
    Effect as Effect,
)
from .machines.effects.effect import (
    energy_per_cycle as energy_per_cycle,
)
from .machines.effects.effect import (
    equivalent_damping as equivalent_damping,
)
from .machines.effects.effect import (
    kinds as kinds,
)
from .machines.effects.effect import (
    lookup as lookup,
)
from .machines.effects.effect import (
    loss_damping as loss_damping,
)
from .machines.effects.effect import (
    register as register,
)
from .machines.effects.effect import (
    share_damping as share_damping,
)
from .machines.effects.effect import (
    unregister as unregister,
)
from .machines.effects.evaluate import (
    call_law as call_law,
)
from .machines.effects.evaluate import (
    compiled_law as compiled_law,
)
from .machines.effects.evaluate import (
    force_along as force_along,
)
from .machines.effects.evaluate import (
    force_with as force_with,
)
from .machines.effects.evaluate import (
    shapes_along as shapes_along,
)
from .machines.effects.formula_language import (
    OWN_KEYS as OWN_KEYS,
)
from .machines.effects.kind import (
    CONSTANT as CONSTANT,
)
from .machines.effects.kind import (
    GROUND as GROUND,
)
from .machines.effects.kind import (
    EffectKind as EffectKind,
)
from .machines.effects.kind import (
    Motion as Motion,
)
from .machines.effects.kind import (
    Parameter as Parameter,
)
from .machines.effects.kind import (
    Scan as Scan,
)
from .machines.effects.kind import (
    Shape as Shape,
)
from .machines.effects.kind import (
    SignalSlope as SignalSlope,
)
from .machines.effects.kind import (
    Timing as Timing,
)
from .machines.effects.learned_law import (
    Formula as Formula,
)
from .machines.effects.learned_law import (
    LearnedLaw as LearnedLaw,
)
from .machines.effects.user_defined import (
    own_kind as own_kind,
)
from .machines.effects.user_defined import (
    own_table as own_table,
)

__all__ = [
    "CONSTANT",
    "GROUND",
    "OWN_KEYS",
    "Effect",
    "EffectKind",
    "Formula",
    "LearnedLaw",
    "Motion",
    "Parameter",
    "Scan",
    "Shape",
    "SignalSlope",
    "Timing",
    "call_law",
    "compiled_law",
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
    "unregister",
]
