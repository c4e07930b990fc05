"""What is being proven is cut when the time of its call is over, and at no other time."""

import threading
import time

import pytest

import robustpolish as rp
from robustpolish.base import budget as deadline
from robustpolish.base.budget import (
    Budget,
    DeadlineError,
    check_deadline,
    enforce_deadline,
    partial_deadline,
    paused_clock,
)


@pytest.fixture
def clock(monkeypatch):
    """Return a clock that stands still until it is set."""
    shown = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: shown[0])
    return shown


def test_the_time_is_over_half_a_second_after_the_limit(clock):
    with (
        pytest.raises(rp.SolverError, match=r"time limit of 10 s .* Raise time_limit"),
        enforce_deadline(Budget(seconds=10.0)),
    ):
        clock[0] += 10.0 + deadline.GRACE
        check_deadline()
        clock[0] += 0.01
        check_deadline()
    check_deadline()  # outside nothing is cut


def test_what_takes_longer_than_is_left_is_not_begun(clock):
    with enforce_deadline(Budget(seconds=10.0)):
        check_deadline(needed=10.0)
        with pytest.raises(DeadlineError):
            check_deadline(needed=11.0)


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


def test_other_threads_keep_their_own_time(clock):
    seen = []

    def elsewhere():
        check_deadline()
        seen.append("not cut")

    with enforce_deadline(Budget(seconds=1.0)):
        clock[0] += 5.0
        thread = threading.Thread(target=elsewhere)
        thread.start()
        thread.join()
    assert seen == ["not cut"]


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
    monkeypatch.setattr(deadline, "GRACE", -100.0)
    calls = (
        lambda: rp.output_feedback(plant, time_limit=60.0),
        lambda: rp.state_feedback(plant, time_limit=60.0),
        lambda: rp.static_output_feedback(plant, time_limit=60.0),
    )
    for call in calls:
        with pytest.raises(rp.SolverError, match="time"):
            call()
