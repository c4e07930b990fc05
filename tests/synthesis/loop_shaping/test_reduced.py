"""Controllers with fewer states."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.loop_shaping.coprime import coprime, loop_plant
from robustpolish.synthesis.loop_shaping.loop_shaping import reduce_in_gap_metric


def random_controller(seed, dt=0):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((5, 5)) * (0.4 if dt else 1)
    shapes = ((5, 2), (3, 5), (3, 2))
    return control.ss(A, *(rng.standard_normal(shape) for shape in shapes), dt)


@pytest.mark.parametrize("dt", [0, 0.1])
def test_all_states_give_the_controller_again(dt):
    K = random_controller(0, dt)
    again = control.ss(*reduce_in_gap_metric(K, 5), dt)
    for point in (0.3, 1.2, 2.5):
        s = np.exp(1j * point) if dt else 1j * point
        np.testing.assert_allclose(again(s), K(s), rtol=1e-7)


@pytest.mark.parametrize("seed", range(5))
def test_fewer_states_stay_within_the_bound_of_the_gap(seed):
    # The nu-gap to the truncated one is at most the error of the factors, and that at most twice
    # the sum of the Hankel singular values left out.
    K = random_controller(seed)
    gaps = [
        rp.uncertain.nu_gap(K, control.ss(*reduce_in_gap_metric(K, order), 0))
        for order in (5, 4, 3)
    ]
    assert gaps[0] < 1e-5
    assert gaps[0] <= gaps[1] + 1e-9
    assert reduce_in_gap_metric(K, 3).A.shape == (3, 3)
    factors = control.ss(*coprime(loop_plant("K", K)).right(), 0)
    hankel = np.sort(control.hankel_singular_values(factors))
    for gap, left_out in zip(gaps[1:], (1, 2), strict=True):
        assert gap <= 2 * hankel[:left_out].sum() + 1e-6


def test_states_that_do_not_matter_cannot_be_kept():
    idle = control.ss(np.diag([-1.0, -2.0]), [[1.0], [0.0]], [[1.0, 0.0]], 0)
    with pytest.raises(rp.SolverError, match="fewer than 2 states"):
        reduce_in_gap_metric(idle, 2)
    assert reduce_in_gap_metric(idle, 1).A.shape == (1, 1)
