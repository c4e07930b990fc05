"""A basis that suits a solver of inequalities."""

import control
import numpy as np
import pytest

from robustpolish.linear.arithmetic.realisation import realisation
from robustpolish.linear.norms.peak import modal_model, rebased


def model(A):
    n = len(A)
    return realisation("s", control.ss(A, np.ones((n, 1)), np.ones((1, n)), 0))


MIXED = np.array([[0.0, 1.0, 0.0], [-100.0, -0.2, 0.0], [1.0, 0.0, -3.0]])


def test_modes_stand_alone_and_the_transfer_function_stays():
    system, modal = model(MIXED), modal_model(model(MIXED))
    pair = [i for i in range(3) if abs(modal.A[i, i] + 3) > 1e-9]
    single = ({0, 1, 2} - set(pair)).pop()
    assert abs(modal.A[single, pair]).max() < 1e-9
    assert abs(modal.A[pair, single]).max() < 1e-9
    s = 2j * np.eye(3)
    one = system.C @ np.linalg.solve(s - system.A, system.B)
    two = modal.C @ np.linalg.solve(s - modal.A, modal.B)
    np.testing.assert_allclose(two, one, rtol=1e-10)
    np.testing.assert_allclose(sorted(modal.weights), sorted(1 / np.sqrt([0.2, 0.2, 6.0])))


def test_a_defective_matrix_keeps_its_basis():
    modal = modal_model(model(np.array([[-1.0, 1.0], [0.0, -1.0]])))
    assert abs(modal.basis - np.diag(np.diag(modal.basis))).max() == 0
    np.testing.assert_allclose(modal.weights, np.sqrt(0.5))


def test_forms_come_back_and_the_first_solution_becomes_the_identity():
    modal = modal_model(model(MIXED))
    K = np.diag([1.0, 2.0, 3.0])
    back = modal.back(K)
    np.testing.assert_array_equal(back, back.T)
    np.testing.assert_allclose(modal.basis.T @ back @ modal.basis, K, atol=1e-9)
    again = rebased(modal, back)
    np.testing.assert_allclose(again.basis.T @ back @ again.basis, np.eye(3), atol=1e-9)
    assert rebased(modal, -back) is modal  # no such coordinates


def test_inputs_and_outputs_act_alike():
    system = model(np.diag([-1.0, -2.0]))
    modal = modal_model(system)
    reach = np.linalg.norm(modal.B, axis=1)
    assert reach == pytest.approx(np.linalg.norm(modal.C, axis=0))
