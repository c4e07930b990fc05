import numpy as np
import pytest

from robustpolish import InvalidInputError
from robustpolish.machines.rotor.assembly import SecondOrder


def chain(mass=(2.0, 1.0), held=3e4, between=1e4, speed_terms=0.0):
    """Two masses in each of two planes."""
    M = np.kron(np.eye(2), np.diag(mass))
    K = np.kron(np.eye(2), [[held + between, -between], [-between, between]])
    G = np.kron([[0.0, 1.0], [-1.0, 0.0]], np.diag([0.0, speed_terms]))
    N = np.zeros((4, 4))
    return SecondOrder(M, 1e-4 * K, K, G, N, (2, 2))


def test_normal_modes_make_both_matrices_diagonal():
    system = chain()
    frequencies, shapes = system.normal_modes
    np.testing.assert_allclose(shapes.T @ system.mass @ shapes, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(
        shapes.T @ system.stiffness @ shapes, np.diag(frequencies**2), atol=1e-7
    )
    assert (np.diff(frequencies) >= 0).all()
    assert all(not shape[:2].any() or not shape[2:].any() for shape in shapes.T)


def test_a_part_without_mass_adds_no_mode_and_keeps_its_spring():
    frequencies, shapes = chain(mass=(2.0, 0.0)).normal_modes
    np.testing.assert_allclose(frequencies, np.sqrt(3e4 / 2.0))
    np.testing.assert_allclose(np.abs(shapes).max(axis=0), np.sqrt(0.5))


def test_what_nothing_holds_moves_at_no_frequency():
    frequencies, _ = chain(held=0.0).normal_modes
    assert frequencies[:2].tolist() == [0.0, 0.0]
    np.testing.assert_allclose(frequencies[2:], np.sqrt(1e4 * (1 / 2 + 1)), rtol=1e-12)
    with pytest.raises(InvalidInputError, match="nothing holds and that has no mass"):
        chain(mass=(0.0, 0.0), held=0.0).normal_modes  # noqa: B018


@pytest.mark.parametrize("held", [3e4, 0.0])
def test_state_matrix_and_response_are_the_equation_of_motion(held):
    system, speed = chain(held=held, speed_terms=0.02), 50.0
    A = system.state_matrix(speed)
    M, C, K = system.mass, system.damping + speed * system.gyroscopic, system.stiffness
    first = np.block([[np.zeros((4, 4)), np.eye(4)], [-np.linalg.solve(M, np.hstack([K, C]))]])
    for value in np.linalg.eigvals(first):
        assert np.abs(np.linalg.eigvals(A) - value).min() < 1e-4 * max(abs(value), 1.0)
    s = np.array([20j, 1.0 + 150j])
    rows = np.eye(4)[[1, 3]]
    found = system.response(speed, s, rows, rows)
    for each, at in zip(found, s, strict=True):
        expected = rows @ np.linalg.solve(M * at**2 + C * at + K, rows.T)
        np.testing.assert_allclose(each, expected, rtol=1e-9)


def test_projection_onto_everything_changes_nothing():
    system = chain()
    rng = np.random.default_rng(1)
    turned = system.projected(rng.normal(size=(2, 2)), rng.normal(size=(2, 2)))
    assert turned.planes == (2, 2)
    np.testing.assert_allclose(turned.normal_modes[0], system.normal_modes[0], rtol=1e-9)
