import numpy as np
import pytest

import robustpolish as rp
from robustpolish.plants.uncertain.elements import RealElement, UncertainBlock
from robustpolish.plants.uncertain.lft import (
    Lft,
    block_diagonal,
    block_slices,
    common_time,
    constant,
    inverse,
    product,
    pull_out_block,
    reduce_copies,
    total,
)


def number():
    one, k = np.ones((1, 1)), RealElement("k", 2.0, 1.0, 3.0)
    return Lft(0 * one, one, one, 2 * one, (), (UncertainBlock(k, 1),))


def value(one, delta):
    """Close all copies of the only block with a delta."""
    inner = np.linalg.solve(np.eye(len(one.F)) - delta * one.F, delta * one.G)
    return one.J + one.H @ inner


@pytest.mark.parametrize("delta", [-1.0, 0.0, 0.7])
def test_algebra(delta):
    k = 2 + delta
    assert value(total(number(), number()), delta) == pytest.approx(2 * k)
    assert value(product(number(), number()), delta) == pytest.approx(k**2)
    assert value(inverse(number()), delta) == pytest.approx(1 / k)
    assert value(block_diagonal([number(), constant(np.eye(1))]), delta) == pytest.approx(
        np.diag([k, 1.0])
    )


def test_difference_is_nothing():
    minus = product(constant(-np.eye(1)), number())
    assert total(number(), minus).blocks == ()


def test_exposed_signals_come_first():
    opened = pull_out_block(number(), 0)
    np.testing.assert_allclose(opened.J, [[0, 1], [1, 2]])
    assert opened.blocks == ()


def test_slices():
    both = product(number(), number())
    z, w = block_slices(both)[0]
    assert z.tolist() == w.tolist() == [0, 1]
    assert reduce_copies(both).blocks[0].copies == 2


def test_times():
    one = constant(np.eye(1))
    assert common_time(one, one) is None
    discrete = Lft(one.F, one.G, one.H, one.J, (), (), 0.1)
    assert common_time(one, discrete) == 0.1
    assert common_time(Lft(one.F, one.G, one.H, one.J, (), (), True), discrete) == 0.1
    with pytest.raises(rp.InvalidInputError, match="sampling time"):
        common_time(Lft(one.F, one.G, one.H, one.J, (), (), 0), discrete)
