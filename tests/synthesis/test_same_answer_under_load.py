"""The same plant has the same controller, bit by bit, on a busy machine and on many threads."""

import json
import os
import subprocess
import sys
from contextlib import contextmanager

import pytest

# Easy ones, and those whose searches used to end with the clock: limits of high gain.
PLANTS = ("AC12", "AC8", "NN7", "UWV", "HE1", "REA1")
BUSY = 14

DESIGN = """
import json, sys
import numpy as np
import robustpolish as rp

data = np.load(sys.argv[1])
answers = {}
for name in sys.argv[2:]:
    keys = ("A", "B1", "B", "C1", "C", "D11", "D12", "D21")
    plant = rp.GeneralizedPlant.from_matrices(*(data[f"{name}/{key}"] for key in keys))
    design = rp.output_feedback(plant)
    K = design.controller
    answers[name] = {
        "status": design.status,
        "achieved": float(design.certificate.achieved).hex(),
        "bound": float(design.certificate.bound).hex(),
        **{key: [x.hex() for x in np.ravel(getattr(K, key)).tolist()] for key in "ABCD"},
    }
print(json.dumps(answers))
"""


def answers(shared, threads=1):
    """Design in a fresh process; numbers are returned to the last bit."""
    limits = {f"{library}_NUM_THREADS": str(threads) for library in ("OMP", "OPENBLAS")}
    data = shared / "data" / "compleib" / "compleib24.npz"
    command = [sys.executable, "-c", DESIGN, str(data), *PLANTS]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env={**os.environ, **limits}
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@contextmanager
def busy_machine(count):
    """Let processes spin, and end them whatever happens."""
    spinning = []
    try:
        for _ in range(count):
            spinning.append(subprocess.Popen([sys.executable, "-c", "while True: pass"]))
        yield
        assert all(process.poll() is None for process in spinning)
    finally:
        for process in spinning:
            process.kill()
        for process in spinning:
            process.wait()


@pytest.mark.slow
@pytest.mark.shared
@pytest.mark.timeout(3600)
def test_fourteen_busy_processes_change_no_bit(shared):
    idle = answers(shared)
    with busy_machine(BUSY):
        busy = answers(shared)
    achieved = {n: [float.fromhex(each[n]["achieved"]) for each in (idle, busy)] for n in PLANTS}
    assert [n for n in PLANTS if idle[n] != busy[n]] == [], achieved


@pytest.mark.slow
@pytest.mark.shared
@pytest.mark.timeout(3600)
def test_any_number_of_threads_gives_the_same_bits(shared):
    one, four = answers(shared), answers(shared, threads=4)
    assert [name for name in PLANTS if one[name] != four[name]] == []
