"""Coupled runs: the rigid limit, complaints, and what the check says."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError, RobustPolishWarning, SolverError
from robustpolish.polishing.coupled import (
    LinearMachine,
    guided_brush,
    integrate_coupled,
    run_coupled,
)
from tests.brush.coupled.test_machine import springs


@pytest.mark.parametrize("disc", ["two-angle", "three-angle"])
def test_on_a_rigid_machine_the_brush_goes_as_without(disc):
    brush = rp.simulate_brush(run=2, duration=0.05, disc=disc)
    soft = springs()
    rigid = LinearMachine(soft.A, 1e-9 * soft.B, soft.g, soft.C)
    run, _ = integrate_coupled(guided_brush(brush), rigid, 4)
    assert run is not None
    forces = np.stack([-brush.F_x, -brush.F_y, brush.F_z], axis=1)
    np.testing.assert_allclose(run.forces, forces, atol=0.01 * 10.0)
    change = np.cumsum(run.forces - forces, axis=0) / 20e3
    assert np.abs(change).max() < 2e-3 * 10.0 * 0.05


def test_passes_agree_and_are_counted():
    guided = guided_brush(rp.simulate_brush(run=1, duration=0.02))
    _, states, check = run_coupled(guided, springs(), tolerance=1e-3, max_passes=4)
    assert (check.converged, check.passes) == (True, 2)
    assert states.shape == (401, 6)
    with pytest.warns(RobustPolishWarning, match="passes differ"):
        run_coupled(guided, springs(), tolerance=1e-14, max_passes=2)


def test_an_unstable_machine_is_told():
    guided = guided_brush(rp.simulate_brush(run=1, duration=0.02))
    good = springs()
    A = good.A.copy()
    A[1::2, 1::2] = 2e5 * np.eye(3)
    with pytest.raises(SolverError, match="swing up"):
        run_coupled(guided, LinearMachine(A, good.B, good.g, good.C), tolerance=1e-3, max_passes=2)


def test_runs_of_the_listing_are_refused():
    with pytest.raises(InvalidInputError, match="run of the physical brush"):
        guided_brush(rp.simulate_brush("listing", 1, 0.01))
