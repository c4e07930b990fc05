"""Responses of a loop from its modes, against linear solves, and where they cross a level."""

import numpy as np
import pytest
from random_loops import random_loop, scalar_loop

from robustpolish.synthesis.nonsmooth.measures import LoopResponse
from robustpolish.synthesis.problem.matrices import close_static_loop


def response(loop):
    return LoopResponse(close_static_loop(loop, np.zeros((loop.nu, loop.ny))))


def by_solves(found, frequencies):
    """Singular values by definition."""
    closed = found.closed
    values = []
    for w in frequencies:
        pencil = found.point(w) * np.eye(len(closed.A)) - closed.A
        values.append(np.linalg.norm(closed.C @ np.linalg.solve(pencil, closed.B) + closed.D, 2))
    return np.array(values)


@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("n", [3, 20])
def test_singular_values_are_those_of_linear_solves(discrete, n):
    found = response(random_loop(np.random.default_rng(n), discrete, n=n))
    frequencies = np.linspace(0.0, 3.0, 40)
    values, true = found.sigma(frequencies), by_solves(found, frequencies)
    near = true > 0.95 * true.max()
    assert values[near] == pytest.approx(true[near], rel=1e-8)
    # Far below the largest, bounds from above do.
    assert (values >= true * (1 - 1e-8)).all()
    assert values[~near].max(initial=0.0) < true.max()


def test_parallel_eigenvectors_fall_back_to_linear_solves():
    n = 16
    loop = random_loop(np.random.default_rng(1), False, n=n)
    chain = loop.replace(A=-np.eye(n) + np.diag(np.ones(n - 1), 1))
    found = response(chain)
    frequencies = np.array([0.0, 0.5, 2.0])
    assert found.sigma(frequencies).max() == pytest.approx(
        by_solves(found, frequencies).max(), rel=1e-9
    )


def test_a_level_is_crossed_where_a_lag_falls_below_it():
    # 1 / |i w + 1| is 1/2 at the square root of 3.
    found = response(scalar_loop(A=-1.0))
    assert found.crossings(0.5) == pytest.approx([np.sqrt(3.0)])
    assert len(found.crossings(1.5)) == 0
    assert 0.0 in found.start()


def test_a_level_whose_square_is_beyond_doubles_has_no_crossings():
    """Found by a random plant: Python's powers of numbers end in errors of their own."""
    assert len(response(scalar_loop()).crossings(1e200)) == 0
