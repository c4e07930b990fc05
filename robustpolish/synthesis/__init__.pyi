from .certificate import (
    Certificate as Certificate,
)
from .certificate import (
    certify as certify,
)
from .compare import (
    MethodComparison as MethodComparison,
)
from .compare import (
    MethodResult as MethodResult,
)
from .compare import (
    TradeOff as TradeOff,
)
from .compare import (
    compare_methods as compare_methods,
)
from .compare import (
    trade_off as trade_off,
)
from .coprime import (
    ncf_margin as ncf_margin,
)
from .coprime import (
    nu_gap as nu_gap,
)
from .design import (
    Design as Design,
)
from .design import (
    given_controller as given_controller,
)
from .design import (
    largest_period as largest_period,
)
from .loop_shaping import (
    loop_shaping as loop_shaping,
)
from .output_feedback.output_feedback import (
    output_feedback as output_feedback,
)
from .problem.matrices import (
    channel as channel,
)
from .problem.pole_regions import (
    Disk as Disk,
)
from .problem.pole_regions import (
    HalfPlane as HalfPlane,
)
from .problem.pole_regions import (
    PassiveElement as PassiveElement,
)
from .problem.pole_regions import (
    Sector as Sector,
)
from .scheduled.robust_state_feedback import (
    RobustStateFeedback as RobustStateFeedback,
)
from .scheduled.robust_state_feedback import (
    robust_state_feedback as robust_state_feedback,
)
from .scheduled.scheduled_feedback import (
    ScheduledDesign as ScheduledDesign,
)
from .scheduled.scheduled_feedback import (
    scheduled_feedback as scheduled_feedback,
)
from .state_feedback.state_feedback import (
    state_feedback as state_feedback,
)
from .structured.block_parts import (
    Tunable as Tunable,
)
from .structured.block_parts import (
    TunableBlock as TunableBlock,
)
from .structured.block_parts import (
    TunedBlock as TunedBlock,
)
from .structured.block_parts import (
    TunedNumber as TunedNumber,
)
from .structured.block_parts import (
    tunable as tunable,
)
from .structured.blocks import (
    fixed_order as fixed_order,
)
from .structured.blocks import (
    lead_lag as lead_lag,
)
from .structured.blocks import (
    low_pass as low_pass,
)
from .structured.blocks import (
    notch as notch,
)
from .structured.blocks import (
    pid as pid,
)
from .structured.blocks import (
    static_gain as static_gain,
)
from .structured.methods import (
    observer_feedback as observer_feedback,
)
from .structured.methods import (
    passive_feedback as passive_feedback,
)
from .structured.methods import (
    static_output_feedback as static_output_feedback,
)
from .structured.methods import (
    structured_output_feedback as structured_output_feedback,
)
from .structured.mixed import (
    mixed_output_feedback as mixed_output_feedback,
)
from .structured.mixed import (
    mixed_state_feedback as mixed_state_feedback,
)
from .structured.starts import (
    observer_controller as observer_controller,
)
from .uncertain.robust_output_feedback import (
    RobustDesign as RobustDesign,
)
from .uncertain.robust_output_feedback import (
    robust_output_feedback as robust_output_feedback,
)

__all__ = [
    "Certificate",
    "Design",
    "Disk",
    "HalfPlane",
    "MethodComparison",
    "MethodResult",
    "PassiveElement",
    "RobustDesign",
    "RobustStateFeedback",
    "ScheduledDesign",
    "Sector",
    "TradeOff",
    "Tunable",
    "TunableBlock",
    "TunedBlock",
    "TunedNumber",
    "certify",
    "channel",
    "compare_methods",
    "fixed_order",
    "given_controller",
    "largest_period",
    "lead_lag",
    "loop_shaping",
    "low_pass",
    "mixed_output_feedback",
    "mixed_state_feedback",
    "ncf_margin",
    "notch",
    "nu_gap",
    "observer_controller",
    "observer_feedback",
    "output_feedback",
    "passive_feedback",
    "pid",
    "robust_output_feedback",
    "robust_state_feedback",
    "scheduled_feedback",
    "state_feedback",
    "static_gain",
    "static_output_feedback",
    "structured_output_feedback",
    "trade_off",
    "tunable",
]
