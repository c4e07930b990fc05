import flint
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.linear.arithmetic.balls import precision
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.real_parameters import proven_real_margin
from tests.robust.loops import servo


def repeated(seed):
    """A stable matrix, its change with a number, and the loop."""
    random = np.random.default_rng(100 + seed)
    n, r = int(random.integers(2, 7)), int(random.integers(1, 4))
    A = random.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.3) * np.eye(n)
    change = random.standard_normal((n, r)) @ random.standard_normal((r, n))
    p = rp.uncertain.real("p", 0, plus_minus=1)
    return A, change, rp.uncertain.system(A + change * p, np.ones((n, 1)), np.ones((1, n)))


def exact(A, change):
    """The Kronecker sum of A + v change is singular where two poles have the sum 0."""
    one = np.eye(len(A))
    sums = [np.kron(M, one) + np.kron(one, M) for M in (A, change)]
    inverse = np.linalg.eigvals(-np.linalg.solve(*sums))
    real = inverse[np.abs(inverse.imag) < 1e-6 * np.abs(inverse)].real
    values = [1 / v for v in real if abs(v) > 1e-9]
    values = [v for v in values if np.linalg.eigvals(A + v * change).real.max() < 1e-6]
    return abs(sharpened(A, change, min(values, key=abs)))


def sharpened(A, change, value):
    """Those eigenvalues are double, good to half the digits: secants with 60 digits give the rest.

    They bring the pole that is nearest to the axis onto it.
    """

    def real_part(v):
        poles = np.array((flint.acb_mat(start) + flint.acb_mat(slope) * v).eig(), dtype=object)
        return min((pole.real for pole in poles), key=lambda x: abs(float(x))).mid()

    with precision(200):
        start, slope = flint.arb_mat(A.tolist()), flint.arb_mat(change.tolist())
        last, now = flint.arb(value * (1 + 1e-7)), flint.arb(value)
        for _ in range(6):
            there, here = real_part(last), real_part(now)
            if there == here:
                break
            last, now = now, (now - here * (now - last) / (here - there)).mid()
        return float(now)


def check(seed):
    A, change, loop = repeated(seed)
    margin = rp.robust_stability(loop)
    answer = exact(A, change)
    assert margin.upper == pytest.approx(answer, rel=1e-8)
    assert answer * (1 - 1e-8) <= margin.lower <= margin.upper
    assert margin.proven
    at = loop.at(margin.witness).poles()
    assert np.min(np.abs(at.real)) <= 1e-8 * np.abs(at).max()


@pytest.mark.parametrize("start", range(0, 100, 20))
def test_hundred_cases_are_exact(start):
    for seed in range(start, start + 20):
        check(seed)


def test_a_larger_size_is_not_proven():
    _, _, loop = repeated(0)
    margin, model = rp.robust_stability(loop), LoopModel.of(loop)
    assert proven_real_margin(model, 1.001 * margin.upper * model.gain) is None
    assert proven_real_margin(model, 0.9 * margin.upper * model.gain) is not None


def test_only_one_number():
    assert proven_real_margin(LoopModel.of(servo()), 1.0) is None
