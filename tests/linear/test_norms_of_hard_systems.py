"""Both norms against fractions and sixty digits on systems made to be hard."""

import control
import numpy as np
import pytest

from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from tests.fuzz.plant_calls import Given
from tests.fuzz.sixty_digits import checked
from tests.reference.examples import FAMILIES

SLOW, FULL = 70, 560


def system(seed):
    """Return a system of one of the families, in odd units, sometimes sampled, hidden, with D."""
    rng = np.random.default_rng(seed)
    A = FAMILIES[seed % len(FAMILIES)](rng)
    n, m, p = len(A), rng.integers(1, 4), rng.integers(1, 4)
    B, C = rng.standard_normal((n, m)), rng.standard_normal((p, n))
    style = rng.integers(5)
    if style == 0:
        B[rng.integers(n)] = 0
    elif style == 1:
        C[:, rng.integers(n)] *= 1e-12
    elif style == 2:
        B, C = B * (rng.random(B.shape) < 0.4), C * (rng.random(C.shape) < 0.4)
    D = rng.standard_normal((p, m)) * rng.choice([0, 0, 1e-3, 1, 10])
    dt = 0
    if rng.random() < 0.3:
        dt = rng.choice([1e-6, 1.0])
        radius = max(abs(np.linalg.eigvals(A)).max(), 1e-300)
        step = 0.5 / radius
        A = np.linalg.solve(np.eye(n) - A * step, np.eye(n) + A * step)
    else:
        time = 10.0 ** rng.uniform(-9, 9)
        A, B = A * time, B * time
    units = 10.0 ** rng.uniform(-4, 4, n)
    A, B, C = A * units / units[:, None], B / units[:, None], C * units
    return control.StateSpace(A, B, C, D, dt, remove_useless_states=False)


def marked(seed):
    return seed if seed < SLOW else pytest.param(seed, marks=pytest.mark.long)


@pytest.mark.parametrize("seed", [marked(seed) for seed in range(FULL)])
def test_norms_of_hard_systems(seed):
    given = Given(None, system(seed), None)
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
