"""Public examples with answers: both bounds, their proof and witness, and how long they take.

Among them the witnesses in 50 digits, and the bounds against those of SLICOT on a grid.
"""

import time

import numpy as np
import pytest

import robustpolish as rp
from tests.reference.examples import blocks_and_matrix, carts, column, coprime_loop, damper, servo
from tests.robust.fifty_digits import distance, gain
from tests.robust.loops import covers, singular


def spent(call):
    """Seconds of the processor and the result, without what only the first call has to do."""
    call()
    start = time.process_time()
    found = call()
    return time.process_time() - start, found


@pytest.mark.parametrize(
    ("make", "lowest", "highest", "frequency"),
    [
        (servo, 1.5981 - 5e-4, 1.5997, 4.87),
        (damper, 1.0 - 1e-9, 1.0 + 1e-9, 1.0),
        # published is 2.8835 to 2.8864; branching stops at a gap of 0.1 %
        (carts, 2.8833, 2.8865, 575.0),
    ],
)
def test_margins(make, lowest, highest, frequency):
    seconds, margin = spent(lambda: rp.robust_stability(make()))
    assert lowest <= margin.lower <= margin.upper <= highest
    assert margin.upper <= 1.002 * margin.lower
    assert margin.status == "bracketed"
    assert margin.proven
    assert covers(margin.intervals)
    assert margin.critical_frequency == pytest.approx(frequency, rel=5e-3)
    assert seconds <= 2.0
    check_witness(make(), margin)
    # the witness is as large as it says, and really puts a pole on the axis
    left, size = singular(make(), margin)
    assert left < 1e-9
    assert size == pytest.approx(margin.upper, rel=1e-9)


def check_witness(loop, margin):
    assert distance(loop, margin.witness) <= 1e-8
    for block in loop.blocks:
        value = margin.witness[block.element.name]
        if block.element.kind == "real":
            assert abs(block.element.delta(value)) <= margin.upper * (1 + 1e-12)
        else:
            assert rp.hinf_norm(value).value <= margin.upper * (1 + 1e-12)


def test_distillation_column():
    seconds, margin = spent(lambda: rp.robust_performance(column()))
    low, high = margin.mu
    # published is 5.7818 to 5.7876
    assert 5.7817 <= low <= high <= 5.7876
    assert high <= 1.002 * low
    assert margin.proven
    assert covers(margin.intervals)
    assert seconds <= 5.0
    # 1 / upper is the gain of the witness, whose blocks are within upper
    assert gain(column(), margin.witness, margin.critical_frequency) == pytest.approx(
        1 / margin.upper, rel=1e-8
    )
    for value in margin.witness.values():
        assert rp.hinf_norm(value).value <= margin.upper * (1 + 1e-12)


def test_stability_of_the_column():
    margin = rp.robust_stability(column())
    assert 1.898 < margin.lower <= margin.upper < 1.901
    check_witness(column(), margin)


def test_coprime_factors():
    # one full block: the norm from errors of the factors, whose least value is 1.98835
    mu = rp.structured_singular_value(coprime_loop(), [("full", (2, 2))])
    assert mu.upper >= 1.98835 * (1 - 1e-5)
    assert mu.lower <= mu.upper <= 1.002 * mu.lower
    assert mu.proven


@pytest.mark.parametrize("seed", range(10))
def test_slicot_agrees_on_random_structures(seed):
    slycot = pytest.importorskip("slycot")
    blocks, sizes, M = blocks_and_matrix(700 + seed)
    given = [("full", k) if kind == "full" else kind for kind, k in zip(blocks, sizes, strict=True)]
    mu = rp.structured_singular_value(M, given)
    codes = np.array([1 if kind == "real" else 2 for kind in blocks])
    bound = slycot.ab13md(M, np.array(sizes), codes)[0]
    assert mu.proven
    assert mu.lower <= bound * (1 + 1e-6)
    assert mu.upper == pytest.approx(bound, rel=1e-3)


def test_a_grid_misses_what_intervals_do_not():
    slycot = pytest.importorskip("slycot")
    loop = carts()
    M = loop.interconnection[:3, :3]
    grid = [
        slycot.ab13md(np.atleast_2d(M(1j * w)), np.ones(3, int), np.ones(3, int))[0]
        for w in np.logspace(-2, 4, 500)
    ]
    margin = rp.robust_stability(loop)
    assert max(grid) < 1 / margin.upper <= 1 / margin.lower
