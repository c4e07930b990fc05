"""Both norms against fractions and sixty digits on systems made to be hard."""

import control
import numpy as np
import pytest

from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from tests.fuzz.plant_calls import Given
from tests.fuzz.sixty_digits import checked
from tests.reference.examples import hard_system

SLOW, FULL = 70, 560


def marked(seed):
    return seed if seed < SLOW else pytest.param(seed, marks=pytest.mark.long)


@pytest.mark.parametrize("seed", [marked(seed) for seed in range(FULL)])
def test_norms_of_hard_systems(seed):
    given = Given(None, hard_system(seed, wide=True), None)
    hinf, h2 = hinf_norm(given.system), h2_norm(given.system)
    checked("hinf_norm", hinf, given)
    checked("h2_norm", h2, given)
    assert hinf.stable == h2.stable
    assert hinf.upper <= hinf.lower * (1 + 2e-9)


@pytest.mark.parametrize(
    ("dt", "hinf", "h2"),
    [(0, 4.276759162964244, 2.237461821810309), (0.1, 4.276759162964228, 0.707434962289554)],
)
def test_a_published_system_with_two_inputs_and_outputs(dt, hinf, h2):
    """MATLAB's norms of a random system in python-control's tests/sysnorm_test.py."""
    system = control.StateSpace(
        [
            [-1.017041847539126, -0.224182952826418, 0.042538079149249],
            [-0.310374015319095, -0.516461581407780, -0.119195790221750],
            [-1.452723568727942, 1.7995860837102088, -1.491935830615152],
        ],
        [
            [0.312858596637428, -0.164879019209038],
            [-0.864879917324456, 0.627707287528727],
            [-0.030051296196269, 1.093265669039484],
        ],
        [
            [1.109273297614398, 0.077359091130425, -1.113500741486764],
            [-0.863652821988714, -1.214117043615409, -0.006849328103348],
        ],
        np.zeros((2, 2)),
    )
    if dt:
        system = control.sample_system(system, dt)
    assert hinf_norm(system).value == pytest.approx(hinf, rel=1e-9)
    assert h2_norm(system).value == pytest.approx(h2, rel=1e-9)
