"""Laws along a known motion."""

import numpy as np
import pytest

from robustpolish.effects import Motion, force_along, lookup

TIME = np.arange(3000) * 1e-3
Q, V = 1e-3 * np.sin(40 * TIME), 0.04 * np.cos(40 * TIME)
CONTEXT = {"spin_frequency": 0.0, "spring_stiffness": 0.0, "mobility": 0.0, "clearance": 0.0}


def along(kind, *values, context=()):
    numbers = np.array([*values, *(CONTEXT[name] for name in lookup(kind).context)])
    return force_along(lookup(kind), Motion(TIME, Q[None], V[None], CONTEXT), numbers)[0]


def test_a_law_without_memory_is_its_formula():
    np.testing.assert_allclose(along("cubic_stiffness", 2e9), -2e9 * Q**3, rtol=1e-12)
    np.testing.assert_allclose(along("quadratic_damping", 5.0), -5.0 * V * abs(V), rtol=1e-12)


def test_an_attached_resonator_follows_its_equation_of_motion():
    """The internal states start at rest and are stepped finely between the samples."""
    mass, stiffness, damping = 0.02, 500.0, 0.3
    force = along("attached_resonator", mass, stiffness, damping)
    # a mass on a spring and a damper, moved at its foot: relative motion z'' = -... - q''
    fine = np.arange(2999 * 20 + 1) * 5e-5
    r, rate, expected = 0.0, 0.0, np.zeros(fine.size)
    for i, t in enumerate(fine):
        q, v = 1e-3 * np.sin(40 * t), 0.04 * np.cos(40 * t)
        expected[i] = stiffness * (r - q) + damping * (rate - v)
        rate += 5e-5 * -expected[i] / mass
        r += 5e-5 * rate
    scale = np.ptp(expected)
    np.testing.assert_allclose(force[200:], expected[::20][200:], atol=0.02 * scale)


def test_values_that_no_step_can_follow_give_a_force_all_the_same():
    force = along("attached_resonator", 1e-12, 1e12, 0.0)
    assert force.shape == TIME.shape
    assert np.isfinite(force[0])


def test_two_places_have_two_forces():
    motion = Motion(TIME, np.vstack([Q, 2 * Q]), np.vstack([V, 2 * V]), CONTEXT)
    kind = lookup("gyroscopic_coupling")
    force = force_along(kind, motion, np.ones(len(kind.parameters) + len(kind.context)))
    assert force.shape == (2, TIME.size)
    assert np.sum(force * motion.v, axis=0) == pytest.approx(0.0, abs=1e-12)  # it does no work
