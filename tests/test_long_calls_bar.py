"""Bars appear for people only, and only when they have waited for a while."""

import io
import os
import sys
import time

import nbclient
import nbformat
import pytest

from robustpolish.base import budget as long_calls


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


def test_without_steps_the_time_is_shown(terminal):
    stream = terminal()
    with long_calls.progress_bar("Polishing"):
        time.sleep(0.8)
    assert "Polishing 00:00" in stream.getvalue()


def test_quick_work_shows_nothing(terminal):
    stream = terminal()
    with long_calls.progress_bar("Polishing"):
        pass
    assert stream.getvalue() == ""


def test_only_the_outermost_has_a_bar(terminal):
    stream = terminal()
    with long_calls.progress_bar("Outer"), long_calls.progress_bar("Inner") as tell:
        tell("unheard")
        time.sleep(0.5)
    assert "Inner" not in stream.getvalue()


def test_blocks_inside_are_stages_where_that_is_asked_for(terminal):
    stream = terminal()
    with long_calls.progress_bar("Outer", stages=True) as tell:
        tell("by itself")
        with long_calls.progress_bar("Inner") as tell_inner:
            tell_inner("heard")
            time.sleep(0.8)
        time.sleep(0.6)
    shown = stream.getvalue()
    assert "Inner: heard" in shown
    assert shown.index("Inner: heard") < shown.rindex("by itself")


def test_pipes_stay_silent(monkeypatch):
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(long_calls, "PROGRESS_DELAY", 0.01)
    with long_calls.progress_bar("Polishing"):
        time.sleep(0.2)
    assert stream.getvalue() == ""


def test_an_error_ends_the_bar(terminal):
    stream = terminal()
    with pytest.raises(ArithmeticError), long_calls.progress_bar("Polishing"):
        raise ArithmeticError
    with long_calls.progress_bar("Again"):
        time.sleep(0.5)
    assert "Again" in stream.getvalue()


CELL = """
import time
from robustpolish import long_calls
long_calls.PATIENCE = 0.2
with long_calls.working("Polishing", total=4) as tell:
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
