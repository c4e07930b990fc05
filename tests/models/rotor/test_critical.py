import numpy as np
import pytest

from robustpolish import InvalidInputError
from robustpolish.machines.rotor.assembly import ShaftSegment
from robustpolish.machines.rotor.modes import critical_speeds
from robustpolish.machines.rotor.rotor import ANISOTROPIC, ISOTROPIC, RotorModel


def test_an_unbalance_has_no_bounded_answer_there():
    system = ISOTROPIC.assembly.system
    for speed in critical_speeds(system)[:2]:
        dynamic = system.stiffness - speed**2 * (system.mass - 1j * system.gyroscopic)
        values = np.abs(np.linalg.eigvals(np.linalg.solve(system.stiffness, dynamic)))
        assert values.min() < 1e-9


def test_uneven_bearings_let_an_unbalance_meet_both_whirls():
    even, uneven = (critical_speeds(r.assembly.system) for r in (ISOTROPIC, ANISOTROPIC))
    assert len(uneven[uneven < 350]) == 2 * len(even[even < 350])


def test_a_free_rotor_has_none():
    with pytest.raises(InvalidInputError, match="nothing holds"):
        critical_speeds(RotorModel([ShaftSegment(1.0, 0.05)]).assembly.system)
