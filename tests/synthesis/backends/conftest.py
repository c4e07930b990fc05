"""Programs whose solution is seen at once, for every backend."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from robustpolish.synthesis.lmi.program import ConicForm

# The stacked columns of [[x0, x1], [x1, x0]].
SYMMETRIC = csr_array(np.array([[1.0, 0, 0], [0, 1, 0], [0, 1, 0], [1, 0, 0]]))


@pytest.fixture
def form():
    """Least x0 with [[x0, x1], [x1, x0]] >= 0, x1 >= 2 and x1 + x2 = 1: x = (2, 2, -1)."""
    return ConicForm(
        np.array([1.0, 0.0, 0.0]),
        psd=((2, SYMMETRIC, np.zeros(4)),),
        nonnegative=((csr_array([[0.0, 1.0, 0.0]]), np.array([-2.0])),),
        zero=((csr_array([[0.0, 1.0, 1.0]]), np.array([-1.0])),),
    )


@pytest.fixture
def contradiction():
    """Ask the same matrix to be positive, and x0 to be at most -1."""
    return ConicForm(
        np.array([1.0, 0.0, 0.0]),
        psd=((2, SYMMETRIC, np.zeros(4)),),
        nonnegative=((csr_array([[-1.0, 0.0, 0.0]]), np.array([-1.0])),),
    )
