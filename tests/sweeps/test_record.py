"""A sweep whose process is killed goes on from its file, to the same bits."""

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

import robustpolish as rp
from tests.sweeps import functions

GRID = {"a": list(range(60))}


@pytest.mark.long
def test_the_whole_process_killed_and_resumed(tmp_path):
    log, file = tmp_path / "log", tmp_path / "sweep.jsonl"
    script = tmp_path / "run.py"
    script.write_text(
        "from functools import partial\n"
        "import robustpolish as rp\n"
        "from tests.sweeps import functions\n"
        'if __name__ == "__main__":\n'
        f"    slow = partial(functions.slow_draw, log={str(log)!r})\n"
        f'    rp.sweep(slow, {{"a": list(range(60))}}, file={str(file)!r}, seed=3)\n'
    )
    root = Path(__file__).parents[2]
    process = subprocess.Popen(
        [sys.executable, str(script)], env={**os.environ, "PYTHONPATH": str(root)}
    )
    while process.poll() is None and not (file.exists() and file.read_bytes().count(b"\n") > 10):
        time.sleep(0.005)
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    kept = file.read_bytes().count(b"\n") - 1
    assert 10 <= kept < 60
    log.write_bytes(b"")
    slow = partial(functions.slow_draw, log=str(log))
    resumed = rp.sweep(slow, GRID, executor="serial", file=file, seed=3)
    assert len(log.read_bytes()) <= 60 - kept + 8  # the orphans may still end a call
    assert resumed.identical(rp.sweep(slow, GRID, executor="serial", seed=3))


@pytest.fixture
def finished(tmp_path):
    file = tmp_path / "sweep.jsonl"
    return file, rp.sweep(functions.drawn, {"a": [1, 2, 3]}, executor="serial", file=file)


def test_a_torn_last_line_is_done_again(finished):
    file, whole = finished
    content = file.read_bytes()
    for cut in range(0, len(content), 23):
        file.write_bytes(content[:cut])
        again = rp.sweep(functions.drawn, {"a": [1, 2, 3]}, executor="serial", file=file)
        assert again.identical(whole)
        assert file.read_bytes() == content


def test_the_file_of_another_sweep_is_refused(finished):
    file, _ = finished
    before = file.read_bytes()
    for function, a, seed in [
        (functions.drawn, [1, 2, 4], 0),
        (functions.drawn, [1, 2, 3], 1),
        (functions.kills_always, [1, 2, 3], 0),
    ]:
        with pytest.raises(rp.InvalidInputError, match="another function, other points"):
            rp.sweep(function, {"a": a}, executor="serial", file=file, seed=seed)
    assert file.read_bytes() == before


def test_foreign_and_damaged_files_are_left_alone(finished):
    file, _ = finished
    lines = file.read_bytes().splitlines(keepends=True)
    for content, words in [
        (b"a,b\n1,2\n", "something else"),
        (b"notes", "something else"),
        (lines[0] + b"0" + lines[1] + lines[2], "damaged in line 2"),
    ]:
        file.write_bytes(content)
        with pytest.raises(rp.InvalidInputError, match=words):
            rp.sweep(functions.drawn, {"a": [1, 2, 3]}, executor="serial", file=file)
        assert file.read_bytes() == content
