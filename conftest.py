"""For the tests and for the examples in docstrings alike."""

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest

mpl.use("Agg")


@pytest.fixture(autouse=True)
def figures_are_closed():
    """Close what a test or an example drew: matplotlib warns of many open figures."""
    yield
    plt.close("all")
