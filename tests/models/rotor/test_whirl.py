import numpy as np
import pytest

from robustpolish.machines.rotor.assembly import RotorBearing, RotorDisc, ShaftSegment
from robustpolish.machines.rotor.rotor import (
    ANISOTROPIC,
    DAMPED,
    DAMPED_HZ,
    FAST,
    IN_RAD,
    ISOTROPIC,
    SHAFT,
    RotorModel,
)


@pytest.mark.parametrize("name", IN_RAD)
def test_frequencies_are_the_published_ones(name):
    rotor, speed, published = IN_RAD[name]
    """Printed are six classical elements, which are stiffer than ours by up to 0.016 %."""
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
    assert 2 * np.pi * found[1].frequency_hz == pytest.approx(forward, rel=1e-9)
    assert 2 * np.pi * found[0].frequency_hz == pytest.approx(
        np.roots([0.01, 0.015 * speed, -4e3]).max(), rel=1e-9
    )


def test_shapes_are_drawn_by_name():
    ax = ISOTROPIC.modes(FAST, count=2).plot()
    assert [line.get_label() for line in ax.lines[:2]] == [
        "13.59 Hz, backward",
        "13.97 Hz, forward",
    ]
