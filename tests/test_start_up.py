"""The package starts quickly: names are imported when they are asked for, and Ctrl-C ends it."""

import os
import signal
import subprocess
import sys
import time

import pytest

import robustpolish as rp
from tests.busy import output_of

HEAVY = {"numpy", "scipy", "control", "cvxpy", "matplotlib", "xarray", "pandas", "numba"}


def loaded_by(program):
    """Return the top-level packages that a program has imported at its end."""
    end = "import sys; print(' '.join({name.partition('.')[0] for name in sys.modules}))"
    return set(output_of(f"{program}\n{end}").splitlines()[-1].split())


def test_import_loads_nothing_heavy():
    found = loaded_by("import robustpolish as rp; rp.__version__; rp.__all__; dir(rp)")
    assert "robustpolish" in found
    assert not found & HEAVY


def test_the_command_loads_nothing_heavy():
    found = loaded_by(
        "from robustpolish.app.cli.main import main; main(['--help'], standalone_mode=False)"
    )
    assert "click" in found
    assert not found & HEAVY


def test_a_name_loads_what_it_needs_and_no_more():
    found = loaded_by("import robustpolish as rp; rp.results.HinfNorm")
    assert "control" in found
    assert not found & {"cvxpy", "numba"}


def test_every_name_is_there():
    assert len(set(rp.__all__)) > 60
    assert set(rp.__all__) <= set(dir(rp))
    for name in rp.__all__:
        assert getattr(rp, name) is not None
    with pytest.raises(AttributeError, match="no_such_name"):
        rp.no_such_name  # noqa: B018


@pytest.mark.parametrize("seconds", [0.3, 1.5])
def test_ctrl_c_ends_without_a_traceback(seconds):
    process = subprocess.Popen(
        [sys.executable, "-m", "robustpolish", "brush"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        # whoever starts the tests in the background has them ignore the signal
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    time.sleep(seconds)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: the whole group
    _, said = process.communicate(timeout=60)
    assert process.returncode != 0
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("raised", "is_told"), [("KeyboardInterrupt", False), ("ValueError", True)]
)
def test_ctrl_c_while_a_class_is_made_ends_without_a_traceback(raised, is_told):
    """Up to Python 3.11 it arrives as the cause of a RuntimeError; other errors are told."""
    program = (
        "import robustpolish.__main__ as command, robustpolish.app.cli.main as cli\n"
        "class Named:\n"
        f"    def __set_name__(self, owner, name): raise {raised}\n"
        "cli.main = lambda prog_name: type('Made', (), {'named': Named()})\n"
        "command.run()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], check=False, capture_output=True, text=True
    )
    assert done.returncode == 1
    assert ("Traceback" in done.stderr) == is_told


@pytest.mark.parametrize(("option", "code"), [("--version", 0), ("--nonsense", 2)])
def test_the_end_is_short_and_leaves_nothing_undone(option, code):
    """Modules are not taken apart, but what was to be done at the end is, and the code is right."""
    program = (
        "import atexit, sys, robustpolish.__main__ as command\n"
        "class Kept:\n"
        "    def __del__(self): print('taken apart')\n"
        "kept = Kept()\n"
        "sys.argv = ['robustpolish', sys.argv[1]]\n"
        "try: command.run()\n"
        "finally: atexit.register(print, 'done at the end')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, option], check=False, capture_output=True, text=True
    )
    assert done.returncode == code
    assert done.stdout.splitlines()[-1] == "done at the end"
