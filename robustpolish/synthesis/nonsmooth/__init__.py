"""Descent on the true norms of a loop with a structured controller.

Everything here works on plain matrices: a :class:`PlantMatrices` closes a plant with a
constant matrix K, the measures (norms, spectral abscissa, gain, regions) return values
with gradients over K, a parametrisation maps free numbers to K, and two descents use
them: BFGS for functions that are smooth almost everywhere, and a bundle method that
sees all active peaks at once.
"""

from robustpolish.synthesis.nonsmooth.bfgs import bfgs as bfgs
from robustpolish.synthesis.nonsmooth.bfgs import ended_by as ended_by
from robustpolish.synthesis.nonsmooth.folded import Bounds as Bounds
from robustpolish.synthesis.nonsmooth.folded import Folded as Folded
from robustpolish.synthesis.nonsmooth.gain_measures import FrobeniusMeasure as FrobeniusMeasure
from robustpolish.synthesis.nonsmooth.gain_measures import GainMeasure as GainMeasure
from robustpolish.synthesis.nonsmooth.h2_measure import H2Measure as H2Measure
from robustpolish.synthesis.nonsmooth.hinf_measure import HinfMeasure as HinfMeasure
from robustpolish.synthesis.nonsmooth.minimax import minimax as minimax
from robustpolish.synthesis.nonsmooth.parametrisations import AffineGain as AffineGain
from robustpolish.synthesis.nonsmooth.parametrisations import MaskedGain as MaskedGain
from robustpolish.synthesis.nonsmooth.parametrisations import ObserverGain as ObserverGain
from robustpolish.synthesis.nonsmooth.parametrisations import Parametrisation as Parametrisation
from robustpolish.synthesis.nonsmooth.parametrisations import PositiveElements as PositiveElements
from robustpolish.synthesis.nonsmooth.pole_measures import RegionMeasure as RegionMeasure
from robustpolish.synthesis.nonsmooth.pole_measures import StabilityMeasure as StabilityMeasure
from robustpolish.synthesis.nonsmooth.pole_measures import WorstMeasure as WorstMeasure
from robustpolish.synthesis.nonsmooth.problem import ActivePiece as ActivePiece
from robustpolish.synthesis.nonsmooth.problem import Measure as Measure
from robustpolish.synthesis.nonsmooth.problem import Problem as Problem
from robustpolish.synthesis.nonsmooth.problem import Requirement as Requirement
