"""Some hundred damaged files; the rest is for `make fuzz`."""

import os
import signal

import pytest

from tests.fuzz import files
from tests.fuzz.files_corpus import corpus

CORPUS = corpus()


@pytest.mark.parametrize("name", CORPUS)
def test_each_kind_is_read(name, tmp_path):
    assert files.outcome(name, CORPUS[name], tmp_path) == "read"


def test_damaged_files_end_in_a_result_or_an_error_of_the_package():
    report = files.run(20261123, range(300), CORPUS)
    assert report.crashes == []
    assert report.count == 300
    assert report.read.total() > 20
    assert report.refused.total() > 150


def test_a_case_is_the_same_every_time():
    first, second = (files.case_of(7, 3, CORPUS) for _ in range(2))
    assert first == second
    assert first != files.case_of(8, 3, CORPUS)


def test_deaths_and_delays_are_found(monkeypatch):
    """A process that dies, and one that computes for ever, are crashes; the rest goes on."""

    def read(path):
        if path.read_bytes() == b"die":
            os.kill(os.getpid(), signal.SIGKILL)
        while path.read_bytes() == b"spin":
            pass

    cases = {1: b"die", 2: b"spin"}
    monkeypatch.setattr(files, "case_of", lambda _, i, __: ("load/a.json", cases.get(i, b"good")))
    monkeypatch.setitem(files.READERS, "load", read)
    monkeypatch.setattr(files, "SECONDS", 0.2)
    report = files.run(1, range(5), CORPUS)
    (died, _, death), (spun, _, delay) = report.crashes
    assert (died, spun, report.read.total()) == (1, 2, 3)
    assert "ended with status 9" in death
    assert "TooLongError" in delay
