"""Coulomb's cone: its angle, what it holds, where sliding pushes."""

from math import atan

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.polishing.thesis.contact_study import FrictionCone


def test_the_angle_of_friction():
    assert FrictionCone(0.25 * np.sqrt(2)).angle == pytest.approx(atan(0.3535534))
    assert FrictionCone(0.0).angle == 0.0


def test_it_holds_what_pushes_within_the_angle_whatever_the_frame():
    cone = FrictionCone(0.5)
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    normal = turn @ [0.0, 0.0, 2.0]
    for force, held in ([0.3, 0.39, 1.0], True), ([0.3, 0.41, 1.0], False), ([0, 0, -1.0], False):
        assert cone.holds(turn @ force, normal) is held


def test_sliding_lies_on_the_edge_and_takes_power():
    cone, slip = FrictionCone(0.35), np.array([1.0, -2.0, 5.0])
    normal = np.array([0.1, 0.2, 1.0])
    force = cone.sliding(10.0, slip, normal)
    unit = normal / np.linalg.norm(normal)
    assert np.arccos(force @ unit / np.linalg.norm(force)) == pytest.approx(cone.angle)
    assert force @ unit == pytest.approx(10.0)
    assert force @ (slip - (slip @ unit) * unit) < 0.0


def test_bad_arguments_are_named():
    with pytest.raises(InvalidInputError, match=r"FrictionCone\.friction"):
        FrictionCone(-0.1)
    with pytest.raises(InvalidInputError, match="slip"):
        FrictionCone(0.1).sliding(1.0, [0, 0, 2.0], [0, 0, 1])
    with pytest.raises(InvalidInputError, match="normal"):
        FrictionCone(0.1).holds([0, 0, 1], [0, 0, 0])
