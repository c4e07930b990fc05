"""Listing D.1 as it was integrated, and the forces at its stored states."""

import numpy as np
import pytest

from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.thesis.listing import (
    ListingDefects,
    forces_of_contact,
    listing_forces,
    listing_motion,
)

BRUSH, DEFECTS = BrushParameters.as_published(1), ListingDefects()
TIME = np.arange(201) * 1e-4


@pytest.fixture(scope="module")
def motion():
    return listing_motion(BRUSH, DEFECTS, TIME, 1e-3)


def test_the_disc_starts_along_the_surface(motion):
    states, counts = motion
    assert states.shape == (201, 4)
    speed = BRUSH.rotation_radius * BRUSH.rotation_rate
    slope = 0.3125 * (BRUSH.rim_distance + BRUSH.rotation_radius)  # bend along the feed
    slope *= BRUSH.feed / np.hypot(BRUSH.feed, speed)
    np.testing.assert_allclose(states[0], [np.arctan(slope), 0.0, np.pi / 2, 0.0])
    assert counts[0] > 0


def test_a_closer_tolerance_takes_more_steps(motion):
    _, counts = motion
    assert listing_motion(BRUSH, DEFECTS, TIME, 1e-5)[1][0] > counts[0]


def test_impacts_are_divided_and_the_pressing_force_is_not(motion):
    states, _ = motion
    plain, touching = listing_forces(BRUSH, DEFECTS, TIME, states, 1.0)
    divided, same = listing_forces(BRUSH, DEFECTS, TIME, states, 4.0)
    pressed = [0.0, 0.0, BRUSH.polishing_force]
    np.testing.assert_allclose(divided - pressed, (plain - pressed) / 4.0, atol=1e-12)
    np.testing.assert_array_equal(touching, same)
    np.testing.assert_array_equal(touching[:, 0], touching[:, 1])  # one condition for both
    assert abs(plain[:, 1]).max() > 0
    assert plain[:, 2].min() >= BRUSH.polishing_force


def test_forces_of_a_contact_are_those_of_listing_d_2():
    contact = (0.0, np.pi / 6, np.pi / 2, -4.0, 3.0, True, False, False)
    found = forces_of_contact(contact, 10.0, 2.0)
    np.testing.assert_allclose(found, [-1.0, 1.5, 10.0 + np.sqrt(3.0)], atol=1e-12)
