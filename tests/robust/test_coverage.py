"""Levels that are proven over intervals of frequency."""

import numpy as np
import pytest

from robustpolish.robust.coverage import (
    POLICY,
    cover,
    response,
)
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.scalings import Space
from tests.robust.loops import covers, servo


def test_level_is_that_of_the_worst_frequency():
    loop = LoopModel.of(servo())
    found = cover(loop, Space(loop.structure, (False, False)), 0.0, loop.seeds())
    assert found.complete
    assert covers(found.intervals)
    worst = found.peaks[0][1]
    assert worst <= found.level <= worst * (1 + 2 * POLICY.slack)


def test_response():
    model = LoopModel.of(servo()).model
    np.testing.assert_allclose(response(model, np.inf), model.D)
    at = model.D + model.C @ np.linalg.solve(2j * np.eye(model.states) - model.A, model.B)
    assert response(model, 2.0) == pytest.approx(at)
