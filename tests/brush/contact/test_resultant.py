"""Resultant forces against the equations that they solve, (7.4) to (7.34)."""

from math import atan, cos, pi, sin

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.thesis.contact_study import resultant_forces, rolling_angle
from robustpolish.polishing.thesis.listing import ListingDefects, brush_slope, listing_constants

SMOOTH = BrushParameters(friction=0.1)


def test_two_points_balance_the_polishing_force():
    """(7.4) and (7.5), and (7.33) adds the two that (7.5) subtracts."""
    found = resultant_forces(SMOOTH, ahead=0.4, behind=0.3)
    sigma = atan(0.1)
    assert (found.alpha, found.beta) == pytest.approx((0.3 - sigma, 0.4 + sigma))
    up = found.ahead * cos(found.beta) + found.behind * cos(found.alpha)
    assert up == pytest.approx(10.0)
    assert found.forward == pytest.approx(0.0, abs=1e-12)
    twice = 2 * 10.0 * sin(found.alpha) * sin(found.beta) / sin(found.alpha + found.beta)
    assert (found.F_x, found.F_y, found.F_z) == pytest.approx((0.0, twice, 10.0))
    assert not found.pulls
    assert not found.tilting


def test_the_tilting_point_takes_its_share():
    """(7.15) and (7.16) at C3; C4 is its mirror image."""
    found = resultant_forces(SMOOTH, ahead=0.3, behind=0.3, side=0.2, roll=0.25)
    other = resultant_forces(SMOOTH, ahead=0.3, behind=0.3, side=0.2, roll=-0.25)
    assert found.tilting
    assert found.side * sin(found.delta) == pytest.approx(10.0 * sin(0.25))
    pressed = 10.0 * cos(0.25) - found.side * cos(found.delta)
    up = found.ahead * cos(found.beta) + found.behind * cos(found.alpha)
    assert up == pytest.approx(pressed)
    assert pytest.approx(10.0 * sin(0.25)) == found.F_x
    assert other.side == pytest.approx(-found.side)
    assert other.moment_y == pytest.approx(-found.moment_y)
    assert other.behind == pytest.approx(found.behind)


def test_a_small_roll_touches_neither_side():
    """Delta h of (7.21), 3.0 mm * share of each, against r sin(gamma)."""
    height = SMOOTH.radius * sin(0.3)
    edge = np.arcsin(height / SMOOTH.rim_distance)
    for factor, tilting in ((0.99, False), (1.01, True)):
        found = resultant_forces(SMOOTH, ahead=0.3, behind=0.3, side=0.3, roll=factor * edge)
        assert found.tilting is tilting


def test_the_moment_is_that_of_the_listing():
    """D.1 lines 123 to 126 at rest: both read (7.8) to (7.10), and the listing adds no impulse."""
    brush = BrushParameters.as_published()
    constants = listing_constants(brush, ListingDefects())
    state, slope = np.array([0.0, 0.0, 0.5 * pi, 0.0]), np.empty(4)
    flags = ListingDefects.none(but=("feed_friction", "pulling_surface")).as_flags()
    speed = np.array([brush.feed, brush.rotation_radius * brush.rotation_rate])
    along = speed / np.hypot(*speed)
    bend = np.array(brush.surface.curvatures)
    start = np.array([2 * brush.rotation_radius + brush.radius, 0.0])
    theta0 = atan(along[0] * bend[0] * (brush.rim_distance + brush.rotation_radius))
    state[0] = theta0
    reach = brush.radius * cos(theta0 - theta0)
    xi = [atan(along @ (bend * (start + sign * reach * along))) for sign in (1, -1)]
    brush_slope(0.0, state, constants, flags, slope)
    found = resultant_forces(brush, ahead=abs(xi[0]), behind=abs(xi[1]), unilateral=False)
    assert slope[1] * constants[9] == pytest.approx(found.moment_x, rel=1e-9)


def test_no_surface_pulls():
    thesis = resultant_forces(ahead=0.2, behind=0.1, unilateral=False)
    found = resultant_forces(ahead=0.2, behind=0.1)
    assert thesis.pulls
    assert thesis.ahead < 0.0
    assert found.ahead == 0.0
    assert found.behind * cos(found.alpha) == pytest.approx(10.0)
    assert found.forward == pytest.approx(10.0 * np.tan(found.alpha))


def test_forces_grow_without_bounds_towards_level_ground():
    sizes = [abs(resultant_forces(ahead=a, behind=a, unilateral=False).behind)
             for a in (0.1, 0.01, 0.001)]  # fmt: skip
    assert sizes[1] / sizes[0] == pytest.approx(10.0, rel=0.3)
    assert sizes[2] / sizes[1] == pytest.approx(10.0, rel=0.05)
    with pytest.raises(InvalidInputError, match="parallel"):
        resultant_forces(ahead=0.1, behind=-0.1)


def test_rolling_angle():
    assert rolling_angle(0.2, 0.0) == 0.0
    assert sin(rolling_angle(0.3, 0.7)) == pytest.approx(sin(0.3) * sin(0.7))


def test_bad_arguments_are_named():
    with pytest.raises(InvalidInputError, match="behind"):
        resultant_forces(ahead=0.1, behind=90.0)
    with pytest.raises(InvalidInputError, match="share"):
        resultant_forces(ahead=0.1, behind=0.1, share=1.5)
