"""Structured designs are budgeted in work: a busy machine changes no bit of them."""

import json
from pathlib import Path

import pytest

from tests.busy import busy_machine, output_of

BUSY = 14
DESIGN = """
import json, sys
sys.path.insert(0, sys.argv[1])
import numpy as np
from small_plants import FULL, regular_plant, two_masses
import robustpolish as rp

answers = {}
for name, design in {
    "static": rp.static_output_feedback(two_masses(FULL)),
    "observer": rp.observer_feedback(regular_plant()),
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
    """Return what the designs say; numbers are written to the last bit."""
    return json.loads(output_of(DESIGN, str(Path(__file__).parents[1])))


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_busy_processes_change_no_bit():
    idle = answers()
    with busy_machine(BUSY):
        busy = answers()
    assert idle == busy
    assert "time" not in idle["static"]["message"] + idle["observer"]["message"]
