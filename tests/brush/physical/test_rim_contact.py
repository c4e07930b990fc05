"""The compiled rim, against a plain evaluation of the law, and its energy."""

import numpy as np
import pytest

from robustpolish.polishing import contact as rim
from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.surfaces.surface import Surface


def _constants(brush: BrushParameters) -> np.ndarray:
    return np.array(
        [
            brush.contact_stiffness,
            brush.contact_damping,
            brush.friction,
            brush.slip_scale,
            *brush.surface.curvatures,
            brush.radius,
            brush.height / 2,
        ]
    )


def plain_load(brush, nodes, place, velocity, axis, turning, spin):
    """The law of the module's docstring with NumPy; force, moment, friction and damping power."""
    first = np.array([1.0, 0.0, 0.0]) - axis[0] * axis
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    angle = 2 * np.pi * (np.arange(nodes) + 0.5) / nodes
    arm = brush.radius * (np.outer(np.cos(angle), first) + np.outer(np.sin(angle), second))
    arm -= brush.height / 2 * axis
    point = place + arm
    depth = np.maximum(brush.surface.height(point[:, 0], point[:, 1]) - point[:, 2], 0.0)
    slope_x, slope_y = brush.surface.gradient(point[:, 0], point[:, 1])
    normal = np.stack([-slope_x, -slope_y, np.ones(nodes)], axis=1)
    still = velocity + np.cross(turning, arm)
    rate = -np.einsum("ni,ni->n", normal, still)
    elastic = brush.contact_stiffness / nodes * depth
    push = elastic * np.maximum(0.0, 1.0 + brush.contact_damping * rate)
    moving = velocity + np.cross(turning + spin * axis, arm)
    unit = normal / np.linalg.norm(normal, axis=1)[:, None]
    slip = moving - np.einsum("ni,ni->n", moving, unit)[:, None] * unit
    size = np.sqrt(np.sum(slip**2, axis=1) + brush.slip_scale**2)
    pressure = push * np.linalg.norm(normal, axis=1)
    friction = -brush.friction * (pressure / size)[:, None] * slip
    force = push[:, None] * normal + friction
    return (
        force.sum(axis=0),
        np.cross(arm, force).sum(axis=0),
        -np.sum(friction * slip),
        np.sum((push - elastic) * rate),
        (depth > 0).sum(),
    )


def _random_state(seed: int):
    source = np.random.default_rng(seed)
    axis = np.array([*source.normal(0.0, 0.3, 2), 1.0])
    axis /= np.linalg.norm(axis)
    turning = source.normal(0.0, 20.0, 3)
    turning -= turning @ axis * axis
    place = np.array([0.016, *source.normal(0.0, 0.002, 1), 0.0])
    place[2] = source.uniform(0.0, 0.012)
    return place, source.normal(0.0, 0.1, 3), axis, turning, source.uniform(-400.0, 400.0)


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize("across", [0.0, 2.5, 5.0])
def test_compiled_rim_equals_the_plain_law(seed: int, across: float) -> None:
    brush, count = BrushParameters(surface=Surface(0.1, across)), 256
    state = _random_state(seed)
    load, scratch = np.zeros(rim.LOADS), np.zeros((3, count))
    touching = rim.rim_load(*state, _constants(brush), rim.rim_nodes(count), scratch, load)
    force, moment, friction, damping, expected = plain_load(brush, count, *state)
    assert touching == expected
    np.testing.assert_allclose(load[0:3], force, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(load[3:6], moment, rtol=1e-10, atol=1e-12)
    assert load[rim.FRICTION_POWER] == pytest.approx(friction, rel=1e-10, abs=1e-12)
    assert load[rim.DAMPING_POWER] == pytest.approx(damping, rel=1e-9, abs=1e-10)
    assert load[rim.FRICTION_POWER] >= 0.0
    assert load[rim.DAMPING_POWER] >= 0.0
    assert np.all(load[rim.SECTORS : rim.SECTORS + 4] >= 0.0)


def test_at_least_half_of_the_random_states_touch() -> None:
    """Keeps the comparison above from passing for want of contact."""
    brush = BrushParameters()
    touching = [plain_load(brush, 256, *_random_state(seed))[4] > 0 for seed in range(40)]
    assert sum(touching) >= 20


def test_force_without_friction_and_damping_has_the_stored_energy_as_potential() -> None:
    brush = BrushParameters(friction=0.0, contact_damping=0.0)
    nodes, scratch = rim.rim_nodes(256), np.zeros((3, 256))
    axis, still = np.array([0.1, -0.2, np.sqrt(1 - 0.05)]), np.zeros(3)

    def load_at(place: np.ndarray) -> np.ndarray:
        load = np.zeros(rim.LOADS)
        rim.rim_load(place, still, axis, still, 0.0, _constants(brush), nodes, scratch, load)
        return load

    place, step = np.array([0.016, 0.001, 0.006]), 1e-7
    load = load_at(place)
    assert load[rim.ENERGY] > 0.0
    for i in range(3):
        shift = step * np.eye(3)[i]
        rise = load_at(place + shift)[rim.ENERGY] - load_at(place - shift)[rim.ENERGY]
        assert load[i] == pytest.approx(-rise / (2 * step), rel=1e-5)
