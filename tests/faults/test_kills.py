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
from tests.faults.jobs import Job
from tests.faults.kills import Scene, Tally, kill, try_fault

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


def seen(monkeypatch, job, fault):
    """Return what is complained about after one fault."""
    monkeypatch.setattr(kills, "jobs", lambda: {"job": job})
    tally = Tally()
    new = b"one half and the other" if job.write is in_halves else b"new"
    whole: dict[str, object] = {"a.txt": new}
    assert try_fault(Scene("job", True, True), fault, whole, tally).killed
    return tally.complaints


def test_the_injector_sees_halves_and_leftovers(monkeypatch):
    (half,) = seen(monkeypatch, Job(in_halves, ("a.txt",)), Fault("kill", 2))
    assert "neither old nor new" in half
    left = seen(monkeypatch, Job(leaving, ("a.txt",)), Fault("kill", 5))
    assert any("is left" in text for text in left)
    assert seen(monkeypatch, Job(single_file, ("a.txt",)), Fault("kill", 5)) == []


def test_the_injector_sees_who_lives_on(monkeypatch):
    monkeypatch.setattr(kills, "GRACE", 0.1)
    # The worker's own watch is taken away.
    monkeypatch.setattr(
        "robustpolish.synthesis.backends.parent_watch.exit_with_parent", lambda *_: None
    )
    job = Job(lambda at, force: run_with_time_limit(lambda: time.sleep(2), 9.0), ())
    assert "live on" in seen(monkeypatch, job, Fault("time", 1000))[0]


def test_thirty_kills_of_a_folder_and_a_file(monkeypatch):
    jobs = {"folder": Job(folder_of_two, ("results",)), "file": Job(single_file, ("a.txt",))}
    monkeypatch.setattr(kills, "jobs", lambda: jobs)
    tally = kill(30, seed=1)
    assert tally.complaints == []
    assert set(tally.kills) == {"folder", "file"}
    assert tally.refusals > 0  # no permission, no space


@pytest.mark.long
def test_kills_of_everything_that_writes():
    tally = kill(100, seed=2)
    assert tally.complaints == []
    assert len(tally.kills) == len(kills.jobs())
