import numpy as np
import pytest

import robustpolish as rp
from robustpolish.robust.loop_model import DeltaBlock, DeltaStructure
from robustpolish.synthesis.uncertain.scaled_gain import grid, mu_bounds


def test_levels_are_those_of_the_matrices():
    random = np.random.default_rng(0)
    structure = DeltaStructure(
        (DeltaBlock("real"), DeltaBlock("complex"), DeltaBlock("full", 1, 2, 2))
    )
    M = random.standard_normal((3, 4, 4)) + 1j * random.standard_normal((3, 4, 4))
    found = mu_bounds(structure, np.arange(3.0), M)
    blocks = ["real", "complex", ("full", 2)]
    for one, value in zip(M, found.values, strict=True):
        assert value == pytest.approx(rp.structured_singular_value(one, blocks).upper, rel=2e-3)
    quick = mu_bounds(structure, np.arange(3.0), M, best=False)
    assert (quick.values >= found.values * (1 - 1e-6)).all()
    assert found.diagonals().shape == (3, 3)
    assert found.diagonals()[:, -1] == pytest.approx(np.ones(3))


def test_grid_covers_the_rates_and_both_ends():
    omega = grid([np.array([-1.0, -0.01 + 40j])])
    assert omega[0] == 0
    assert np.isinf(omega[-1])
    inner = omega[1:-1]
    assert inner[0] < 0.1 < 1000 < inner[-1]
    assert (inner[1:] / inner[:-1]).max() < 1.4
    assert np.abs(inner / 40 - 1).min() < 0.02
