from .questions import RobustPerformance as RobustPerformance
from .questions import RobustStability as RobustStability
from .questions import SectorStability as SectorStability
from .questions import WorstCaseGain as WorstCaseGain
from .questions import robust_performance as robust_performance
from .questions import robust_sector as robust_sector
from .questions import robust_stability as robust_stability
from .questions import worst_case_gain as worst_case_gain
from .structured_singular_value import StructuredSingularValue as StructuredSingularValue
from .structured_singular_value import structured_singular_value as structured_singular_value

__all__ = [
    "RobustPerformance",
    "RobustStability",
    "SectorStability",
    "StructuredSingularValue",
    "WorstCaseGain",
    "robust_performance",
    "robust_sector",
    "robust_stability",
    "structured_singular_value",
    "worst_case_gain",
]
