"""A norm belongs to the transfer matrix: states, units and the order of signals do not matter."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm


def random_system(seed, sampled):
    rng = np.random.default_rng(seed)
    n, m, p = rng.integers(1, 7), rng.integers(1, 4), rng.integers(1, 4)
    A = rng.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + rng.choice([0.01, 0.3])) * np.eye(n)
    if sampled:
        A = np.linalg.solve(np.eye(n) - A, np.eye(n) + A)
    B, C = rng.standard_normal((n, m)), rng.standard_normal((p, n))
    D = rng.standard_normal((p, m)) if sampled else np.zeros((p, m))
    return rng, A, B, C, D


def norms(A, B, C, D, dt, exact=True):
    system = control.StateSpace(A, B, C, D, dt, remove_useless_states=False)
    return hinf_norm(system, exact=exact).value, h2_norm(system).value


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), sampled=st.booleans(), exact=st.booleans())
def test_norms_do_not_depend_on_the_realisation(seed, sampled, exact):
    rng, A, B, C, D = random_system(seed, sampled)
    dt, n = (0.1 if sampled else 0), len(A)
    reference = norms(A, B, C, D, dt)
    T = np.linalg.qr(rng.standard_normal((n, n)))[0]
    T = T * 10 ** rng.uniform(-4, 4, n)  # mixed states in any units
    back = np.linalg.inv(T)
    assert norms(back @ A @ T, back @ B, C @ T, D, dt, exact) == pytest.approx(reference, rel=1e-6)
    # The transposed system has the same singular values.
    assert norms(A.T, C.T, B.T, D.T, dt, exact) == pytest.approx(reference, rel=1e-8)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), sampled=st.booleans())
def test_norms_do_not_depend_on_order_and_follow_units(seed, sampled):
    rng, A, B, C, D = random_system(seed, sampled)
    dt, n = (0.1 if sampled else 0), len(A)
    hinf, h2 = norms(A, B, C, D, dt)
    x, u, y = (rng.permutation(size) for size in (n, B.shape[1], C.shape[0]))
    shuffled = A[np.ix_(x, x)], B[np.ix_(x, u)], C[np.ix_(y, x)], D[np.ix_(y, u)]
    assert norms(*shuffled, dt) == pytest.approx((hinf, h2), rel=1e-8)
    unit, rate = 10 ** rng.uniform(-6, 6), 1.0 if sampled else 10 ** rng.uniform(-6, 6)
    slower = norms(rate * A, rate * unit * B, C, unit * D, dt)
    assert slower == pytest.approx((unit * hinf, unit * np.sqrt(rate) * h2), rel=1e-8)
