"""One Lyapunov matrix for several specifications: conservative, but a start."""

import numpy as np
import pytest
from small_plants import oscillator

from robustpolish.base.budget import Budget
from robustpolish.synthesis.lmi.mixed import Specification, mixed_start
from robustpolish.synthesis.lmi.program import ProgramSolver
from robustpolish.synthesis.nonsmooth.measures import HinfMeasure
from robustpolish.synthesis.problem.matrices import PlantMatrices, augmented
from robustpolish.synthesis.problem.pole_regions import HalfPlane
from robustpolish.synthesis.structured.mixed import mixed_output_feedback


def test_inequalities_alone_come_within_their_back_off():
    plant = oscillator()
    K = mixed_start(
        [Specification(plant, "hinf", None)],
        (),
        ProgramSolver("cvxpy", None, Budget(), accuracy=1e-8),
        1.05,
    )
    loop = augmented(PlantMatrices.of(plant), plant.nx)
    achieved = HinfMeasure(loop).pieces(K, 0.0, ())[0].value
    best = mixed_output_feedback(plant, time_limit=5).certificate.achieved
    assert best * 0.999 <= achieved <= 1.06 * best
    assert np.abs(K).max() < 1e3


def test_picos_states_the_same_inequalities():
    plant = oscillator()
    starts = [
        mixed_start(
            [Specification(plant, "hinf", None)],
            (HalfPlane(-0.3),),
            ProgramSolver(backend, None, Budget(), accuracy=1e-8),
            1.05,
        )
        for backend in ("cvxpy", "picos")
    ]
    loop = augmented(PlantMatrices.of(plant), plant.nx)
    norms = [HinfMeasure(loop).pieces(K, 0.0, ())[0].value for K in starts]
    assert norms[0] == pytest.approx(norms[1], rel=0.02)
