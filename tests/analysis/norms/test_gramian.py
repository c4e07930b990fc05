"""The square of the H2 norm with bounds."""

import control
import numpy as np
import pytest

from robustpolish.linear.arithmetic.rational import ExactModel
from robustpolish.linear.arithmetic.realisation import realisation
from robustpolish.linear.norms.gramian import EnergyBounds, exact_h2_energy, h2_energy


@pytest.mark.parametrize(
    ("system", "square"),
    [
        (control.ss(-2.0, 1.0, 1.0, 0.0), 0.25),
        (control.ss(0.6, 1.0, 1.0, 2.0, True), 1 / (1 - 0.36) + 4),
        (control.ss([[0, 1], [-1, -0.02]], [[0], [1]], [[1, 0]], 0), 25.0),
    ],
)
def test_bounds_hold_the_energy(system, square):
    model = realisation("s", system)
    for found in (h2_energy(model, 1e-9), exact_h2_energy(ExactModel.of(model))):
        assert found.lower <= square * (1 + 1e-15)
        assert found.upper >= square * (1 - 1e-15)
        assert found.width < 1e-9
        assert found.square == pytest.approx(square, rel=1e-9)


def test_exact_bounds_are_tight_where_doubles_are_not():
    """Damping of 1e-12: the energy is 1/(4 zeta)."""
    zeta = 2.0**-40
    model = realisation("s", control.ss([[0, 1], [-1, -2 * zeta]], [[0], [1]], [[1, 0]], 0))
    found = exact_h2_energy(ExactModel.of(model))
    assert found.square == pytest.approx(1 / (4 * zeta), rel=1e-14)
    assert found.width < 1e-15


def test_what_cancels_has_no_energy():
    nothing = realisation("s", control.ss(-np.eye(2), [[1], [1]], [[1, -1]], 0))
    assert exact_h2_energy(ExactModel.of(nothing)) == EnergyBounds(0.0, 0.0, 0.0)


def test_the_width_is_relative():
    assert EnergyBounds(1.0, 0.9, 1.1).width == pytest.approx(0.1 / 1.1)
    assert EnergyBounds(0.0, 0.0, 0.0).width == 0.0
    assert EnergyBounds(0.0, 0.0, np.inf).width == np.inf
