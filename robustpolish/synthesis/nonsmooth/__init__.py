"""Descent on the true norms of a loop with a structured controller.

Everything here works on plain matrices: a :class:`Loop` closes a plant with a
constant matrix K, the measures (norms, spectral abscissa, gain, regions) return values
with gradients over K, a parametrisation maps free numbers to K, and two descents use
them: BFGS for one smooth-almost-everywhere function, and a bundle method that
sees all active peaks at once.
"""

from robustpolish.synthesis.nonsmooth.bfgs import bfgs
from robustpolish.synthesis.nonsmooth.h2 import H2Measure
from robustpolish.synthesis.nonsmooth.hinf import HinfMeasure
from robustpolish.synthesis.nonsmooth.loops import Loop, augmented
from robustpolish.synthesis.nonsmooth.minimax import minimax
from robustpolish.synthesis.nonsmooth.problem import Piece, Problem, Requirement
from robustpolish.synthesis.nonsmooth.spectrum import GainMeasure, RegionMeasure, StabilityMeasure

__all__ = [
    "GainMeasure",
    "H2Measure",
    "HinfMeasure",
    "Loop",
    "Piece",
    "Problem",
    "RegionMeasure",
    "Requirement",
    "StabilityMeasure",
    "augmented",
    "bfgs",
    "minimax",
]
