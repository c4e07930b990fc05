import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import robustpolish as rp

C = rp.uncertain.real("c", 0.4, percent=25)


def mass(c=C, names=("spring",)):
    """A mass of 1 kg on a spring of 1 N/m."""
    n = len(names)
    return rp.uncertain.system(
        [[0, 1], [-1, -c]], np.vstack([np.zeros(n), np.ones(n)]), np.tile([1.0, 0.0], (n, 1)),
        inputs=list(names), outputs=list(names),
    )  # fmt: skip


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.5), (-0.2, 0.1), (1.0, 3.0)])
def test_criterion_is_that_of_the_circle(low, high):
    found = rp.robust_sector(mass(), {"spring": (low, high)})
    # The least damping is worst: 1 / |k - w^2 + jcw| is largest at 1 / (c sqrt(k - c^2 / 4)).
    c, k, half = 0.3, 1 + (low + high) / 2, (high - low) / 2
    width = c * np.sqrt(k - c**2 / 4) / half
    assert found.lower <= width <= found.upper * (1 + 1e-9)
    assert found.upper / found.lower < 1.002
    assert found.witness["c"] == pytest.approx(0.3)
    assert found.stable is (True if found.lower >= 1 else None)
    assert found.proven


def test_spring_that_pumps_is_not_called_stable():
    """A spring that is stiffer on the way back drives a mass with little damping."""
    weak = rp.uncertain.real("c", 0.04, percent=25)
    sector = (0.0, 0.5)
    assert rp.robust_sector(mass(weak), {"spring": sector}).stable is None
    # With each constant spring of the sector every machine is stable: a real number would not do.
    constant = rp.uncertain.real("k", 0.25, range=sector)
    assert rp.robust_stability(mass(weak).feedback(constant)).robust
    assert np.abs(pumped(sector, 0.04)[-500:]).max() > 10


def pumped(sector, damping):
    """The motion of a mass from 1 m with the spring that helps it most."""

    def rate(t, s):
        stiffness = 1 + (sector[0] if s[0] * s[1] > 0 else sector[1])
        return [s[1], -stiffness * s[0] - damping * s[1]]

    return solve_ivp(rate, (0, 80), [1.0, 0.0], max_step=0.02).y[0]


def test_forces_within_a_proven_sector_die_out():
    sector = (0.0, 0.35)
    assert rp.robust_sector(mass(), {"spring": sector}).stable
    assert np.abs(pumped(sector, 0.3)[-100:]).max() < 0.05


def test_several_forces_are_weighed_by_constants():
    # Two forces at two masses of which one is a thousand times as stiff: units have no say.
    A = np.array([[0, 1, 0, 0], [-1, -0.4, 0, 0], [0, 0, 0, 1], [0.2, 0, -4, -0.8]])
    B = np.array([[0, 0], [1, 0], [0, 0], [0, 1e3]])
    plant = control.ss(A, B, [[1, 0, 0, 0], [0, 0, 1e-3, 0]], 0)
    gain = rp.uncertain.real("g", 1.0, percent=10)
    plant = rp.uncertain.UncertainSystem((plant * gain).matrices.names(["a", "b"], ["a", "b"]))
    found = rp.robust_sector(plant, {"a": (0.0, 0.3), "b": (0.0, 1.0)})
    alone = [rp.robust_sector(plant, {n: s}).lower for n, s in found.sectors.items()]
    # They act one way only: weighed well, both together bear nearly what each one bears.
    assert 0.9 * min(alone) < found.lower <= min(alone) * 1.01
    assert found.stable


def test_machine_that_is_unstable_bears_nothing():
    found = rp.robust_sector(mass(rp.uncertain.real("c", 0.1, range=(-0.1, 0.3))),
                             {"spring": (0.0, 0.1)})  # fmt: skip
    assert (found.lower, found.stable) == (0.0, None)
    assert "undecided" in str(found)


@pytest.mark.parametrize(
    ("sectors", "says"),
    [
        ({"damper": (0.0, 1.0)}, "names of both"),
        ({"spring": (1.0, 0.0)}, "smaller first"),
        ({"spring": 3.0}, "smaller first"),
        ({}, "mapping"),
        ([("spring", 0, 1)], "mapping"),
    ],
)
def test_bad_sectors(sectors, says):
    with pytest.raises(rp.InvalidInputError, match=says):
        rp.robust_sector(mass(), sectors)
