"""Kills and other faults wherever results are written: the old or the new result is whole."""

import shutil
import sys
import tempfile
import time

import pytest

from robustpolish.base.atomic_writes import new_file, new_folder
from robustpolish.synthesis.lmi.program import run_with_time_limit
from tests.faults import kills
from tests.faults.injector import Fault
from tests.faults.kills import Job, Tally, kill, try_fault

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks and reads /proc")


def folder_of_two(at, force):
    with new_folder(at / "results", force) as draft:
        (draft / "design.json").write_text("new")
        (draft / "b.txt").write_text("new")


def single_file(at, force):
    with new_file(at / "a.txt", force) as draft:
        draft.write_text("new")


def in_halves(at, force):
    """Write a result as it should not be written."""
    (at / "a.txt").write_text("one half")
    (at / "a.txt").write_text("one half and the other")


def leaving(at, force):
    """Leave a folder behind when it is ended."""
    beside = tempfile.mkdtemp(dir=at)
    single_file(at, force)
    shutil.rmtree(beside)


def seen(job, fault, new=b"new"):
    """Return what is complained about after one fault."""
    tally = Tally()
    assert try_fault(job, True, fault, {"a.txt": new}, tally).killed
    return tally.complaints


def test_the_injector_sees_halves_and_leftovers():
    (half,) = seen(Job(in_halves, "a.txt"), Fault("kill", 2), b"one half and the other")
    assert "neither old nor new" in half
    left = seen(Job(leaving, "a.txt"), Fault("kill", 5))
    assert any("the next run leaves" in text for text in left)
    assert seen(Job(single_file, "a.txt"), Fault("kill", 5)) == []


def test_no_worker_outlives_a_killed_process(monkeypatch):
    job = Job(lambda at, force: run_with_time_limit(lambda: time.sleep(9), 9.0), "a.txt", False)
    assert seen(job, Fault("time", 1000)) == []
    monkeypatch.setattr(kills, "GRACE", 0.1)
    # The worker's own watch is taken away.
    monkeypatch.setattr("robustpolish.synthesis.lmi.program.exit_with_parent", lambda *_: None)
    job = Job(lambda at, force: run_with_time_limit(lambda: time.sleep(2), 9.0), "a.txt", False)
    assert "live on" in seen(job, Fault("time", 1000))[0]


@pytest.mark.parametrize("count", [12, 300])
def test_kills_of_a_folder_and_a_file(count):
    tally = kill([Job(folder_of_two, "results"), Job(single_file, "a.txt")], count)
    assert tally.complaints == []
    assert set(tally.kills) == {"results", "a.txt"}
    assert tally.refusals > 0  # no permission, no space
