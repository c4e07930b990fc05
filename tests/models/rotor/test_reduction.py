import numpy as np
import pytest

from robustpolish import InvalidInputError
from robustpolish.machines.rotor.assembly import ShaftSegment
from robustpolish.machines.rotor.rotor import FAST, ISOTROPIC, RotorModel, reduction_basis

PORTS = ISOTROPIC.assembly.ports([0.0, 0.5, 1.5])
SYSTEM = ISOTROPIC.assembly.system


@pytest.mark.parametrize("method", ["modal", "static", "craig_bampton"])
def test_bases_are_independent_and_alike_in_both_planes(method):
    x, y = reduction_basis(SYSTEM, PORTS, 2, method, 0.0)
    assert x.shape == y.shape == (26, 2 if method == "modal" else 5)
    mass = SYSTEM.mass[:26, :26]
    np.testing.assert_allclose(x.T @ mass @ x, np.eye(x.shape[1]), atol=1e-9)


def test_static_and_craig_bampton_bend_as_the_rotor_does_under_forces():
    for method in ("static", "craig_bampton"):
        bases = reduction_basis(SYSTEM, PORTS, 1, method, 0.0)
        own, rows = SYSTEM.projected(*bases), PORTS @ np.kron(np.eye(2), bases[0])
        exact = PORTS @ np.linalg.solve(SYSTEM.stiffness, PORTS.T)
        np.testing.assert_allclose(
            rows @ np.linalg.solve(own.stiffness, rows.T), exact, atol=1e-9 * exact.max()
        )


def test_modes_taken_at_a_speed_hold_both_whirls():
    rested, spun = (reduction_basis(SYSTEM, PORTS, 2, "modal", w)[0] for w in (0.0, FAST))
    assert (rested.shape[1], spun.shape[1]) == (2, 4)


def test_a_free_rotor_has_no_deflections():
    free = RotorModel([ShaftSegment(1.0, 0.05)])
    system, ports = free.assembly.system, free.assembly.ports([0.0])
    with pytest.raises(InvalidInputError, match="method='modal'"):
        reduction_basis(system, ports, 2, "static", 0.0)
    assert reduction_basis(system, ports, 3, "modal", 0.0)[0].shape[1] == 3
