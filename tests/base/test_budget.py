"""Work is counted, time is limited, threads round alike, and bars appear for people only."""

import io
import math
import os
import subprocess
import sys
import threading
import time

import nbclient
import nbformat
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import robustpolish as rp
from robustpolish.base import budget as long_calls
from robustpolish.base.budget import (
    Budget,
    DeadlineError,
    check_deadline,
    enforce_deadline,
    parallel_map,
    partial_deadline,
    paused_clock,
    single_threaded_blas,
)
from tests.busy import output_of


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


def test_a_design_has_the_same_bits_on_one_and_two_threads():
    one = output_of(DESIGN)
    assert len(one.strip()) == 64
    assert output_of(DESIGN, threads=2) == one


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


def test_several_threads_run_at_a_time_and_answers_keep_their_order(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    both = threading.Barrier(2)

    def waits(item):
        both.wait(timeout=30)  # one alone would wait in vain
        return 10 * item

    assert parallel_map(waits, iter([3, 1, 2, 4])) == [30, 10, 20, 40]
    assert parallel_map(waits, []) == []


@pytest.fixture
def clock(monkeypatch):
    """Return a clock that stands still until it is set."""
    shown = [100.0]
    for name in ("monotonic", "process_time"):
        monkeypatch.setattr(time, name, lambda: shown[0])
    long_calls.now()
    return shown


def test_the_time_is_over_half_a_second_after_the_limit(clock):
    with (
        pytest.raises(rp.SolverError, match=r"time limit of 10 s .* Raise time_limit"),
        enforce_deadline(Budget(seconds=10.0)),
    ):
        clock[0] += 10.0 + long_calls.GRACE
        check_deadline()
        clock[0] += 0.01
        check_deadline()
    check_deadline()  # outside nothing is cut


def test_a_call_inside_does_not_outlive_the_one_around_it(clock):
    with enforce_deadline(Budget(seconds=1.0)), enforce_deadline(Budget(seconds=50.0)):
        clock[0] += 2.0
        with pytest.raises(DeadlineError):
            check_deadline()


def test_a_part_of_the_time_leaves_the_rest(clock):
    with enforce_deadline(Budget(seconds=9.5)):
        clock[0] += 4.0
        with partial_deadline(0.5):
            check_deadline(needed=2.9)
            with pytest.raises(DeadlineError):
                check_deadline(needed=3.1)
        check_deadline(needed=5.9)
    with partial_deadline(0.5):
        check_deadline(needed=1e9)


def test_a_search_stops_before_the_time_of_its_proof(clock):
    budget = Budget.with_certificate_reserve(100.0, 8.0)
    share = budget.share(0.5)
    assert (budget.kept, share.seconds_left) == (2.0, 6.0)
    clock[0] += 5.9
    assert not share.late
    clock[0] += 0.2
    assert share.late
    assert budget.was_late
    assert Budget.with_certificate_reserve(1.0, 300.0).kept == 5.0


def test_compiling_takes_no_time_of_a_limit(clock):
    with enforce_deadline(Budget(seconds=1.0)):
        with paused_clock():
            clock[0] += 20.0
            check_deadline(needed=1.4)
        check_deadline(needed=1.4)
        clock[0] += 1.6
        with pytest.raises(DeadlineError):
            check_deadline()


def test_without_a_complete_certificate_there_is_no_design(monkeypatch):
    plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    monkeypatch.setattr(long_calls, "GRACE", -100.0)
    calls = (
        lambda: rp.output_feedback(plant, time_limit=60.0),
        lambda: rp.state_feedback(plant, time_limit=60.0),
        lambda: rp.static_output_feedback(plant, time_limit=60.0),
    )
    for call in calls:
        with pytest.raises(rp.SolverError, match="time"):
            call()


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def terminal(monkeypatch):
    def open_terminal():
        # Not before the test runs: between fixture and test pytest sets stderr anew.
        stream = Terminal()
        monkeypatch.setattr(sys, "stderr", stream)
        monkeypatch.setattr(long_calls, "PROGRESS_DELAY", 0.05)
        return stream

    return open_terminal


def test_a_bar_appears_after_a_while_and_leaves_no_trace(terminal):
    stream = terminal()
    with long_calls.progress_bar("Polishing", total=4) as tell:
        for i in range(3):
            tell(f"place {i}")
        time.sleep(0.8)
    shown = stream.getvalue()
    assert "Polishing" in shown
    assert "2/4" in shown
    assert "place 2" in shown
    assert shown.endswith("\r")


def test_pipes_stay_silent(monkeypatch):
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(long_calls, "PROGRESS_DELAY", 0.01)
    with long_calls.progress_bar("Polishing"):
        time.sleep(0.2)
    assert stream.getvalue() == ""


CELL = """
import time
from robustpolish.base import budget
budget.PROGRESS_DELAY = 0.2
with budget.progress_bar("Polishing", total=4) as tell:
    for place in range(3):
        tell(f"place {place}")
        time.sleep(0.6)
"""


class Client(nbclient.NotebookClient):
    """Remembers what was shown meanwhile."""

    def process_message(self, msg, cell, cell_index):
        data = msg["content"].get("data", {})
        self.shown = [*getattr(self, "shown", []), data.get("text/plain", "")]
        return super().process_message(msg, cell, cell_index)


def test_a_bar_in_a_notebook_leaves_no_red_strip(monkeypatch):
    monkeypatch.delenv("TQDM_DISABLE", raising=False)
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(CELL)])
    client = Client(notebook, kernel_name="python3")
    client.execute()
    assert any("Polishing" in text and "place 2" in text for text in client.shown)
    (output,) = notebook.cells[0].outputs
    assert output.output_type == "display_data"  # not standard error, which is shown in red
    assert set(output.data.values()) == {""}


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="terminals of POSIX")
def test_a_terminal_without_a_size_shows_a_bar(monkeypatch):
    """A new pseudo-terminal has no rows and columns until somebody says how many."""
    ours, theirs = os.openpty()
    os.set_blocking(ours, False)
    monkeypatch.setattr(long_calls, "PROGRESS_DELAY", 0.05)
    monkeypatch.delenv("TQDM_DISABLE", raising=False)
    with open(theirs, "w", encoding="utf-8") as stream:
        assert os.get_terminal_size(stream.fileno()).columns == 0
        monkeypatch.setattr(sys, "stderr", stream)
        with long_calls.progress_bar("Waiting", total=3) as tell:
            tell("")
            time.sleep(0.8)
        shown = os.read(ours, 10_000).decode()
    os.close(ours)
    assert "Waiting" in shown


def test_limits_do_not_count_what_others_do_with_the_processor():
    budget = Budget(seconds=0.2)
    time.sleep(0.3)
    assert not budget.late
    ends = time.process_time() + 0.25
    while time.process_time() < ends:
        pass
    assert budget.late


def test_limits_count_what_children_do():
    budget = Budget(seconds=0.2)
    subprocess.run([sys.executable, "-c", "sum(range(5 * 10**7))"], check=True)
    assert budget.late
