import numpy as np
import pytest

import robustpolish as rp
from robustpolish.linear.arithmetic.balls import midpoint
from robustpolish.robust.branch_and_bound import can_branch, can_split, moved, split
from robustpolish.robust.loop_model import LoopModel
from tests.robust.loops import carts, column, random_loop

# two real numbers, one complex one twice, eleven states: 3 % apart without branching
SEED = 122


def test_which_loops():
    loop = LoopModel.of(random_loop(SEED))
    assert can_split(loop)
    assert not can_branch(loop)
    assert not can_split(LoopModel.of(carts()))  # real numbers alone
    assert not can_split(LoopModel.of(column()))


def test_a_moved_loop_is_that_around_the_numbers():
    loop = LoopModel.of(random_loop(SEED))
    structure = loop.structure
    real = [k for k, block in enumerate(structure.blocks) if block.kind == "real"]
    centre, reach, deltas = np.array([0.1, -0.2]), np.array([0.05, 0.1]), np.array([0.7, -0.4])
    part = moved(loop, real, centre, reach)

    def closed(one, numbers):
        """What the other block sees."""
        gains = np.zeros(structure.shape[::-1])
        for k, number in zip(real, numbers, strict=True):
            w, z = structure.outputs[k], structure.inputs[k]
            gains[w, z] = number * np.eye(structure.blocks[k].copies)
        M = one.response(one.angle(0.7))[0]
        whole = M @ np.linalg.inv(np.eye(len(gains)) - gains @ M)
        return whole[structure.inputs[1], structure.outputs[1]]

    expected = closed(loop, centre + reach * deltas)
    np.testing.assert_allclose(closed(part, deltas), expected, rtol=1e-9)
    np.testing.assert_allclose(midpoint(part.balls[1]), part.model.B)


def test_both_bounds_are_drawn_together():
    system = random_loop(SEED)
    margin = rp.robust_stability(system)
    assert (margin.status, margin.proven) == ("bracketed", True)
    assert margin.lower <= margin.upper <= 1.002 * margin.lower
    # and what is proven holds for machines just inside
    for machine in system.sample(20, seed=1) if margin.lower > 1 else ():
        assert machine.poles().real.max() < 0


def spring():
    """A spring that is known to 30 %, and two gains that are known to 10 %."""
    k = rp.uncertain.real("k", 4, percent=30)
    plant = rp.uncertain.system([[0, 1], [-k, -0.4]], [[0], [1]], [[1, 0]])
    first, second = (rp.uncertain.dynamics(name, bound=0.1) for name in ("first", "second"))
    return rp.feedback(plant * (1 + first), 0.5 * (1 + second))


def test_nothing_is_proven_beyond_a_witness():
    loop, margin = LoopModel.of(spring()), rp.robust_stability(spring())
    size = margin.upper * loop.gain
    # a witness is said to be a tenth larger than one that there is
    assert split(loop, None, 0.0, 1.1 * size, 1e-3, lambda numbers, at: 1.1 * size) <= size


@pytest.mark.parametrize("gap", [2e-3, 2e-2])
def test_worst_gain_beside_two_dynamics(gap):
    loop = spring()
    worst = rp.worst_case_gain(loop, gap=gap)
    assert worst.proven
    assert worst.lower <= worst.upper <= (1 + 1.01 * gap) * worst.lower
    assert max(rp.hinf_norm(one).value for one in loop.sample(10)) <= worst.upper
