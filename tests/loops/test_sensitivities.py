"""S, T, KS and GS at both break points."""

import numpy as np
import pytest

from robustpolish.loops.loop import loop_of
from robustpolish.loops.performance import from_to, sensitivities
from tests.loops.loops_for_tests import random_loop


def test_they_fit_together():
    plant, controller = random_loop(1)
    loop = loop_of(plant, controller)
    G, K = (np.asarray(system(2j)) for system in (plant, controller))
    for place, L in (("input", -K @ G), ("output", -G @ K)):
        at = sensitivities(loop, place)
        S = np.linalg.inv(np.eye(2) + L)
        np.testing.assert_allclose(at.L(2j), L, rtol=1e-9)
        np.testing.assert_allclose(at.S(2j), S, rtol=1e-8)
        np.testing.assert_allclose(at.T(2j), L @ S, rtol=1e-8)
        np.testing.assert_allclose(at.KS(2j), K @ np.linalg.inv(np.eye(2) - G @ K), rtol=1e-8)
        np.testing.assert_allclose(at.GS(2j), G @ np.linalg.inv(np.eye(2) - K @ G), rtol=1e-8)
        assert at.KS.input_labels == list(loop.names("output"))
        assert at.KS.output_labels == list(loop.names("input"))
        peak = at.peaks["S"]
        gains = [np.linalg.norm(at.S(1j * w), 2) for w in np.geomspace(0.01, 100, 200)]
        assert max(gains) <= peak.upper
        assert peak.value == pytest.approx(max(gains), rel=0.01)


def test_a_part_of_a_system():
    plant, _ = random_loop(2)
    part = from_to(plant, [1], [0])
    assert np.asarray(part(1j)).item() == pytest.approx(np.asarray(plant(1j))[0, 1])
    assert (part.input_labels, part.output_labels) == (["u[1]"], ["y[0]"])
