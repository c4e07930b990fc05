import math

import numpy as np
import pytest

from robustpolish import InvalidInputError
from robustpolish.machines.rotor.assembly import RotorBearing, RotorDisc, ShaftSegment


def test_a_hollow_section():
    tube = ShaftSegment(1.0, 0.08, bore=0.03)
    assert tube.area == pytest.approx(math.pi / 4 * (0.08**2 - 0.03**2))
    assert tube.area_moment == pytest.approx(math.pi / 64 * (0.08**4 - 0.03**4))
    assert tube.shear_coefficient < ShaftSegment(1.0, 0.08).shear_coefficient
    thin = ShaftSegment(1.0, 0.08, bore=0.07999)
    nu = thin.poisson_ratio
    # Cowper: 2 (1 + nu)/(4 + 3 nu) of a thin tube, 6 (1 + nu)/(7 + 6 nu) of a solid rod
    assert thin.shear_coefficient == pytest.approx(2 * (1 + nu) / (4 + 3 * nu), rel=1e-3)
    assert ShaftSegment(1.0, 0.08).shear_coefficient == pytest.approx(6 * (1 + nu) / (7 + 6 * nu))


def test_a_cylinder():
    disc = RotorDisc.cylinder(0.1, diameter=0.28, width=0.07, bore=0.05, density=7810.0)
    assert disc.mass == pytest.approx(7810 * math.pi / 4 * (0.28**2 - 0.05**2) * 0.07)
    assert disc.polar_inertia == pytest.approx(disc.mass / 8 * (0.28**2 + 0.05**2))
    assert disc.diametral_inertia == pytest.approx(
        disc.mass / 48 * (3 * (0.28**2 + 0.05**2) + 4 * 0.07**2)
    )
    assert RotorDisc.cylinder(0.1, diameter=0.1, width=0.1, mass=2.0).mass == 2.0


def test_bearings_in_three_forms():
    assert RotorBearing(0.0, 2.0).stiffness_matrix.tolist() == [[2, 0], [0, 2]]
    assert RotorBearing(0.0, [2.0, 3.0]).stiffness_matrix.tolist() == [[2, 0], [0, 3]]
    crossed = RotorBearing(0.0, [[2.0, 1.0], [-1.0, 2.0]], damping=0.5)
    assert crossed.stiffness_matrix.tolist() == [[2, 1], [-1, 2]]
    assert crossed.damping_matrix.tolist() == [[0.5, 0], [0, 0.5]]
    clamp = RotorBearing(0.0, math.inf, tilting_stiffness=math.inf)
    assert clamp.pinned
    assert clamp.upright
    assert not clamp.stiffness_matrix.any()


@pytest.mark.parametrize(
    ("make", "key", "said"),
    [
        (lambda: ShaftSegment(-1.0, 0.1), ("length",), "above 0 m"),
        (lambda: ShaftSegment(1.0, 0.1, bore=0.1), ("bore",), "less than the diameter"),
        (lambda: ShaftSegment(1.0, 0.1, shear_modulus=2e11), ("shear_modulus",), "Poisson"),
        (lambda: ShaftSegment(1.0, 0.1, elements=0), ("elements",), "at least 1"),
        (lambda: ShaftSegment(1.0, 0.1, elements=2.5), ("elements",), "whole"),
        (lambda: RotorDisc(np.nan, 1.0), ("position",), "finite"),
        (lambda: RotorDisc("a", 1.0), ("position",), "number in m"),
        (lambda: RotorDisc(0.0, 1.0, 1.0, 2.1), ("polar_inertia",), "at most twice"),
        (lambda: RotorDisc.cylinder(0.0, diameter=1, width=1, bore=2), ("bore",), "less than"),
        (lambda: RotorBearing(0.0, -1.0), ("stiffness",), "none negative"),
        (lambda: RotorBearing(0.0, [1.0, 2.0, 3.0]), ("stiffness",), "(2, 2)"),
        (lambda: RotorBearing(0.0, "soft"), ("stiffness",), "(2, 2)"),
        (lambda: RotorBearing(0.0, 1.0, damping=math.inf), ("damping",), "finite"),
        (lambda: RotorBearing(0.0, tilting_stiffness=-1.0), ("tilting_stiffness",), "at least 0"),
    ],
)
def test_what_no_rotor_has_is_refused(make, key, said):
    with pytest.raises(InvalidInputError) as caught:
        make()
    assert caught.value.key == key
    assert said in str(caught.value)
