"""Rotors against textbooks and published frequencies: whirl, critical speeds, plants."""

import math
import runpy
from pathlib import Path

import numpy as np
import pytest

import robustpolish as rp
from robustpolish import InvalidInputError
from robustpolish.machines.rotor.assembly import RotorBearing, RotorDisc, ShaftSegment
from robustpolish.machines.rotor.rotor import RotorModel

PRINTED = runpy.run_path(str(Path(__file__).parents[2] / "docs" / "validation_rotors.py"))
FAST, SHAFT, IN_RAD, DAMPED_HZ = (PRINTED[n] for n in ("FAST", "SHAFT", "IN_RAD", "DAMPED_HZ"))
ISOTROPIC, ANISOTROPIC, DAMPED, OVERHUNG = (
    PRINTED[name] for name in ("ISOTROPIC", "ANISOTROPIC", "DAMPED", "OVERHUNG")
)

# Beams whose frequencies have a closed form, and the checks of the model.
PLACES, ENDS = [0.0, 0.5, 1.5], {"left": 0.0, "right": 1.5}
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
    middle = r.density * r.area + turning * b**2 * (1 + r.young_modulus * soft)
    squares = np.roots([turning * r.density * soft, -middle, r.bending_stiffness * b**4])
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
    rod, light = [ShaftSegment(1.0, 0.02)], ShaftSegment(1.0, 0.02, density=0.0)
    for make, said in (
        (lambda: RotorModel([]), "at least one segment"),
        (lambda: RotorModel(rod[0]), "list of ShaftSegment"),
        (lambda: RotorModel(rod, [CLAMP]), "RotorDisc"),
        (lambda: RotorModel(rod, theory="plate"), "theory"),
        (lambda: RotorModel(rod, internal_damping=-1.0), "internal_damping"),
        (lambda: RotorModel(rod).modes("fast"), "finite speed"),
        (lambda: RotorModel(rod).critical_speeds(), "nothing holds"),
        (lambda: ISOTROPIC.critical_speeds(0.0), "resolution"),
        (lambda: RotorModel(rod).reduced(2, [0.5]), "nothing holds"),
        (lambda: RotorModel([light]).modes(), "nothing holds and that has no mass"),
        (lambda: ISOTROPIC.plant(loads={}, actuators=ENDS), "at least one place"),
        (lambda: ISOTROPIC.plant(loads={"a": "b"}, actuators=ENDS), "a place in m"),
        (lambda: ISOTROPIC.plant(loads=[0.5], actuators=ENDS), "name"),
        (lambda: ISOTROPIC.plant(loads={"a": np.inf}, actuators=ENDS), "finite place"),
        (lambda: ISOTROPIC.reduced(2, PLACES).error(band_hz=0.0), "band_hz"),
    ):
        with pytest.raises(InvalidInputError, match=said):
            make()


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
    [(lambda: ShaftSegment(-1.0, 0.1), "length", "above 0 m"),
     (lambda: ShaftSegment(1.0, 0.1, bore=0.1), "bore", "less than the diameter"),
     (lambda: ShaftSegment(1.0, 0.1, shear_modulus=2e11), "shear_modulus", "Poisson"),
     (lambda: ShaftSegment(1.0, 0.1, elements=0), "elements", "at least 1"),
     (lambda: ShaftSegment(1.0, 0.1, elements=2.5), "elements", "whole"),
     (lambda: RotorDisc(np.nan, 1.0), "position", "finite"),
     (lambda: RotorDisc("a", 1.0), "position", "number in m"),
     (lambda: RotorDisc(0.0, 1.0, 1.0, 2.1), "polar_inertia", "at most twice"),
     (lambda: RotorDisc.cylinder(0.0, diameter=1, width=1, bore=2), "bore", "less than"),
     (lambda: RotorBearing(0.0, -1.0), "stiffness", "none negative"),
     (lambda: RotorBearing(0.0, [1.0, 2.0, 3.0]), "stiffness", "(2, 2)"),
     (lambda: RotorBearing(0.0, "soft"), "stiffness", "(2, 2)"),
     (lambda: RotorBearing(0.0, 1.0, damping=math.inf), "damping", "finite"),
     (lambda: RotorBearing(0.0, tilting_stiffness=-1.0), "tilting_stiffness", "at least 0"),
     (lambda: ISOTROPIC.reduced(0, PLACES), "modes", "at least 1"),
     (lambda: ISOTROPIC.reduced(2.5, PLACES), "modes", "whole"),
     (lambda: ISOTROPIC.reduced(2, []), "ports", "one place"),
     (lambda: ISOTROPIC.reduced(2, [np.nan]), "ports", "finite"),
     (lambda: ISOTROPIC.reduced(2, PLACES, "guyan"), "method", "modal"),
     (lambda: ISOTROPIC.reduced(2, PLACES, "modal", "fast"), "speed", "finite speed")],
)  # fmt: skip
def test_what_no_rotor_has_is_refused(make, key, said):
    with pytest.raises(InvalidInputError) as caught:
        make()
    assert caught.value.key[0] == key
    assert said in str(caught.value)


