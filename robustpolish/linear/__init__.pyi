from .arithmetic.exact import is_positive_definite as is_positive_definite
from .delay_stability import DelayStability as DelayStability
from .delay_stability import delay_stability as delay_stability
from .modes import Mode as Mode
from .modes import Modes as Modes
from .modes import modes as modes
from .norms.h2 import H2Norm as H2Norm
from .norms.h2 import h2_norm as h2_norm
from .norms.hinf import AxisZero as AxisZero
from .norms.hinf import HinfNorm as HinfNorm
from .norms.hinf import hinf_norm as hinf_norm
from .norms.hinf import singular_values as singular_values
from .norms.hinf import zeros_on_axis as zeros_on_axis
from .norms.lmi import LmiCheck as LmiCheck
from .norms.lmi import h2_norm_lmi as h2_norm_lmi
from .norms.lmi import hinf_norm_lmi as hinf_norm_lmi
from .norms.lmi import lyapunov_lmi as lyapunov_lmi
from .response import Response as Response
from .response import first_order_hold as first_order_hold
from .response import linear_response as linear_response
from .scaling import Block as Block
from .scaling import Prescaled as Prescaled
from .scaling import Scaling as Scaling
from .scaling import decoupled_blocks as decoupled_blocks
from .scaling import prescale as prescale
from .scaling import scale_system as scale_system
from .stability import Feasibility as Feasibility
from .stability import ModeTest as ModeTest
from .stability import PbhTest as PbhTest
from .stability import Stability as Stability
from .stability import controllability as controllability
from .stability import is_detectable as is_detectable
from .stability import is_stabilizable as is_stabilizable
from .stability import observability as observability
from .stability import stability as stability
from .systems import DelayedSystem as DelayedSystem
from .systems import DelayLine as DelayLine

__all__ = [
    "AxisZero",
    "Block",
    "DelayLine",
    "DelayStability",
    "DelayedSystem",
    "Feasibility",
    "H2Norm",
    "HinfNorm",
    "LmiCheck",
    "Mode",
    "ModeTest",
    "Modes",
    "PbhTest",
    "Prescaled",
    "Response",
    "Scaling",
    "Stability",
    "controllability",
    "decoupled_blocks",
    "delay_stability",
    "first_order_hold",
    "h2_norm",
    "h2_norm_lmi",
    "hinf_norm",
    "hinf_norm_lmi",
    "is_detectable",
    "is_positive_definite",
    "is_stabilizable",
    "linear_response",
    "lyapunov_lmi",
    "modes",
    "observability",
    "prescale",
    "scale_system",
    "singular_values",
    "stability",
    "zeros_on_axis",
]
