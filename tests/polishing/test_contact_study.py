"""Contact laws of the thesis: cone, blows, laws, landings, resultants, and the study of forces."""

from math import atan, cos, pi, sin

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.thesis.contact_study import (
    EventImpulse,
    FrictionCone,
    HuntCrossley,
    LinearSpring,
    ListingImpulse,
    impact_depth,
    land,
    most_impulse,
    quarter_period,
    resultant_forces,
    rim_mass,
    rolling_angle,
)
from robustpolish.polishing.thesis.listing import ListingDefects, brush_slope, listing_constants

# Coulomb's cone: its angle, what it holds, where sliding pushes.


def test_the_angle_of_friction_and_bad_arguments():
    assert FrictionCone(0.25 * np.sqrt(2)).angle == pytest.approx(atan(0.3535534))
    assert FrictionCone(0.0).angle == 0.0
    with pytest.raises(InvalidInputError, match=r"FrictionCone\.friction"):
        FrictionCone(-0.1)
    with pytest.raises(InvalidInputError, match="slip"):
        FrictionCone(0.1).sliding(1.0, [0, 0, 2.0], [0, 0, 1])
    with pytest.raises(InvalidInputError, match="normal"):
        FrictionCone(0.1).holds([0, 0, 1], [0, 0, 0])


def test_it_holds_what_pushes_within_the_angle_and_slides_on_the_edge():
    cone = FrictionCone(0.5)
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    normal = turn @ [0.0, 0.0, 2.0]
    for force, held in ([0.3, 0.39, 1.0], True), ([0.3, 0.41, 1.0], False), ([0, 0, -1.0], False):
        assert cone.holds(turn @ force, normal) is held
    cone, slip = FrictionCone(0.35), np.array([1.0, -2.0, 5.0])
    normal = np.array([0.1, 0.2, 1.0])
    force = cone.sliding(10.0, slip, normal)
    unit = normal / np.linalg.norm(normal)
    assert np.arccos(force @ unit / np.linalg.norm(force)) == pytest.approx(cone.angle)
    assert force @ unit == pytest.approx(10.0)
    assert force @ (slip - (slip @ unit) * unit) < 0.0


# The thesis's estimates of one blow.


def test_durations_depths_and_the_mass_at_the_rim():
    for run in (1, 2, 3, 4):
        brush = BrushParameters.for_run(run)
        assert quarter_period(brush.mass, brush.contact_stiffness) == brush.impact_duration
    stored = 0.5 * 1e8 * impact_depth(0.2, 1e8, 0.7) ** 2
    assert stored == pytest.approx(0.5 * 0.2 * 0.7**2)
    assert rim_mass(BrushParameters()) == pytest.approx(6.6667e-6 / 1.25e-4, rel=1e-4)
    with pytest.raises(InvalidInputError, match="mass"):
        quarter_period(0.0, 1e4)
    with pytest.raises(InvalidInputError, match="stiffness"):
        impact_depth(0.2, -1.0, 1.0)


# Laws of contact against closed forms and each other.


@pytest.mark.parametrize("strength", [1e-3, 0.1, 1.0, 5.0, 50.0])
def test_hunt_crossley_returns_what_its_energy_says(strength):
    """Against an integration of one blow, of any mass and stiffness."""
    law, mass, speed = HuntCrossley(2e5, strength / 0.3), 0.07, 0.3

    def back(_, state):
        return state[0] if state[1] < 0.5 * speed else 1.0

    back.terminal, back.direction = True, -1

    def slope(_, state):
        return [state[1], -law.force(state[0], state[1]) / mass]

    period = 2 * np.pi * np.sqrt(mass / law.stiffness)
    end = 10 * period * (1 + strength)
    run = solve_ivp(slope, (0, end), [0.0, speed], events=back, rtol=1e-10, atol=1e-14,
                    method="LSODA")  # fmt: skip
    assert -run.y_events[0][0][1] / speed == pytest.approx(law.restitution(speed), rel=1e-5)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95, 0.9999])
def test_damping_of_a_restitution(share):
    law = HuntCrossley.of_restitution(1e6, share, speed=0.2)
    assert law.restitution(0.2) == pytest.approx(share, abs=1e-11)
    assert law.restitution(0.02) > share  # slow blows return more


