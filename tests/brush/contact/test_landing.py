"""A pressed mass lands: momentum, events in closed form, the same impulse under every law."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.polishing.thesis.contact_study import (
    EventImpulse,
    HuntCrossley,
    LinearSpring,
    ListingImpulse,
    land,
    quarter_period,
)

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


def test_bad_arguments_are_named():
    for name in ("mass", "speed", "press", "duration"):
        numbers = {"mass": 1.0, "speed": 1.0, "press": 1.0, "duration": 1.0} | {name: 0.0}
        with pytest.raises(InvalidInputError, match=name):
            land(LinearSpring(1e4), **numbers)
    with pytest.raises(InvalidInputError, match="samples"):
        land(LinearSpring(1e4), 1.0, 1.0, 1.0, 1.0, samples=1)
