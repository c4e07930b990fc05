"""The H2 norm as a sum over modes, against ball arithmetic."""

from dataclasses import replace

import control
import numpy as np
import pytest

from robustpolish.linear.arithmetic.rational import ExactModel
from robustpolish.linear.arithmetic.realisation import realisation, rescaled
from robustpolish.linear.eigen import eigensystem
from robustpolish.linear.norms.gramian import exact_h2_energy
from robustpolish.linear.norms.h2 import modal_energy
from robustpolish.linear.norms.modal_form import modal_form
from tests.analysis.norms.random_models import model


def energy_of(G):
    form = modal_form(G, eigensystem(G.A), True)
    return form and modal_energy(form)


@pytest.mark.parametrize("seed", range(10))
def test_bounds_hold_in_ball_arithmetic(seed):
    G = model(seed, states=3 + seed, inputs=1 + seed % 3)
    G = rescaled(replace(G, D=0 * G.D))
    found, exact = energy_of(G), exact_h2_energy(ExactModel.of(G))
    assert found.lower <= exact.lower <= exact.upper <= found.upper
    assert found.lower <= found.square <= found.upper
    assert found.width < 1e-10


@pytest.mark.parametrize("damping", [1e-2, 1e-6, 1e-9])
def test_light_damping(damping):
    A = np.array([[0, 1, 0, 0], [-1, -2 * damping, 0, 0.1], [0, 0, 0, 1], [0, 0, -9, -damping]])
    G = rescaled(realisation("system", control.ss(A, [[0], [1], [0], [1]], [[1.0, 0, 0, 0.1]], 0)))
    found, exact = energy_of(G), exact_h2_energy(ExactModel.of(G))
    assert found.lower <= exact.lower <= exact.upper <= found.upper
    assert found.width < 1e-5


def test_none_where_nothing_is_proven():
    assert energy_of(model(1, dt=0.1)) is None  # discrete
    growing = control.ss(np.diag([-1.0, 1e-3]), np.ones((2, 1)), np.ones((1, 2)), 0)
    assert energy_of(realisation("system", growing)) is None
    hidden = control.ss(np.diag([-1.0, -1.0]), [[1], [1]], [[1, -1]], 0)
    assert energy_of(realisation("system", hidden)) is None
