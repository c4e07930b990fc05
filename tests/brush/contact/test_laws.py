"""Laws of contact against closed forms and each other."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from robustpolish.errors import InvalidInputError
from robustpolish.polishing.thesis.contact_study import (
    EventImpulse,
    HuntCrossley,
    LinearSpring,
    ListingImpulse,
)


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


def test_slow_blows():
    law = HuntCrossley(1e6, 50.0)
    for speed in (1e-7, 1e-6, 3e-6):
        assert 1 - law.restitution(speed) == pytest.approx(2 * 50 * speed / 3, rel=2e-4)
    assert law.restitution(0.0) == 1.0


def test_contact_pushes_only_but_for_the_listing():
    assert HuntCrossley(1e4, 50.0).force(0.001, -1.0) == 0.0
    assert LinearSpring(1e4).force(-0.001, 1.0) == 0.0
    assert ListingImpulse(1e4, 0.2).force(0.001, -1.0) < 0.0
    assert ListingImpulse(1e4, 0.2).force(-0.001, 1.0) == 0.0


def test_bad_numbers_are_named():
    with pytest.raises(InvalidInputError, match=r"HuntCrossley\.damping"):
        HuntCrossley(1e4, -1.0)
    with pytest.raises(InvalidInputError, match=r"LinearSpring\.stiffness"):
        LinearSpring(0.0)
    with pytest.raises(InvalidInputError, match=r"EventImpulse\.returned"):
        EventImpulse(1e4, 1.0)
    with pytest.raises(InvalidInputError, match="restitution"):
        HuntCrossley.of_restitution(1e4, 1.0, 0.1)
