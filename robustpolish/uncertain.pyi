from .identification.fit.result import (
    effect_sector as effect_sector,
)
from .plants.uncertain.build import (
    Ellipsoid as Ellipsoid,
)
from .plants.uncertain.build import (
    append as append,
)
from .plants.uncertain.build import (
    feedback as feedback,
)
from .plants.uncertain.build import (
    lft as lft,
)
from .plants.uncertain.build import (
    parallel as parallel,
)
from .plants.uncertain.build import (
    series as series,
)
from .plants.uncertain.build import (
    uncertain_complex as complex,
)
from .plants.uncertain.build import (
    uncertain_dynamics as dynamics,
)
from .plants.uncertain.build import (
    uncertain_ellipsoid as ellipsoid,
)
from .plants.uncertain.build import (
    uncertain_real as real,
)
from .plants.uncertain.build import (
    uncertain_system as system,
)
from .plants.uncertain.cover import (
    Cover as Cover,
)
from .plants.uncertain.cover import (
    cover as cover,
)
from .plants.uncertain.system import (
    UncertainSystem as UncertainSystem,
)
from .synthesis.coprime import (
    ncf_margin as ncf_margin,
)
from .synthesis.coprime import (
    nu_gap as nu_gap,
)

__all__ = [
    "Cover",
    "Ellipsoid",
    "UncertainSystem",
    "append",
    "complex",
    "cover",
    "dynamics",
    "effect_sector",
    "ellipsoid",
    "feedback",
    "lft",
    "ncf_margin",
    "nu_gap",
    "parallel",
    "real",
    "series",
    "system",
]
