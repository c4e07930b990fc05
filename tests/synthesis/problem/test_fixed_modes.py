"""Modes that no gain of a structure moves."""

import numpy as np
import pytest
from small_plants import static_plant

from robustpolish.synthesis.problem.preflight import unstable_fixed_modes


def test_fixed_modes_of_full_and_patterned_gains():
    names = ("a", "b", "c")
    seen = static_plant(np.diag([0.5, -1.0, 2.0]), [[1], [1], [1]], [[1.0, 1.0, 0.0]])
    (mode,) = unstable_fixed_modes(seen, np.ones((1, 1), bool), names)
    assert (mode.eigenvalue, mode.state) == (2.0, "c")
    whole = static_plant(np.diag([0.5, -1.0, 2.0]), np.eye(3), np.eye(3))
    assert unstable_fixed_modes(whole, np.eye(3, dtype=bool), names) == ()
    cyclic = np.array([[0, 1, 0], [0, 0, 0], [0, 0, 0]], bool)
    assert [m.state for m in unstable_fixed_modes(whole, cyclic, names)] == ["a", "c"]
    rotor = static_plant([[0.1, 5.0], [-5.0, 0.1]], [[0.0], [0.0]], np.eye(2))
    (mode,) = unstable_fixed_modes(rotor, np.ones((1, 2), bool), ("p", "q"))
    assert mode.eigenvalue == pytest.approx(0.1 + 5j)
