import numpy as np
import pytest

import robustpolish as rp
from robustpolish.robust.branch_and_bound import family, is_small
from robustpolish.robust.loop_model import DeltaBlock, LoopModel
from tests.robust.branching.test_bernstein import value
from tests.robust.loops import column, servo


def springs(dt=0):
    """Two numbers, one of them twice in it, with direct feedthrough, two inputs and outputs."""
    k, c = rp.uncertain.real("k", 2, percent=30), rp.uncertain.real("c", 1, percent=50)
    A = [[0, 1], [-k * k, -c / (1 + 0.1 * k)]]
    if dt:
        A = [[0.5, 0.1], [-0.1 * k * k, 0.4 - 0.1 * c]]
    return rp.uncertain.system(A, np.eye(2), [[1, k], [0, 1]], [[0, 0.1], [0.2, c]], dt=dt)


@pytest.mark.parametrize("dt", [0, 0.1])
def test_polynomials_are_those_of_the_loop(dt):
    system = springs(dt)
    loop = LoopModel.of(system, DeltaBlock("full", 1, 2, 2, "performance"))
    one = family(loop, 0.8)
    assert one.rest == (2, 2)
    deltas = np.array([0.8 * (2 * x - 1) for x in (0.3, 0.9)])
    coefficients = np.vectorize(float)(one.parts)
    at = []
    for part in coefficients:
        inner = np.apply_along_axis(value, 0, part, 0.3)
        at.append(np.apply_along_axis(value, 0, inner, 0.9))
    omega = 0.7
    P, *N = (np.polyval(row[::-1], 1j * omega) for row in at)
    blocks = [np.eye(b.copies) * d for b, d in zip(loop.structure.blocks, deltas, strict=False)]
    gains = np.zeros((sum(map(len, blocks)),) * 2)
    first = 0
    for own in blocks:
        gains[first : first + len(own), first : first + len(own)] = own
        first += len(own)
    M = loop.response(loop.angle(omega))[0]
    r = len(gains)
    closed = M[r:, r:] + M[r:, :r] @ gains @ np.linalg.solve(
        np.eye(r) - M[:r, :r] @ gains, M[:r, r:]
    )
    np.testing.assert_allclose(np.array(N).reshape(2, 2) / P, closed, rtol=1e-9)


def test_what_is_small():
    assert is_small(LoopModel.of(servo()), 100)
    assert not is_small(LoopModel.of(servo()), 10)
    assert not is_small(LoopModel.of(column()), 10**6)  # without real numbers
