import numpy as np
import pytest

from robustpolish import InvalidInputError
from robustpolish.machines.rotor.assembly import RotorBearing, RotorDisc, ShaftSegment
from robustpolish.machines.rotor.rotor import (
    ANISOTROPIC,
    FAST,
    IN_RAD,
    ISOTROPIC,
    OVERHUNG,
    RotorModel,
)


@pytest.mark.parametrize(
    ("rotor", "name"), [(ISOTROPIC, "5.9.1"), (ANISOTROPIC, "5.9.2"), (OVERHUNG, "5.9.9")]
)
def test_the_diagram_ends_at_the_published_frequencies(rotor, name):
    found = rotor.campbell(np.linspace(0.0, FAST, 12), count=6)
    rested, spun = (IN_RAD[each][2] for each in (f"{name} at rest", name))
    np.testing.assert_allclose(np.sort(2 * np.pi * found.frequencies_hz[0]), rested, rtol=2e-4)
    np.testing.assert_allclose(np.sort(2 * np.pi * found.frequencies_hz[-1]), spun, rtol=2e-4)


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
