"""Descent on the true norms of a loop with a structured controller.

Everything here works on plain matrices: a :class:`PlantMatrices` closes a plant with a
constant matrix K, the measures (norms, spectral abscissa, gain, regions) return values
with gradients over K, a parametrisation maps free numbers to K, and two descents use
them: BFGS for functions that are smooth almost everywhere, and a bundle method that
sees all active peaks at once.
"""

from robustpolish.synthesis.nonsmooth.bfgs import bfgs, ended_by
from robustpolish.synthesis.nonsmooth.gain_measures import FrobeniusMeasure, GainMeasure
from robustpolish.synthesis.nonsmooth.h2_measure import H2Measure
from robustpolish.synthesis.nonsmooth.hinf_measure import HinfMeasure
from robustpolish.synthesis.nonsmooth.minimax import Bounds, minimax
from robustpolish.synthesis.nonsmooth.parametrisations import (
    AffineGain,
    MaskedGain,
    ObserverGain,
    Parametrisation,
    PositiveElements,
)
from robustpolish.synthesis.nonsmooth.pole_measures import (
    RegionMeasure,
    StabilityMeasure,
    WorstMeasure,
)
from robustpolish.synthesis.nonsmooth.problem import ActivePiece, Measure, Problem, Requirement

__all__ = [
    "ActivePiece",
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
    "PositiveElements",
    "Problem",
    "RegionMeasure",
    "Requirement",
    "StabilityMeasure",
    "WorstMeasure",
    "bfgs",
    "ended_by",
    "minimax",
]
