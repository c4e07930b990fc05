"""Controllers with certificates: one method per file, and the certificate that judges them all."""

from robustpolish.synthesis.blocks.block import TunableBlock
from robustpolish.synthesis.blocks.kinds.fixed_order import fixed_order
from robustpolish.synthesis.blocks.kinds.lead_lag import lead_lag
from robustpolish.synthesis.blocks.kinds.low_pass import low_pass
from robustpolish.synthesis.blocks.kinds.notch import notch
from robustpolish.synthesis.blocks.kinds.pid import pid
from robustpolish.synthesis.blocks.kinds.static_gain import static_gain
from robustpolish.synthesis.blocks.tunable import Tunable, tunable
from robustpolish.synthesis.blocks.tuned import TunedBlock, TunedNumber
from robustpolish.synthesis.certificate.certificate import Certificate, certify
from robustpolish.synthesis.design.design import Design
from robustpolish.synthesis.design.largest_period import largest_period
from robustpolish.synthesis.loop_shaping.loop_shaping import loop_shaping
from robustpolish.synthesis.loop_shaping.ncf_margin import ncf_margin
from robustpolish.synthesis.loop_shaping.nu_gap import nu_gap
from robustpolish.synthesis.methods.compare_methods import (
    MethodComparison,
    MethodResult,
    compare_methods,
)
from robustpolish.synthesis.methods.given_controller import given_controller
from robustpolish.synthesis.methods.mixed_feedback import (
    mixed_output_feedback,
    mixed_state_feedback,
)
from robustpolish.synthesis.methods.observer_feedback import observer_feedback
from robustpolish.synthesis.methods.output_feedback import output_feedback
from robustpolish.synthesis.methods.passive_feedback import passive_feedback
from robustpolish.synthesis.methods.published_controllers import (
    PUBLISHED_CONTROLLERS,
    PUBLISHED_NORMS,
    published_gain,
)
from robustpolish.synthesis.methods.state_feedback import state_feedback
from robustpolish.synthesis.methods.static_output_feedback import static_output_feedback
from robustpolish.synthesis.methods.structured_output_feedback import structured_output_feedback
from robustpolish.synthesis.methods.trade_off import TradeOff, trade_off
from robustpolish.synthesis.polytopes.robust_gain import RobustStateFeedback
from robustpolish.synthesis.polytopes.robust_state_feedback import robust_state_feedback
from robustpolish.synthesis.polytopes.scheduled_design import ScheduledDesign
from robustpolish.synthesis.polytopes.scheduled_feedback import scheduled_feedback
from robustpolish.synthesis.problem.channels import channel
from robustpolish.synthesis.problem.passive_element import PassiveElement
from robustpolish.synthesis.problem.pole_regions import Disk, HalfPlane, Sector
from robustpolish.synthesis.structured_search.observer_structure import observer_controller
from robustpolish.synthesis.uncertain.robust_design import RobustDesign
from robustpolish.synthesis.uncertain.robust_output_feedback import robust_output_feedback

__all__ = [
    "PUBLISHED_CONTROLLERS",
    "PUBLISHED_NORMS",
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
    "published_gain",
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
