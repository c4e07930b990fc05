import math

import numpy as np
import pytest

from robustpolish.machines.rotor.assembly import (
    Mesh,
    RotorBearing,
    RotorDisc,
    ShaftSegment,
    assembled,
)


def test_discs_and_bearings_divide_the_shaft():
    shaft = [ShaftSegment(1.0, 0.05, elements=4), ShaftSegment(0.5, 0.03, elements=1)]
    mesh = Mesh.of(shaft, [0.3, 1.2, 1.5, -0.2, 2.0], shear=True)
    assert {0.0, 0.3, 1.0, 1.2, 1.5} <= set(mesh.nodes.round(12))
    assert (np.diff(mesh.nodes) > 0).all()
    assert mesh.nodes[-1] == pytest.approx(1.5)
    assert len(mesh.segments) == len(mesh.nodes) - 1
    middles = (mesh.nodes[1:] + mesh.nodes[:-1]) / 2
    assert all((s is shaft[0]) == (m < 1.0) for s, m in zip(mesh.segments, middles, strict=True))
    assert Mesh.of(shaft, [], shear=False).phi(0) == 0.0 < mesh.phi(0)


def test_motion_at_a_node_between_nodes_and_beyond_the_end():
    mesh = Mesh.of([ShaftSegment(1.0, 0.05, elements=3)], [], shear=True)
    turned = np.zeros(mesh.size)  # what moves within elements stays 0
    turned[: 2 * len(mesh.nodes)] = np.ravel(
        np.column_stack([2.0 * mesh.nodes, np.full(len(mesh.nodes), 2.0)])
    )
    for place in (0.0, 1 / 3, 0.5, 1.0, 1.2, -0.1):
        deflection, slope = mesh.motion_at(place)
        assert deflection @ turned == pytest.approx(2.0 * place, abs=1e-14)
        assert slope @ turned == pytest.approx(2.0)


def test_matrices_have_the_total_mass_and_angular_momentum():
    segment = ShaftSegment(1.0, 0.05, elements=3)
    disc = RotorDisc.cylinder(1.1, diameter=0.2, width=0.05)
    mesh = Mesh.of([segment], [disc.position], shear=True)
    system = assembled(mesh, [disc], [], 0.0).system
    n, inner = len(mesh.nodes), np.zeros(mesh.size - 2 * len(mesh.nodes))
    shift = np.r_[np.tile([1.0, 0.0], n), inner, np.zeros(mesh.size)]
    mass = segment.density * segment.area + disc.mass
    assert shift @ system.mass @ shift == pytest.approx(mass)
    tilted = np.ravel(np.column_stack([mesh.nodes, np.ones(n)]))
    tilt_x = np.r_[np.zeros(mesh.size), tilted, inner]
    tilt_y = np.roll(tilt_x, mesh.size)
    momentum = 2 * segment.density * segment.area_moment + disc.polar_inertia
    assert tilt_y @ system.gyroscopic @ tilt_x == pytest.approx(momentum)
    np.testing.assert_allclose(system.gyroscopic, -system.gyroscopic.T)
    np.testing.assert_allclose(system.stiffness @ shift, 0.0, atol=1e-6 * system.stiffness.max())


def test_supports_take_coordinates_away_and_coupling_joins_the_planes():
    mesh = Mesh.of([ShaftSegment(1.0, 0.05, elements=3)], [], shear=True)
    clamp = RotorBearing(0.0, math.inf, tilting_stiffness=math.inf)
    held = assembled(mesh, [], [clamp], 0.0)
    assert held.system.planes == (12, 12)
    assert np.abs(held.free[:2]).max() < 1e-14
    crossed = RotorBearing(1.0, [[1e6, 5e5], [-5e5, 1e6]])
    assert assembled(mesh, [], [clamp, crossed], 0.0).system.planes == (24,)


def test_damping_inside_the_shaft_does_not_brake_its_turning():
    """A bent shaft that whirls as fast as it spins is not deformed in time: no force is left."""
    mesh = Mesh.of([ShaftSegment(1.0, 0.05, elements=2)], [], shear=True)
    system = assembled(mesh, [], [], 1e-4).system
    bend = np.random.default_rng(0).normal(size=mesh.size)
    speed = 70.0
    q = np.r_[bend, -1j * bend]  # round orbits, forward
    force = 1j * speed * system.damping @ q + speed * system.circulatory @ q
    np.testing.assert_allclose(force, 0.0, atol=1e-9 * np.abs(system.damping @ q).max() * speed)
