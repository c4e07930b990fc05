from .robustness import (
    RobustnessCheck as RobustnessCheck,
)
from .robustness import (
    check_robustness as check_robustness,
)
from .sampled_loops import (
    SampledLoops as SampledLoops,
)
from .simulate import (
    ControllerComparison as ControllerComparison,
)
from .simulate import (
    compare_controllers as compare_controllers,
)
from .simulate import (
    simulate as simulate,
)

__all__ = [
    "ControllerComparison",
    "RobustnessCheck",
    "SampledLoops",
    "check_robustness",
    "compare_controllers",
    "simulate",
]
