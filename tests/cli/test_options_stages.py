"""A bar for people at a terminal, lines for everything else, and an end at once on Ctrl-C."""

import os
import pty
import signal
import subprocess
import sys
import termios
import time

from robustpolish.app.cli.options import stages
from tests.cli.command_line import run

DRIVER = """
import time
from robustpolish import long_calls
from robustpolish.cli.options import stages
long_calls.PATIENCE = 0.05
with stages("Designing") as tell:
    tell("Certifying the loop ...")
    print("ready", flush=True)
    time.sleep({seconds})
"""


def _on_a_terminal(seconds):
    """Start a command whose standard error is a terminal; return it and the terminal."""
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 100))  # a new one has no columns, and so shows nothing
    process = subprocess.Popen(
        [sys.executable, "-c", DRIVER.format(seconds=seconds)],
        stdout=subprocess.PIPE,
        stderr=theirs,
        # whoever starts the tests in the background has them ignore the signal
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    os.close(theirs)
    assert process.stdout is not None
    assert process.stdout.readline() == b"ready\n"
    return process, ours


def _read(terminal):
    shown = b""
    try:
        while part := os.read(terminal, 4096):
            shown += part
    except OSError:  # what Linux says when the other end is closed
        pass
    os.close(terminal)
    return shown.decode()


def test_a_terminal_shows_the_stage_in_a_bar_that_goes_away():
    process, terminal = _on_a_terminal(seconds=0.8)
    out, _ = process.communicate()
    shown = _read(terminal)
    assert "Designing 00:0" in shown
    assert "Certifying the loop" in shown
    assert "\n" not in shown
    assert out == b""


def test_ctrl_c_ends_a_command_at_once():
    process, terminal = _on_a_terminal(seconds=60)
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=30)
    assert "KeyboardInterrupt" in _read(terminal)
    assert process.returncode == -signal.SIGINT


def test_elsewhere_each_stage_is_a_line(capsys):
    with stages("Designing") as tell:
        tell("Certifying the loop ...")
        tell("writing the report")
    assert capsys.readouterr().err == "Certifying the loop ...\n... writing the report\n"


def test_a_command_in_a_pipe_draws_no_bar():
    told = run("brush", "--duration", "0.02").stderr
    assert told == "Simulating 0.02 s of run 1 (physical) ...\n"
