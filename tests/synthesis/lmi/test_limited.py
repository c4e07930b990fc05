"""Calls in a process of their own: answers come back, time is kept, nothing is left behind."""

import os
import select
import signal
import time

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.lmi.program import run_with_time_limit

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs processes that fork")


def test_answers_larger_than_a_pipe_come_back():
    seed = 3
    found = run_with_time_limit(lambda: np.random.default_rng(seed).standard_normal(300_000), 30.0)
    np.testing.assert_array_equal(found, np.random.default_rng(seed).standard_normal(300_000))


def test_the_call_and_what_it_started_are_ended():
    reader, writer = os.pipe()

    def two_that_sleep():
        os.fork()
        time.sleep(60)

    start = time.monotonic()
    assert run_with_time_limit(two_that_sleep, 0.2) is None
    os.close(writer)
    # Whoever still slept would hold the other end open.
    assert select.select([reader], [], [], 10.0)[0]
    assert os.read(reader, 1) == b""
    os.close(reader)
    assert 0.2 <= time.monotonic() - start < 20


def test_our_own_errors_arrive_and_others_are_no_answer():
    def refuse():
        raise rp.InfeasibleError("No controller stabilises the plant.")

    with pytest.raises(rp.InfeasibleError, match="No controller stabilises"):
        run_with_time_limit(refuse, 30.0)
    assert run_with_time_limit(lambda: 1 / 0, 30.0) is None
    assert run_with_time_limit(lambda: os.kill(os.getpid(), signal.SIGKILL), 30.0) is None


def test_nothing_that_the_call_changes_is_seen_outside():
    seen = []
    assert run_with_time_limit(lambda: seen.append(1) or len(seen), np.inf) == 1
    assert seen == []
