import numpy as np
import pytest

import robustpolish as rp
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.one_number import proven_size
from tests.robust.loops import servo


def repeated(seed):
    """A stable matrix, its change with a number, and the loop."""
    random = np.random.default_rng(100 + seed)
    n, r = int(random.integers(2, 7)), int(random.integers(1, 4))
    A = random.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.3) * np.eye(n)
    change = random.standard_normal((n, r)) @ random.standard_normal((r, n))
    p = rp.uncertain_real("p", 0, plus_minus=1)
    return A, change, rp.uncertain_system(A + change * p, np.ones((n, 1)), np.ones((1, n)))


def exact(A, change):
    """The Kronecker sum of A + v change is singular where two poles have the sum 0."""
    one = np.eye(len(A))
    sums = [np.kron(M, one) + np.kron(one, M) for M in (A, change)]
    inverse = np.linalg.eigvals(-np.linalg.solve(*sums))
    real = inverse[np.abs(inverse.imag) < 1e-6 * np.abs(inverse)].real
    values = [1 / v for v in real if abs(v) > 1e-9]
    return min(abs(v) for v in values if np.linalg.eigvals(A + v * change).real.max() < 1e-6)


def check(seed):
    A, change, loop = repeated(seed)
    margin = rp.robust_stability(loop)
    # the reference has double eigenvalues, good to half the digits only
    assert margin.upper == pytest.approx(exact(A, change), rel=1e-6)
    assert margin.upper * (1 - 1e-8) <= margin.lower <= margin.upper
    assert margin.proven
    at = loop.at(margin.witness).poles()
    assert np.min(np.abs(at.real)) <= 1e-8 * np.abs(at).max()


@pytest.mark.parametrize("seed", range(6))
def test_exact(seed):
    check(seed)


@pytest.mark.slow
@pytest.mark.parametrize("start", range(6, 106, 20))
def test_hundred_cases(start):
    for seed in range(start, start + 20):
        check(seed)


def test_a_larger_size_is_not_proven():
    _, _, loop = repeated(0)
    margin, model = rp.robust_stability(loop), LoopModel.of(loop)
    assert proven_size(model, 1.001 * margin.upper * model.gain) is None
    assert proven_size(model, 0.9 * margin.upper * model.gain) is not None


def test_only_one_number():
    assert proven_size(LoopModel.of(servo()), 1.0) is None