@pytest.mark.parametrize("name", IN_RAD)
def test_frequencies_are_the_published_ones(name):
    """Printed are six classical elements, which are stiffer than ours by up to 0.016 %."""
    rotor, speed, published = IN_RAD[name]
    found = 2 * np.pi * rotor.modes(speed, count=6).frequencies_hz
    np.testing.assert_allclose(found, published, rtol=2e-4)
    assert (found < np.array(published) * (1 + 5e-5)).all()


@pytest.mark.parametrize("speed", DAMPED_HZ)
def test_damped_frequencies_are_the_published_ones(speed):
    found = DAMPED.modes(speed, count=6)
    natural, oscillating = DAMPED_HZ[speed]
    np.testing.assert_allclose([m.natural_frequency_hz for m in found], natural, rtol=6e-4)
    np.testing.assert_allclose(found.frequencies_hz, oscillating, rtol=6e-4)
    assert all(m.damping_ratio > 0 for m in found)
    assert found.largest_growth < 0


def test_round_bearings_make_round_orbits_one_way_each():
    found = ISOTROPIC.modes(FAST, count=6)
    assert [m.direction for m in found] == ["backward", "forward"] * 3
    np.testing.assert_allclose([abs(m.whirl) for m in found], 1.0, atol=1e-9)
    x, y = found[1].shape
    np.testing.assert_allclose(y, -1j * x, atol=1e-9)  # y follows x by a quarter turn
    assert {m.direction for m in ISOTROPIC.modes(0.0, count=6)} == {"planar"}
    assert found[0:2][0].whirl < 0
    assert "backward" in repr(found)


def test_uneven_bearings_make_ellipses_and_both_ways_at_once():
    at_rest = ANISOTROPIC.modes(0.0, count=2)
    assert [m.direction for m in at_rest] == ["planar", "planar"]
    np.testing.assert_allclose(np.abs(at_rest[0].shape[0]), 0.0, atol=1e-9)  # y is softer
    spun = ANISOTROPIC.modes(FAST, count=2)
    assert all(0.01 < abs(m.whirl) < 0.999 for m in spun)
    # Example 5.9.3: much softer in y, some nodes go forward while others go backward.
    ends = [RotorBearing(at, (1e6, 2e5)) for at in (0.0, 1.5)]
    mixed = RotorModel(SHAFT, ISOTROPIC.discs, ends).modes(FAST, count=6)
    assert "mixed" in {m.direction for m in mixed}


def test_a_disc_on_a_weightless_shaft_whirls_as_its_two_equations_say():
    """Id w^2 -+ Ip speed w = k: a disc that only tilts, on a bearing that only resists tilting."""
    disc = RotorDisc(0.5, 3.0, 0.01, 0.015)
    held = RotorBearing(0.5, np.inf, tilting_stiffness=4e3)
    rotor = RotorModel([ShaftSegment(1.0, 0.05, density=0.0)], [disc], [held])
    speed = 500.0
    forward = np.roots([0.01, -0.015 * speed, -4e3]).max()
    found = rotor.modes(speed, count=2)
    backward = np.roots([0.01, 0.015 * speed, -4e3]).max()
    np.testing.assert_allclose(2 * np.pi * found.frequencies_hz, [backward, forward], rtol=1e-9)


def test_curves_keep_their_way_round_where_they_cross():
    """Overhung: the second forward whirl overtakes the third backward one."""
    coarse, fine = (OVERHUNG.campbell(np.linspace(0.0, FAST, n), count=6) for n in (4, 31))
    assert (np.diff(fine.whirl[1:], axis=0) < 0.2).all()
    ways = np.sign(fine.whirl[1:])
    assert (ways == ways[0]).all()
    assert ways[0].sum() == 0
    forward = fine.frequencies_hz[:, ways[0] > 0]
    assert (np.diff(forward, axis=0) > 0).all()  # the spin stiffens forward whirl ...
    assert (np.diff(fine.frequencies_hz[:, ways[0] < 0], axis=0) < 0).all()  # softens the other
    # A coarse diagram follows the same curves.
    np.testing.assert_allclose(
        np.sort(coarse.eigenvalues[-1].imag), np.sort(fine.eigenvalues[-1].imag), rtol=1e-9
    )
    np.testing.assert_allclose(coarse.eigenvalues[-1], fine.eigenvalues[-1], rtol=1e-6)


