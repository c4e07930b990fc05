import numpy as np
import pytest

from robustpolish.machines.rotor.assembly import inertia, motion, shapes, stiffness


@pytest.mark.parametrize("phi", [0.0, 0.7])
def test_shapes_join_the_ends_and_keep_rigid_motion(phi):
    length = 0.3
    for share, ends in ((0.0, [0, 1]), (1.0, [2, 3])):
        deflection, slope = shapes(share, length, phi)
        np.testing.assert_allclose(np.vstack([deflection, slope])[:, ends], np.eye(2), atol=1e-15)
    turned = np.array([0.0, 1.0, length, 1.0])  # a turn by 1 about the first end
    for share in (0.2, 0.5, 0.9):
        deflection, slope = shapes(share, length, phi)
        assert deflection @ turned == pytest.approx(share * length)
        assert slope @ turned == pytest.approx(1.0)


@pytest.mark.parametrize(("phi", "size"), [(0.0, 4), (0.7, 6)])
def test_stiffness_is_the_energy_of_bending_and_shear(phi, size):
    """With shear, inner shapes too: they store energy, and loads at the ends leave them alone."""
    length, bending = 0.3, 5.0
    shear = 12 * bending / (phi * length**2) if phi else 0.0  # kappa G A
    step, energy = 1e-5, np.zeros((size, size))
    for point, weight in zip(*np.polynomial.legendre.leggauss(6), strict=True):
        share = (1 + point) / 2
        after, before = (motion(share + sign * step, length, phi) for sign in (1, -1))
        rise, curve = ((a - b) / (2 * step * length) for a, b in zip(after, before, strict=True))
        sheared = rise - motion(share, length, phi)[1]
        energy += weight * length / 2 * bending * np.outer(curve, curve)
        energy += weight * length / 2 * shear * np.outer(sheared, sheared)
    K = stiffness(length, bending, phi)
    np.testing.assert_allclose(energy, K, rtol=1e-7, atol=1e-6 * K.max())
    assert np.linalg.matrix_rank(K, tol=1e-9 * K.max()) == size - 2  # rigid motions cost nothing


def test_inner_shapes_vanish_at_the_ends():
    for share in (0.0, 1.0):
        deflection, slope = motion(share, 0.3, 0.7)
        assert not deflection[4:].any()
        assert not slope[4:].any()


def test_inertia_is_that_of_the_textbook():
    length, mass = 0.3, 2.0
    s = length
    printed = (
        mass * s / 420
        * np.array([[156, 22 * s, 54, -13 * s], [22 * s, 4 * s**2, 13 * s, -3 * s**2],
                    [54, 13 * s, 156, -22 * s], [-13 * s, -3 * s**2, -22 * s, 4 * s**2]])
    )  # fmt: skip
    np.testing.assert_allclose(inertia(length, mass, 0.0, 0.0), printed, rtol=1e-12)
    rotary = (
        mass / (30 * s)
        * np.array([[36, 3 * s, -36, 3 * s], [3 * s, 4 * s**2, -3 * s, -(s**2)],
                    [-36, -3 * s, 36, -3 * s], [3 * s, -(s**2), -3 * s, 4 * s**2]])
    )  # fmt: skip
    np.testing.assert_allclose(inertia(length, 0.0, mass, 0.0), rotary, rtol=1e-11)


def test_a_rigid_turn_has_the_inertia_of_a_rod():
    length, line_mass, line_inertia, phi = 0.3, 2.0, 1e-3, 0.4
    M = inertia(length, line_mass, line_inertia, phi)
    turn = np.array([-length / 2, 1.0, length / 2, 1.0, 0.0, 0.0])
    expected = line_mass * length**3 / 12 + line_inertia * length
    assert turn @ M @ turn == pytest.approx(expected, rel=1e-12)
