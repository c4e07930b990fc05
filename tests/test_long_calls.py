"""Work is counted the same way on every machine, and any number of threads gives the same bits."""

import math
import os
import subprocess
import sys
import threading

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from robustpolish.base.budget import Budget, parallel_map, single_threaded_blas, step_cost


def test_work_ends_a_search_whatever_the_time():
    budget = Budget(3.0)
    count = 0
    while not budget.over:
        budget.spend()
        count += 1
    assert count == 3
    assert budget.exhausted
    assert not budget.late


def test_a_share_spends_from_the_whole():
    budget = Budget(100.0)
    budget.spend(20.0)
    share = budget.share(0.25)
    assert share.work_left == 20.0
    share.spend(15.0)
    assert budget.work_left == 65.0
    budget.spend(65.0)
    assert share.exhausted  # the whole is, though the share has work left


def test_the_safety_net_is_remembered_and_passed_on():
    budget = Budget(math.inf, seconds=0.0)
    share = budget.share(1.0)
    assert share.late
    assert share.over
    assert budget.late
    assert not share.exhausted


def test_large_matrices_cost_more():
    costs = [step_cost(n) for n in (2, 20, 200)]
    assert costs == sorted(costs)
    assert costs[2] > 100 * costs[1]


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

    @single_threaded_blas
    def inner(fail):
        seen.append(threads())
        if fail:
            raise ValueError("as asked")
        return 5

    @single_threaded_blas
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
    solve = single_threaded_blas(np.linalg.solve)
    with threadpool_limits(2, user_api="blas"):
        two = solve(A, B)
    with threadpool_limits(1, user_api="blas"):
        one = np.linalg.solve(A, B)
    assert (one == two).all()


def test_several_threads_run_at_a_time_and_answers_keep_their_order(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    both = threading.Barrier(2)

    def waits(item):
        both.wait(timeout=30)  # one alone would wait in vain
        return 10 * item

    assert parallel_map(waits, iter([3, 1, 2, 4])) == [30, 10, 20, 40]
    assert parallel_map(waits, []) == []


def test_an_error_in_a_thread_is_raised():
    with pytest.raises(ZeroDivisionError):
        parallel_map(lambda item: 1 / item, [1, 0])
