"""Frequencies that show all of a system."""

import numpy as np
import pytest

from robustpolish.linear.norms.singular_values import frequency_grid


def test_a_decade_beyond_the_outermost_poles():
    grid = frequency_grid(np.array([-2.0, -500.0 + 0j]))
    assert (grid[0], grid[-1]) == (pytest.approx(0.2), pytest.approx(5000))
    assert (np.diff(grid) > 0).all()


def test_resonances_are_dense_whatever_their_width():
    pole = -1e-8 + 7j
    grid = frequency_grid(np.array([pole, pole.conjugate(), 0.0, np.inf]))
    assert np.sum(np.abs(grid - 7) < 1e-6) > 10
    assert grid[0] > 0


def test_nothing_lies_above_nyquist():
    assert frequency_grid(np.array([-50.0 + 40j]), 60.0).max() == pytest.approx(60.0)
    assert frequency_grid(np.zeros(0)).size > 100
