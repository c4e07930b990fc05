"""The right-hand side of listing D.1, with its mistakes and without."""

import numpy as np
import pytest

from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.surfaces.surface import Surface
from robustpolish.polishing.thesis import listing as equations
from robustpolish.polishing.thesis.listing import (
    ListingDefects,
    brush_slope,
    impact,
    listing_constants,
)


def test_free_flight_is_the_two_angle_disc() -> None:
    """Out of contact, with a vertical push that has no arm, (6.59) to (6.62) are left."""
    brush = BrushParameters(surface=Surface.flat(), friction=0.0)
    defects = ListingDefects.none()
    constants, flags = listing_constants(brush, defects), defects.as_flags()
    state, rates = np.array([0.0, 3.0, np.pi / 2, 5.0]), np.zeros(4)
    assert not any(impact(0.0, 0.0, 3.0, np.pi / 2, 5.0, constants, flags)[5:6])
    with np.errstate(all="ignore"):
        brush_slope(0.0, np.array([0.01, 3.0, np.pi / 2, 0.0]), constants, flags, rates)
    assert rates[0] == 3.0
    gyro = brush.spin_inertia / brush.tilt_inertia * brush.spin
    assert rates[3] == pytest.approx(gyro * state[1])


def test_the_impact_returns_more_than_it_takes_until_mended() -> None:
    brush = BrushParameters.as_published(1)
    factors = []
    for defects in (ListingDefects(), ListingDefects.none()):
        constants, flags = listing_constants(brush, defects), defects.as_flags()
        w, rates = np.array([0.0, 0.0, np.pi / 2 + 0.5, 2.0]), np.zeros(4)
        assert impact(0.1, *w, constants, flags)[6]
        brush_slope(0.1, w, constants, flags, rates)
        factors.append(-rates[2] / 2.0 * np.cos(0.5))
    assert factors[0] == pytest.approx(2.82, abs=0.01)
    assert factors[1] == pytest.approx(brush.radius / brush.rim_distance)


def test_constants_with_the_wrong_radius_and_mass_until_mended() -> None:
    brush = BrushParameters()
    wrong = listing_constants(brush, ListingDefects())
    right = listing_constants(brush, ListingDefects.none())
    assert right[equations.TILT_INERTIA] == pytest.approx(brush.tilt_inertia)
    assert right[equations.SPIN_INERTIA] == pytest.approx(brush.spin_inertia)
    ratio = (brush.rim_distance / brush.radius) ** 2
    assert wrong[equations.SPIN_INERTIA] == pytest.approx(ratio * brush.spin_inertia)
    assert wrong[equations.IMPACT_WEIGHT] == brush.mass
    assert right[equations.IMPACT_WEIGHT] == pytest.approx(
        brush.tilt_inertia / brush.rim_distance**2
    )
