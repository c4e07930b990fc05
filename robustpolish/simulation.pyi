from .closed_loop.robustness import (
    RobustnessCheck as RobustnessCheck,
)
from .closed_loop.robustness import (
    check_robustness as check_robustness,
)
from .closed_loop.sampled_loops import (
    SampledLoops as SampledLoops,
)
from .closed_loop.simulate import (
    simulate as simulate,
)
from .linear.response import (
    Response as Response,
)
from .linear.response import (
    first_order_hold as first_order_hold,
)
from .linear.response import (
    linear_response as linear_response,
)
from .linear.systems import (
    DelayedSystem as DelayedSystem,
)
from .linear.systems import (
    DelayLine as DelayLine,
)
from .machines.mechanical.feedback import (
    Feedback as Feedback,
)
from .machines.mechanical.feedback import (
    FeedbackTerm as FeedbackTerm,
)
from .machines.simulation import (
    NonlinearResponse as NonlinearResponse,
)
from .machines.simulation import (
    simulate_model as simulate_model,
)
from .polishing.monte_carlo import (
    monte_carlo as monte_carlo,
)

__all__ = [
    "DelayLine",
    "DelayedSystem",
    "Feedback",
    "FeedbackTerm",
    "NonlinearResponse",
    "Response",
    "RobustnessCheck",
    "SampledLoops",
    "check_robustness",
    "first_order_hold",
    "linear_response",
    "monte_carlo",
    "simulate",
    "simulate_model",
]
