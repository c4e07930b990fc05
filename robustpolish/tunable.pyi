from .synthesis.problem.pole_regions import (
    PassiveElement as PassiveElement,
)
from .synthesis.structured.block_parts import (
    Tunable as Tunable,
)
from .synthesis.structured.block_parts import (
    TunableBlock as TunableBlock,
)
from .synthesis.structured.block_parts import (
    TunedBlock as TunedBlock,
)
from .synthesis.structured.block_parts import (
    TunedNumber as TunedNumber,
)
from .synthesis.structured.block_parts import (
    tunable as tunable,
)
from .synthesis.structured.blocks import (
    fixed_order as fixed_order,
)
from .synthesis.structured.blocks import (
    lead_lag as lead_lag,
)
from .synthesis.structured.blocks import (
    low_pass as low_pass,
)
from .synthesis.structured.blocks import (
    notch as notch,
)
from .synthesis.structured.blocks import (
    pid as pid,
)
from .synthesis.structured.blocks import (
    static_gain as static_gain,
)

__all__ = [
    "PassiveElement",
    "Tunable",
    "TunableBlock",
    "TunedBlock",
    "TunedNumber",
    "fixed_order",
    "lead_lag",
    "low_pass",
    "notch",
    "pid",
    "static_gain",
    "tunable",
]
