import math
from dataclasses import replace

import control
import numpy as np
import pytest

from robustpolish.robust.bounds import bounds
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.questions import (
    bound_status,
    nominal_status,
    physical_witness,
    round_down,
    round_up,
    status_sentence,
)
from tests.robust.loops import damper


def test_witness_in_the_units_of_the_system():
    system = damper()
    loop = LoopModel.of(system)
    found = bounds(loop)
    at = physical_witness(system, loop, found.witness)
    assert at.size == pytest.approx(1)
    assert at.values["c"] == pytest.approx(0, abs=1e-9)
    assert at.frequency == pytest.approx(1)
    assert bound_status(found, 1e-2) == "bracketed"
    assert (
        bound_status(replace(found, coverage=replace(found.coverage, complete=False)), 1.0)
        == "incomplete"
    )


def test_without_a_witness():
    at = physical_witness(damper(), LoopModel.of(damper()), None)
    assert (at.size, at.values) == (math.inf, {})
    assert math.isnan(at.frequency)


@pytest.mark.parametrize(("pole", "status"), [(-1, "stable"), (0, "marginal"), (1, "unstable")])
def test_nominal_status(pole, status):
    assert nominal_status(control.ss([[float(pole)]], [[1.0]], [[1.0]], 0)) == status


def test_without_states_it_is_stable():
    assert nominal_status(control.ss([], [], [], [[1.0]])) == "stable"
    assert "nominal" in status_sentence("unstable")


def test_rounding():
    value = 1 / 3
    assert (
        round_down(value)
        < np.nextafter(value, 0)
        < value
        < np.nextafter(value, 1)
        < round_up(value)
    )