def test_critical_speeds_are_where_the_diagram_meets_the_spin():
    speeds = ISOTROPIC.critical_speeds()
    for speed in speeds[:2]:
        found = ISOTROPIC.modes(speed, count=6)
        near = np.abs(2 * np.pi * found.frequencies_hz - speed).argmin()
        assert 2 * np.pi * found[int(near)].frequency_hz == pytest.approx(speed, rel=1e-8)
        assert found[int(near)].direction == "forward"
    listed = ISOTROPIC.campbell(np.linspace(0.0, 450.0, 5)).critical_speeds
    np.testing.assert_allclose(listed, speeds[:2])


@pytest.mark.parametrize("rod", [SLENDER, STUBBY])
def test_critical_speeds_end_where_the_mesh_does_not_resolve_them(rod):
    """Euler on two pins: rho (A - I b^2) w^2 = E I b^4; elements of length h err by (bh)^4/1440."""
    rotor = RotorModel([rod], bearings=PINS, theory="euler")
    count = int(20 / math.pi * (1440 * 0.005 * 16 / 15) ** 0.25)
    b = math.pi * np.arange(1, count + 1)
    mass = rod.density * (rod.area - rod.area_moment * b**2)
    found = rotor.critical_speeds(resolution=0.005)
    np.testing.assert_allclose(found, np.sqrt(rod.bending_stiffness * b**4 / mass), rtol=0.0054)
    assert len(rotor.critical_speeds()) > count
    assert rotor.critical_speeds(None)[-1] > 1.5 * found[-1]


def test_a_thin_disc_never_meets_its_critical_speed():
    """With Ip > Id forward whirl of a tilting disc stays above the spin."""
    held = RotorBearing(0.5, np.inf, tilting_stiffness=4e3)
    light = [ShaftSegment(1.0, 0.05, density=0.0)]
    for polar, count in ((0.015, 0), (0.005, 1)):
        rotor = RotorModel(light, [RotorDisc(0.5, 3.0, 0.01, polar)], [held])
        expected = [np.sqrt(4e3 / (0.01 - polar))] if count else []
        np.testing.assert_allclose(rotor.critical_speeds(), expected, rtol=1e-9)


def test_damping_inside_the_shaft_drives_whirl_beyond_the_critical_speed():
    """Jeffcott's rotor: the limit is w (1 + c_bearing / c_shaft), Genta (2005), section 4.5."""
    mass = RotorDisc(0.5, 2.0)
    shaft = [ShaftSegment(1.0, 0.02, density=0.0)]
    ends = [RotorBearing(at, np.inf) for at in (0.0, 1.0)]
    limit = {}
    for outside in (0.0, 3.0):
        film = RotorBearing(0.5, 0.0, damping=outside)
        rotor = RotorModel(shaft, [mass], [*ends, film], internal_damping=2e-5)
        k = rotor.static_stiffness(0.5)[0, 0]
        w = np.sqrt(k / 2.0)
        expected = w * (1 + outside / (2e-5 * k))
        limit[outside] = expected
        assert rotor.modes(0.999 * expected).largest_growth < 0
        assert rotor.modes(1.001 * expected).largest_growth > 0
        found = rotor.campbell(np.linspace(0.5, 1.5, 11) * expected, count=2)
        assert found.stability_limit == pytest.approx(1.1 * expected)
        assert (found.damping_ratios.min(axis=1) < 0).tolist()[-3:] == [True] * 3
    assert limit[3.0] > 1.2 * limit[0.0]


def test_speeds_have_to_rise():
    for speeds in ([1.0], [2.0, 1.0], [-1.0, 1.0], [[0.0, 1.0]], [0.0, np.nan]):
        with pytest.raises(InvalidInputError, match="rising speeds"):
            ISOTROPIC.campbell(speeds)


def test_the_picture_tells_the_ways_apart():
    found = ISOTROPIC.campbell(np.linspace(0.0, 450.0, 5))
    labels = [text.get_text() for text in found.plot().get_legend().get_texts()]
    assert labels == ["forward", "backward", "once per turn", "critical speed"]
    assert "Critical speeds [rev/min]: 829.9, 2756" in repr(found).replace("829.874", "829.9")


