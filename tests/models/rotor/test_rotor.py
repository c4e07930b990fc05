"""Beams whose frequencies have a closed form, and the checks of the model."""

import math

import numpy as np
import pytest

import robustpolish as rp
from robustpolish import InvalidInputError
from robustpolish.machines.rotor.assembly import RotorBearing, RotorDisc, ShaftSegment
from robustpolish.machines.rotor.rotor import RotorModel

CLAMP = RotorBearing(0.0, math.inf, tilting_stiffness=math.inf)
PINS = [RotorBearing(0.0, math.inf), RotorBearing(1.0, math.inf)]
SLENDER = ShaftSegment(1.0, 0.004, elements=20)
STUBBY = ShaftSegment(1.0, 0.1, elements=20)


def scale(rod):
    return math.sqrt(rod.bending_stiffness / (rod.density * rod.area)) / rod.length**2


def in_rad(rotor, speed=0.0, count=6):
    return 2 * np.pi * rotor.modes(speed, count=count).frequencies_hz


@pytest.mark.parametrize(
    ("bearings", "roots"),
    [
        ([CLAMP], [1.87510407, 4.69409113, 7.85475744]),
        (PINS, [math.pi, 2 * math.pi, 3 * math.pi]),
        ([], [4.73004074, 7.85320462, 10.99560784]),
        ([CLAMP, RotorBearing(1.0, math.inf, tilting_stiffness=math.inf)],
         [4.73004074, 7.85320462, 10.99560784]),
        ([CLAMP, RotorBearing(1.0, math.inf)], [3.92660231, 7.06858275, 10.21017612]),
    ],
    ids=["clamped", "simply supported", "free", "clamped twice", "propped"],
)  # fmt: skip
@pytest.mark.parametrize("theory", ["euler", "timoshenko"])
def test_a_slender_beam_has_the_frequencies_of_the_textbook(bearings, roots, theory):
    """(beta l)^2 sqrt(E I / rho A l^4); Inman (2014), table 6.4. Within 0.1 % with 20 elements."""
    found = in_rad(RotorModel([SLENDER], bearings=bearings, theory=theory))
    np.testing.assert_allclose(found[::2], scale(SLENDER) * np.square(roots), rtol=1e-3)
    np.testing.assert_allclose(found[1::2], found[::2], rtol=1e-9)


@pytest.mark.parametrize("theory", ["euler", "timoshenko"])
def test_twice_as_many_elements_err_by_a_sixteenth(theory):
    found = []
    for elements in (4, 8, 64):
        rod = ShaftSegment(1.0, 0.1, elements=elements)
        found.append(in_rad(RotorModel([rod], bearings=PINS, theory=theory))[4])
    coarse, fine = found[0] / found[2] - 1, found[1] / found[2] - 1
    assert 12 < coarse / fine < 20


@pytest.mark.parametrize("theory", ["euler", "timoshenko"])
@pytest.mark.parametrize("n", [1, 2, 3])
def test_a_stubby_beam_on_two_pins_has_those_of_its_theory(theory, n):
    """E I b^4 - rho A w^2 - rho I b^2 w^2 (1 + E/kG) + rho^2 I w^4 / kG = 0, b = n pi / l."""
    r, b = STUBBY, n * math.pi
    turning = r.density * r.area_moment
    soft = 1 / (r.shear_coefficient * r.shear_modulus) if theory == "timoshenko" else 0.0
    squares = np.roots(
        [
            turning * r.density * soft,
            -r.density * r.area - turning * b**2 * (1 + r.young_modulus * soft),
            r.bending_stiffness * b**4,
        ]
    )
    found = in_rad(RotorModel([STUBBY], bearings=PINS, theory=theory))[2 * n - 2]
    assert found == pytest.approx(math.sqrt(squares.min()), rel=1e-4)


@pytest.mark.parametrize("n", [1, 2])
def test_a_spinning_beam_on_two_pins(n):
    """(rho A + rho I b^2) w^2 -+ 2 rho I b^2 speed w = E I b^4, forward and backward."""
    r, b, speed = STUBBY, n * math.pi, 4000.0
    turning = r.density * r.area_moment * b**2
    mass, k = r.density * r.area + turning, r.bending_stiffness * b**4
    whirl = [np.roots([mass, sign * 2 * turning * speed, -k]).max() for sign in (1, -1)]
    found = in_rad(RotorModel([STUBBY], bearings=PINS, theory="euler"), speed)
    np.testing.assert_allclose(found[2 * n - 2 : 2 * n], whirl, rtol=1e-3)
    assert whirl[1] / whirl[0] > 1.02


def test_frequencies_converge_with_the_fourth_power_of_the_elements():
    errors = []
    for count in (2, 4, 8):
        rod = ShaftSegment(1.0, 0.004, elements=count)
        first = in_rad(RotorModel([rod], bearings=PINS, theory="euler"))[0]
        exact = math.pi**2 * scale(rod) / math.sqrt(1 + (math.pi * 0.004 / 4) ** 2)
        errors.append(first / exact - 1)
    assert 13 < errors[0] / errors[1] < 18
    assert 13 < errors[1] / errors[2] < 18


@pytest.mark.parametrize("elements", [1, 5])
def test_a_force_at_the_tip_meets_3EI_over_l3(elements):
    rod = ShaftSegment(0.02, 0.003, young_modulus=2e11, shear_modulus=7.7e10, elements=elements)
    thesis = rp.polishing.AirBearingParameters().k_x
    euler, timoshenko = (
        RotorModel([rod], bearings=[CLAMP], theory=theory).static_stiffness(0.02)
        for theory in ("euler", "timoshenko")
    )
    np.testing.assert_allclose(euler, thesis * np.eye(2), atol=1e-9 * thesis)
    shear = 0.02 / (rod.shear_coefficient * rod.shear_modulus * rod.area)
    np.testing.assert_allclose(timoshenko, np.eye(2) / (1 / thesis + shear), rtol=1e-9, atol=1e-3)


def test_a_body_on_an_arm_behind_the_end():
    """A point mass at a behind a clamped rod of 1 m: 1/3 + a + a^2 over E I, by statics."""
    a = 0.3
    rod = ShaftSegment(1.0, 0.02, density=0.0, elements=2)
    rotor = RotorModel([rod], [RotorDisc(1.0 + a, 5.0)], [CLAMP], theory="euler")
    compliance = (1 / 3 + a + a**2) / rod.bending_stiffness
    assert in_rad(rotor)[0] == pytest.approx(1 / math.sqrt(5.0 * compliance), rel=1e-9)


def test_what_makes_no_rotor():
    rod = [ShaftSegment(1.0, 0.02)]
    for make, said in (
        (lambda: RotorModel([]), "at least one segment"),
        (lambda: RotorModel(rod[0]), "list of ShaftSegment"),
        (lambda: RotorModel(rod, [CLAMP]), "RotorDisc"),
        (lambda: RotorModel(rod, theory="plate"), "theory"),
        (lambda: RotorModel(rod, internal_damping=-1.0), "internal_damping"),
        (lambda: RotorModel(rod).modes("fast"), "finite speed"),
        (lambda: RotorModel(rod).critical_speeds(), "bearings that hold"),
    ):
        with pytest.raises(InvalidInputError, match=said):
            make()


def test_a_rotor_shows_its_parts():
    text = repr(RotorModel([SLENDER], [RotorDisc(0.5, 2.0)], [CLAMP]))
    assert "disc at [m]" in text
    assert "lowest frequency at rest [Hz]" in text
