"""Structured designs are budgeted in work: a busy machine changes no bit of them."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

BUSY = 8

DESIGN = """
import json, sys
sys.path.insert(0, sys.argv[1])
import numpy as np
from small_plants import FULL, regular_plant, two_masses
import robustpolish as rp

answers = {}
for name, design in {
    "static": rp.static_output_feedback(two_masses(FULL), time_limit=3600.0),
    "observer": rp.observer_feedback(regular_plant(), time_limit=3600.0),
}.items():
    K = design.controller
    answers[name] = {
        "status": design.status,
        "message": design.message,
        "achieved": float(design.certificate.achieved).hex(),
        **{key: [x.hex() for x in np.ravel(getattr(K, key)).tolist()] for key in "ABCD"},
    }
print(json.dumps(answers))
"""


def answers():
    """Design in a fresh process; numbers are returned to the last bit."""
    one = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS")}
    plants = str(Path(__file__).parents[1])
    done = subprocess.run(
        [sys.executable, "-c", DESIGN, plants],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **one},
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_busy_processes_change_no_bit():
    idle = answers()
    spinning = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(BUSY)]
    try:
        busy = answers()
        assert all(process.poll() is None for process in spinning)
    finally:
        for process in spinning:
            process.kill()
        for process in spinning:
            process.wait()
    assert idle == busy
    assert "time" not in idle["static"]["message"] + idle["observer"]["message"]
