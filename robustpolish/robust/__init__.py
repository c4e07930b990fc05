"""Robust analysis: what holds for every machine within the bounds of an uncertain system."""

from robustpolish.robust.matrix_value import StructuredSingularValue
from robustpolish.robust.performance import (
    RobustPerformance,
    WorstCaseGain,
    robust_performance,
    worst_case_gain,
)
from robustpolish.robust.sector import SectorStability, robust_sector
from robustpolish.robust.singular_value import structured_singular_value
from robustpolish.robust.stability import RobustStability, robust_stability

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
