"""Workers end within two seconds of the process that started them, however that was ended."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from robustpolish.synthesis.backends import parent_watch

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
HARD_PLANTS = Path(__file__).parents[1]
SLEEPER = """
import time
from robustpolish.synthesis.lmi.program import run_with_time_limit
run_with_time_limit(lambda: time.sleep(60), 60.0)
"""
PIPE_ALONE = (
    """
import time
from robustpolish.synthesis.backends import parent_watch
from robustpolish.synthesis.lmi.program import run_with_time_limit
parent_watch.sys.platform = "anything else"
"""
    + SLEEPER
)
OUTPUT_FEEDBACK = """
import sys
sys.path.insert(0, sys.argv[1])
from hard_plants import flexible_structure
import robustpolish as rp
rp.output_feedback(flexible_structure(20), method=sys.argv[2], time_limit=300)
"""


def children(process):
    """Return the live children of a process, zombies left out."""
    found = []
    for each in Path("/proc").iterdir():
        if each.name.isdigit() and alive(int(each.name), of=process):
            found.append(int(each.name))
    return found


def alive(process, of=None):
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return fields[0] not in "ZX" and of in (None, int(fields[1]))


def orphans_after(ending, *command):
    """Start a program, end it when it has a worker, and return what still lives after 2 s."""
    parent = subprocess.Popen([sys.executable, "-c", *command], stderr=subprocess.DEVNULL)
    try:
        until = time.monotonic() + 60
        while not (workers := children(parent.pid)) and time.monotonic() < until:
            time.sleep(0.02)
        assert workers, "it has started none"
        time.sleep(0.3)  # the worker is at work
        workers = children(parent.pid) or workers
        parent.send_signal(ending)
        parent.wait(timeout=10)
        until = time.monotonic() + 2
        while any(map(alive, workers)) and time.monotonic() < until:
            time.sleep(0.02)
        return [each for each in workers if alive(each)]
    finally:
        parent.kill()
        parent.wait()


@pytest.mark.parametrize(
    ("program", "ending"), [(SLEEPER, signal.SIGKILL), (PIPE_ALONE, signal.SIGTERM)]
)
def test_a_forked_worker_ends_with_its_parent(program, ending):
    assert orphans_after(ending, program) == []


@pytest.mark.long
@pytest.mark.parametrize("ending", [signal.SIGTERM, signal.SIGKILL])
@pytest.mark.parametrize("method", ["lmi", "slycot"])
def test_the_workers_of_a_design_end_with_it(method, ending):
    if method == "slycot":
        pytest.importorskip("slycot")
    assert orphans_after(ending, OUTPUT_FEEDBACK, str(HARD_PLANTS), method) == []


def test_a_parent_that_is_gone_before_the_watch_begins_is_noticed():
    reader, _writer = os.pipe()
    child = os.fork()
    if child == 0:
        parent_watch.exit_with_parent(1 << 30, reader)
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 1
