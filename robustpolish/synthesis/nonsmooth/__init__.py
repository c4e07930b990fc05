"""Descent on the true norms of a loop with a structured controller.

Everything here works on plain matrices: a :class:`PlantMatrices` closes a plant with a
constant matrix K, the measures (norms, spectral abscissa, gain, regions) return values
with gradients over K, a parametrisation maps free numbers to K, and two descents use
them: BFGS for functions that are smooth almost everywhere, and a bundle method that
sees all active peaks at once.
"""

from robustpolish.synthesis.nonsmooth.bfgs import bfgs
from robustpolish.synthesis.nonsmooth.h2 import H2Measure
from robustpolish.synthesis.nonsmooth.hinf import HinfMeasure
from robustpolish.synthesis.nonsmooth.minimax import Bounds, minimax
from robustpolish.synthesis.nonsmooth.parametrisations import (
    AffineGain,
    MaskedGain,
    ObserverGain,
    Parametrisation,
    PositiveElements,
)
from robustpolish.synthesis.nonsmooth.problem import Measure, Piece, Problem, Requirement
from robustpolish.synthesis.nonsmooth.search import SearchLimits, SearchResult, search
from robustpolish.synthesis.nonsmooth.spectrum import (
    FrobeniusMeasure,
    GainMeasure,
    RegionMeasure,
    StabilityMeasure,
    WorstMeasure,
)

__all__ = [
    "AffineGain",
    "Bounds",
    "FrobeniusMeasure",
    "GainMeasure",
    "H2Measure",
    "HinfMeasure",
    "MaskedGain",
    "Measure",
    "ObserverGain",
    "Parametrisation",
    "Piece",
    "PositiveElements",
    "Problem",
    "RegionMeasure",
    "Requirement",
    "SearchLimits",
    "SearchResult",
    "StabilityMeasure",
    "WorstMeasure",
    "bfgs",
    "minimax",
    "search",
]