def test_slow_blows_pushes_and_bad_numbers():
    law = HuntCrossley(1e6, 50.0)
    for speed in (1e-7, 1e-6, 3e-6):
        assert 1 - law.restitution(speed) == pytest.approx(2 * 50 * speed / 3, rel=2e-4)
    assert law.restitution(0.0) == 1.0
    assert HuntCrossley(1e4, 50.0).force(0.001, -1.0) == 0.0
    assert LinearSpring(1e4).force(-0.001, 1.0) == 0.0
    assert ListingImpulse(1e4, 0.2).force(0.001, -1.0) < 0.0
    assert ListingImpulse(1e4, 0.2).force(-0.001, 1.0) == 0.0
    with pytest.raises(InvalidInputError, match=r"HuntCrossley\.damping"):
        HuntCrossley(1e4, -1.0)
    with pytest.raises(InvalidInputError, match=r"LinearSpring\.stiffness"):
        LinearSpring(0.0)
    with pytest.raises(InvalidInputError, match=r"EventImpulse\.returned"):
        EventImpulse(1e4, 1.0)
    with pytest.raises(InvalidInputError, match="restitution"):
        HuntCrossley.of_restitution(1e4, 1.0, 0.1)


# A pressed mass lands: momentum, events in closed form, the same impulse under every law.

MASS, SPEED, PRESS = 0.05, 0.1, 10.0


def test_a_spring_bounces_for_ever_as_in_closed_form():
    """First contact under a press P: v cos + P/(m w) (1 - cos) ... until the depth is zero."""
    stiffness = 1e6
    rate = np.sqrt(stiffness / MASS)
    depth = PRESS / stiffness
    lasting = 2 * (np.pi - np.arctan(SPEED / (rate * depth))) / rate
    run = land(LinearSpring(stiffness), MASS, SPEED, PRESS, 0.98 * lasting)
    t = run.time.to_numpy()
    place = depth * (1 - np.cos(rate * t)) + SPEED / rate * np.sin(rate * t)
    impulse = PRESS * t - MASS * (depth * rate * np.sin(rate * t) + SPEED * (np.cos(rate * t) - 1))
    assert place[-1] > 0
    np.testing.assert_allclose(run.impulse, impulse, atol=1e-6 * MASS * SPEED)
    after = land(LinearSpring(stiffness), MASS, SPEED, PRESS, 1.5 * lasting)
    gone = after.impulse.sel(time=slice(1.01 * lasting, None))
    np.testing.assert_allclose(gone, 2 * MASS * SPEED + PRESS * lasting, rtol=1e-6)


def test_events_follow_each_other_in_closed_form():
    law = EventImpulse(1e8, 0.5)
    flights = 2 * SPEED * MASS / PRESS * 0.5 ** np.arange(1, 3)
    assert flights[-1] > 5 * quarter_period(MASS, law.stiffness)
    run = land(law, MASS, SPEED, PRESS, 0.0012, samples=120001)
    blows = np.concatenate([[0.0], np.cumsum(flights)])
    late = run.impulse.interp(time=blows[1:3] - 1e-6).to_numpy()
    expected = np.cumsum(1.5 * MASS * SPEED * 0.5 ** np.arange(2))
    np.testing.assert_allclose(late, expected, rtol=1e-9)
    for name in ("mass", "speed", "press", "duration"):
        numbers = {"mass": 1.0, "speed": 1.0, "press": 1.0, "duration": 1.0} | {name: 0.0}
        with pytest.raises(InvalidInputError, match=name):
            land(LinearSpring(1e4), **numbers)
    with pytest.raises(InvalidInputError, match="samples"):
        land(LinearSpring(1e4), 1.0, 1.0, 1.0, 1.0, samples=1)


@pytest.mark.parametrize(
    "law",
    [
        HuntCrossley(1e6, 50.0),
        EventImpulse(1e6),
        EventImpulse(1e6, 0.6),
        ListingImpulse(1e6, MASS),
    ],
    ids=lambda law: type(law).__name__,
)
def test_what_comes_to_rest_has_taken_the_momentum(law):
    run = land(law, MASS, SPEED, PRESS, 0.2)
    taken = MASS * SPEED + PRESS * 0.2
    # The listing's law carries no steady load: it yields at P t_m / m, for ever.
    creep = PRESS * quarter_period(MASS, 1e6) if isinstance(law, ListingImpulse) else 0.0
    assert float(run.impulse[-1]) == pytest.approx(taken - creep, rel=1e-6)
    assert float(run.velocity[-1]) == pytest.approx(creep / MASS, abs=1e-6)
    assert float(run.force.sum() * run.time[1]) == pytest.approx(float(run.impulse[-1]))


# The laws side by side: peaks and impulses.


@pytest.fixture(scope="module")
def tables():
    brush = rp.polishing.BrushParameters.for_run
    return {
        run: rp.polishing.compare_contact_laws(brush(run), duration=0.012).table for run in (2, 3)
    }