def test_modes_at_the_speed_are_exact_and_steady_forces_too():
    lost = ISOTROPIC.reduced(3, PLACES, speed=FAST).error()
    assert lost.frequency < 1e-11
    assert lost.steady < 1e-11
    assert lost.response < 1e-3
    assert lost.speed == FAST
    assert lost.band_hz == pytest.approx(716.719 / (2 * np.pi), rel=1e-5)


def test_what_each_method_costs():
    found = {
        method: ISOTROPIC.reduced(3, PLACES, method).error()
        for method in ("static", "craig_bampton", "modal")
    }
    assert found["static"].response < 1e-3
    # Modes of the rotor held at its ports are not its own: the frequencies are near, not exact.
    assert 1e-4 < found["craig_bampton"].frequency < 0.005
    assert found["static"].frequency < 1e-11
    assert found["modal"].steady > 0.1  # without deflections, steady forces bend it too little
    errors = [ISOTROPIC.reduced(k, PLACES, "modal").error().steady for k in (2, 4, 6)]
    assert errors[0] > errors[1] > errors[2]


def test_modes_at_rest_miss_what_the_spin_does():
    """The error says so."""
    at_rest = ISOTROPIC.reduced(3, PLACES)
    assert at_rest.error().response < 1e-3
    assert at_rest.error(speed=FAST).response > 0.1
    assert at_rest.error(speed=FAST).frequency == pytest.approx(0.0034, rel=0.05)


def test_error_is_that_of_the_plants():
    """The same difference, once more from the state-space models."""
    few = ISOTROPIC.reduced(2, [0.5], "modal")
    at = {"loads": {"d": 0.5}, "actuators": {"d": 0.5}}
    lost = few.error(band_hz=30.0)
    s = 2 * np.pi * lost.response_hz * (1j + 0.01)
    whole, own = (p.open_loop(s) for p in (ISOTROPIC.plant(**at), few.plant(**at)))
    gap = np.linalg.norm(whole[:2, :2] - own[:2, :2], 2) / np.linalg.norm(whole[:2, :2], 2)
    assert gap == pytest.approx(lost.response, rel=1e-6)


def test_nothing_reduced_loses_nothing():
    whole = ISOTROPIC.reduced(None, PLACES)
    assert whole.error().response == 0.0
    assert whole.bases is None
    assert "relative error" in repr(ISOTROPIC.reduced(2, PLACES))
    lines = ISOTROPIC.reduced(2, PLACES).plot(band_hz=50.0).lines
    assert [line.get_label() for line in lines][1] == "what is lost"


def test_signals_have_names_and_units():
    plant = ISOTROPIC.plant(loads={"disc": 0.5}, actuators=ENDS, performance={"mid": 0.75})
    assert plant.disturbance_names == ("F_disc_x", "F_disc_y")
    assert plant.performance_names == ("mid_x", "mid_y")
    assert plant.measurement_names[:2] == ("measured_left_x", "measured_left_y")
    assert (plant.units["u_right_y"], plant.units["mid_x"]) == ("N", "m")
    assert not plant.D11.any()
    assert plant.nx == 104


def test_gains_and_poles_are_those_of_the_rotor():
    plant = DAMPED.plant(FAST, loads={"p": 0.3}, actuators={"p": 0.3})
    at_rest = DAMPED.plant(loads={"p": 0.3}, actuators={"p": 0.3})
    gain = at_rest.open_loop(0.0)[:2, :2].real
    np.testing.assert_allclose(np.linalg.inv(gain), DAMPED.static_stiffness(0.3), atol=1e-3)
    poles = np.linalg.eigvals(plant.A)
    for mode in DAMPED.modes(FAST, count=6):
        assert np.abs(poles - mode.eigenvalue).min() < 1e-8 * abs(mode.eigenvalue)


def test_a_controller_for_the_reduced_rotor_is_certified_and_holds_on_the_whole():
    places = {"loads": {"disc": 0.5}, "actuators": ENDS}
    rotor = RotorModel(DAMPED.shaft, DAMPED.discs, DAMPED.bearings, internal_damping=1e-5)
    plant = rotor.reduced(2, [0.0, 0.5, 1.5], speed=FAST).plant(**places)
    design = rp.output_feedback(plant, control_weight=1e-7, measurement_noise=1e-7)
    assert design.certificate.valid
    few = rp.hinf_norm(plant.closed_loop(design.controller)).value
    whole = rp.hinf_norm(rotor.plant(FAST, **places).closed_loop(design.controller)).value
    assert few < 0.03 * rp.hinf_norm(plant.open_loop).value
    assert whole == pytest.approx(few, rel=0.01)
