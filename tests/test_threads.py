"""Any number of threads gives the same bits."""

import os
import subprocess
import sys

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from robustpolish.threads import same_bits

DESIGN = """
import hashlib
import numpy as np
import robustpolish as rp

rng = np.random.default_rng(3)
n = 10
A = rng.standard_normal((n, n))
plant = rp.GeneralizedPlant.from_matrices(
    A, rng.standard_normal((n, 3)), rng.standard_normal((n, 2)), rng.standard_normal((3, n)),
    rng.standard_normal((2, n)), D12=np.eye(3, 2), D21=np.eye(2, 3))
design = rp.output_feedback(plant, time_limit=120)
rate = rng.standard_normal((160, 160)) - 20 * np.eye(160)
loop = __import__("control").ss(rate, rate[:, :2], rate[:2], 0)
K = design.controller
found = [K.A, K.B, K.C, K.D, design.certificate.achieved, rp.h2_norm(loop).value]
print(hashlib.sha256(b"".join(np.ascontiguousarray(M).tobytes() for M in found)).hexdigest())
"""


def bits(threads):
    environment = os.environ | {"OPENBLAS_NUM_THREADS": threads, "OMP_NUM_THREADS": threads}
    done = subprocess.run(
        [sys.executable, "-c", DESIGN], env=environment, capture_output=True, text=True, check=True
    )
    return done.stdout


def test_a_design_has_the_same_bits_on_one_and_two_threads():
    one = bits("1")
    assert len(one.strip()) == 64
    assert bits("2") == one


def threads():
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_threads_are_given_back_even_after_an_error():
    seen = []

    @same_bits
    def inner(fail):
        seen.append(threads())
        if fail:
            raise ValueError("as asked")
        return 5

    @same_bits
    def outer():
        inner(False)
        return threads()

    with threadpool_limits(2, user_api="blas"):
        before = threads()
        assert inner(False) == 5
        with pytest.raises(ValueError, match="as asked"):
            inner(True)
        assert outer() == {1}  # the inner call does not give them back
        assert threads() == before
    assert seen == [{1}] * 3


def test_large_equations_round_alike():
    rng = np.random.default_rng(0)
    A, B = rng.standard_normal((2, 240, 240))
    solve = same_bits(np.linalg.solve)
    with threadpool_limits(2, user_api="blas"):
        two = solve(A, B)
    with threadpool_limits(1, user_api="blas"):
        one = np.linalg.solve(A, B)
    assert (one == two).all()
