"""What follows from the figures of a loop, and their plain form."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.loops.report import LoopFigures


@pytest.fixture(scope="module")
def two_loops():
    plant = control.append(control.tf([1], [1, 0]), control.tf([1], [1, -1]))
    return rp.loop_analysis(plant, -np.diag([1.0, 3.0]))


def test_the_smallest_margins_lead(two_loops):
    assert isinstance(two_loops, LoopFigures)
    down, up = two_loops.gain_margin
    assert (down, up) == (pytest.approx(1 / 3), np.inf)
    phases = [m.phase_deg for m in two_loops.margins]
    assert two_loops.phase_margin == min(phases)
    assert two_loops.delay_margin == pytest.approx(np.arctan(np.sqrt(8)) / np.sqrt(8))
    assert two_loops.disk_margin.alpha == min(m.disk.alpha for m in two_loops.margins)


def test_the_plain_form_holds_every_table(two_loops):
    content = two_loops.to_dict()
    assert len(content["margins"]) == 4
    assert set(content["at_once"]) == {"inputs", "outputs", "inputs and outputs"}
    assert content["largest_rate"] == two_loops.largest_rate
    assert content["sample_rate"]["needed_hz"] == two_loops.sample_rate.needed_hz
    assert content["requirements"]["disk_gain_db"] == 6.0
    assert {row["source"] for row in content["noise"]} == {"y[0]", "y[1]"}
