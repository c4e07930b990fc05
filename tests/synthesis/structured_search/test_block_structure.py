"""Blocks as a structure: what cannot work is refused, and what K becomes."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InfeasibleError
from robustpolish.synthesis.problem.scaling import whole_plant
from robustpolish.synthesis.structured.block_structure import BlockStructure
from robustpolish.synthesis.structured.block_wiring import place_blocks


def loop(numerator, denominator=(1.0, 0.4, 4.0)):
    G = control.tf(numerator, list(denominator), inputs="F", outputs="x")
    return rp.GeneralizedPlant.from_loop(G, units={"F": "N", "x": "m"})


def problem(plant, blocks, norm="hinf"):
    return BlockStructure(norm, place_blocks(blocks, plant)).problem(whole_plant(plant))


def test_an_integrator_needs_a_plant_that_passes_constants():
    with pytest.raises(InfeasibleError, match=r"integrators of pid_x: .* a mode at 0"):
        problem(loop([1.0, 0.0]), rp.tunable.pid("x"))


def test_two_integrators_on_one_signal_are_too_many():
    with pytest.raises(InfeasibleError, match="integrators of pid_x and pid_x_F"):
        problem(loop([1.0]), [rp.tunable.pid("x", kind="I"), rp.tunable.pid("x", kind="PI")])


def test_modes_that_blocks_do_not_reach_are_named():
    A = np.diag([1.0, -1.0])
    G = control.StateSpace(A, np.eye(2), np.eye(2), 0, inputs=["a", "b"], outputs=["p", "q"])
    with pytest.raises(InfeasibleError, match="no gain moves the mode"):
        problem(rp.GeneralizedPlant.from_loop(G), rp.tunable.pid("q", "b"))


def test_feedthrough_and_the_h2_norm():
    matrices = [[-1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]]
    plant = rp.GeneralizedPlant.from_matrices(*matrices, D12=[[0.0], [1.0]], D21=[[0.0, 1.0]])
    with pytest.raises(
        InfeasibleError, match=r"The blocks pass .* rp.tunable.low_pass\(\) in series"
    ):
        problem(plant, rp.tunable.pid(), "h2")
    assert problem(plant, rp.tunable.pid() * rp.tunable.low_pass(order=1), "h2").order == 3
    with pytest.raises(InfeasibleError, match=r"passes w straight to z \(D11\)"):
        problem(loop([1.0]), rp.tunable.pid("x") * rp.tunable.low_pass(), "h2")


def test_single_entries_are_searched_as_a_static_gain_is():
    whole = problem(loop([1.0]), rp.tunable.fixed_order(order=2))
    assert whole.bounds is None
    assert len(whole.starts) == 4
    assert (
        problem(loop([1.0]), rp.tunable.fixed_order(order=2) * rp.tunable.notch()).bounds
        is not None
    )