def test_laws_differ_in_peaks_and_hardly_in_impulses(tables):
    peak, window = tables[3]["peak"], tables[3]["window_impulse"]
    assert float(peak.max() / peak.min()) > 1.5
    assert float(window.max() / window.min()) < 1.1


def test_peaks_grow_with_stiffness_but_impulses_do_not(tables):
    peaks, windows = (
        [float(table[key].sel(law="Hunt-Crossley")) for table in tables.values()]
        for key in ("peak", "window_impulse")
    )
    assert peaks[1] > 5 * peaks[0]
    assert windows[1] == pytest.approx(windows[0], rel=0.02)


def test_a_comparison_shows_itself_and_its_hardest_ten_milliseconds():
    comparison = rp.polishing.compare_contact_laws(duration=0.01)
    assert "Hunt-Crossley" in repr(comparison)
    assert "N" in comparison.plot().get_ylabel()
    force = np.zeros(1001)
    force[300:400] = 5.0
    assert most_impulse(np.cumsum(force) * 1e-3, 1e-3) == pytest.approx(5.0 * 0.01)


# Resultant forces against the equations that they solve, (7.4) to (7.34).

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
    constants, _ = listing_constants(brush, ListingDefects())
    state, slope = np.array([0.0, 0.0, 0.5 * pi, 0.0]), np.empty(4)
    made = ListingDefects.none(but=("feed_friction", "pulling_surface"))
    _, flags = listing_constants(brush, made)
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
    assert slope[1] * constants.tilt_inertia == pytest.approx(found.moment_x, rel=1e-9)


def test_no_surface_pulls_and_level_ground_balances_nothing():
    thesis = resultant_forces(ahead=0.2, behind=0.1, unilateral=False)
    found = resultant_forces(ahead=0.2, behind=0.1)
    assert thesis.pulls
    assert thesis.ahead < 0.0
    assert found.ahead == 0.0
    assert found.behind * cos(found.alpha) == pytest.approx(10.0)
    assert found.forward == pytest.approx(10.0 * np.tan(found.alpha))
    sizes = [abs(resultant_forces(ahead=a, behind=a, unilateral=False).behind)
             for a in (0.1, 0.01, 0.001)]  # fmt: skip
    assert sizes[1] / sizes[0] == pytest.approx(10.0, rel=0.3)
    assert sizes[2] / sizes[1] == pytest.approx(10.0, rel=0.05)
    with pytest.raises(InvalidInputError, match="parallel"):
        resultant_forces(ahead=0.1, behind=-0.1)


def test_rolling_angle_and_bad_angles():
    assert rolling_angle(0.2, 0.0) == 0.0
    assert sin(rolling_angle(0.3, 0.7)) == pytest.approx(sin(0.3) * sin(0.7))
    with pytest.raises(InvalidInputError, match="behind"):
        resultant_forces(ahead=0.1, behind=90.0)
    with pytest.raises(InvalidInputError, match="share"):
        resultant_forces(ahead=0.1, behind=0.1, share=1.5)


# Why the thesis's forces were too large: the table that code makes.


@pytest.fixture(scope="module")
def study():
    return rp.polishing.force_study()


def test_what_changes_the_force_and_what_does_not(study):
    """States weighted 1/S too much: 1e5 for 1e-5 s, as the errors of reading find."""
    factor = study.table["factor"]
    assert float(factor.sel(row="as D.2 applies it")) == pytest.approx(1e5, rel=0.3)
    for times in (10, 100):  # force m v / t_m
        row = f"t_m {times} times as long"
        assert float(factor.sel(row=row)) == pytest.approx(1 / times, rel=0.1)
    answer = study.answer()
    assert max(answer["geometry"], answer["friction"]) < 3
    assert answer["duration"] > 50
    assert answer["code"] > 1e5
    assert next(iter(answer)) == "code"
    assert "times the base" in repr(study)
    assert study.plot().get_xscale() == "log"
    for start in ("pressed", "landing"):
        row = study.table.sel(row=f"physical, {start}")
        assert float(row["peak"]) < 1.5 * 10.0
        assert float(row["impulse"]) < 1.0


def test_base_row_is_the_listing(study):
    signals = rp.polishing.simulate_brush("listing", 1, 0.1)
    beyond = np.stack([signals.F_x, signals.F_y, signals.F_z - signals.F_p])
    assert float(study.table["peak"][0]) == pytest.approx(np.linalg.norm(beyond, axis=0).max())


def test_unknown_suspects_are_named():
    with pytest.raises(InvalidInputError, match="suspects"):
        rp.polishing.force_study(suspects=("weather",))
    with pytest.raises(InvalidInputError, match="duration"):
        rp.polishing.force_study(duration=0.0)
