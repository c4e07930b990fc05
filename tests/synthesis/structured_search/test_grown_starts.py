"""Shorter controllers, grown: the loop stays what it was, and can be improved."""

import numpy as np
from small_plants import FULL, two_masses

from robustpolish.base.budget import Budget
from robustpolish.synthesis.problem.scaling import whole_plant
from robustpolish.synthesis.structured.order_starts import AugmentedStarts
from robustpolish.synthesis.structured.structures import StaticStructure


def test_grown_controllers_keep_the_norm_of_the_shorter_one():
    part = whole_plant(two_masses(FULL))
    shorter = StaticStructure("hinf", 1).problem(part)
    problem = StaticStructure("hinf", 3).problem(part)
    assert shorter is not None
    assert problem is not None
    starts = AugmentedStarts(shorter, 3, problem.parametrisation.coordinates)
    found = list(starts.propose((), Budget(4e3), np.random.default_rng(0)))
    assert found
    values = [problem.objective.pieces(problem.parametrisation.gain(t), 0.0, ()) for t in found]
    norms = [pieces[0].value for pieces in values]
    assert np.allclose(norms, norms[0], rtol=1e-6)
    # What is added listens, but is not heard yet: the slope over its outputs is not zero.
    slope = values[0][0].gradient
    assert np.abs(slope[3:, 1:3]).max() > 0
    assert not problem.parametrisation.gain(found[0])[3:, 1:3].any()
