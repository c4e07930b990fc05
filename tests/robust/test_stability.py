import control
import numpy as np
import pytest
from scipy.linalg import block_diag

import robustpolish as rp
from tests.robust.loops import covers, in_other_units, random_loop, singular


def check_random(seed):
    loop = random_loop(seed)
    margin = rp.robust_stability(loop)
    assert margin.lower <= margin.upper
    assert margin.proven
    assert covers(margin.intervals)
    if margin.witness:
        left, size = singular(loop, margin)
        assert left < 1e-8
        assert size == pytest.approx(margin.upper, rel=1e-7)
    for machine in loop.sample(3, seed=seed) if margin.lower > 1 else ():
        assert machine.poles().real.max() < 0


def batches(quick, slow, last):
    """Yield seeds one by one, then ranges of 50 that take long."""
    yield from (range(k, k + 1) for k in range(quick))
    yield range(quick, slow)
    yield from (pytest.param(range(k, k + 50), marks=pytest.mark.long)
                for k in range(slow, last, 50))  # fmt: skip


@pytest.mark.parametrize("seeds", list(batches(4, 10, 1010)))
def test_random_structures(seeds):
    for seed in seeds:
        check_random(seed)


@pytest.mark.parametrize("seed", [0, 3])
def test_machines_inside_the_margin_are_stable(seed):
    loop = random_loop(seed)
    margin = rp.robust_stability(loop)
    one, n = loop.matrices, loop.nstates
    random = np.random.default_rng(seed)
    for _ in range(20):
        delta = []
        for block in loop.blocks:
            p, q = block.element.shape
            own = random.standard_normal((p, q))
            own *= 0.999 * margin.lower / np.linalg.norm(own, 2)
            delta.append(np.kron(np.eye(block.copies), own))
        Delta = block_diag(*delta)
        inner = np.linalg.solve(np.eye(len(Delta)) - Delta @ one.F[n:, n:], Delta)
        A = one.F[:n, :n] + one.F[:n, n:] @ inner @ one.F[n:, :n]
        assert np.linalg.eigvals(A).real.max() < 0


def check_units(seed):
    loop = random_loop(seed)
    other, _ = in_other_units(loop, seed)
    first, second = rp.robust_stability(loop), rp.robust_stability(other)
    assert second.lower == pytest.approx(first.lower, rel=1e-6)
    assert second.upper == pytest.approx(first.upper, rel=1e-6)
    assert second.status == first.status
    if first.witness:
        # of a real number alone the same size may be reached at more than one frequency
        there = singular(other, second)
        assert there[0] < 1e-7
        assert there[1] == pytest.approx(first.upper, rel=1e-6)


@pytest.mark.parametrize("seeds", list(batches(4, 20, 220)))
def test_units_of_random_loops_do_not_matter(seeds):
    for seed in seeds:
        check_units(seed)


def test_discrete_loop():
    a = rp.uncertain.real("a", 0.5, plus_minus=0.2)
    loop = rp.uncertain.system([[a]], [[1]], [[1]], 0, dt=0.1)
    margin = rp.robust_stability(loop)
    assert margin.lower <= 2.5 <= margin.upper * (1 + 1e-9)
    assert margin.upper == pytest.approx(2.5, rel=1e-8)
    assert margin.witness["a"] == pytest.approx(1.0)
    assert margin.critical_frequency == pytest.approx(0, abs=1e-6)


def test_statuses_say_why():
    d = rp.uncertain.dynamics("d", bound=0.5)
    unstable = rp.robust_stability(control.ss([[1.0]], [[1.0]], [[1.0]], 0) * (1 + d))
    assert (unstable.status, unstable.lower, unstable.upper) == ("unstable", 0, 0)
    marginal = rp.robust_stability(control.ss([[0.0]], [[1.0]], [[1.0]], 0) * (1 + d))
    assert (marginal.status, marginal.upper) == ("marginal", 0)
    outside = rp.robust_stability(control.ss([[-1.0]], [[1.0]], [[1.0]], 0) * (1 + d))
    assert (outside.status, outside.lower, outside.robust) == ("unaffected", np.inf, True)
    assert covers(outside.intervals)
    assert "nominal" in unstable.reason


def test_a_loop_that_stops_being_well_posed():
    d = rp.uncertain.real("d", 0, plus_minus=1)
    loop = rp.feedback(control.ss([[-1.0]], [[1.0]], [[0.1]], [[-0.5]]) * d)
    margin = rp.robust_stability(loop)
    assert margin.upper == pytest.approx(2, rel=1e-9)
    assert margin.lower <= margin.upper <= 1.002 * margin.lower
    assert margin.critical_frequency == np.inf
    assert "not well posed" in margin.reason
    with pytest.raises(rp.InvalidInputError, match="well posed"):
        rp.feedback(control.ss([], [], [], [[-1.0]]) * (1 + 0 * d), 1)


@pytest.mark.parametrize(
    ("pole", "gain", "knee"),
    [(79.0473563236662, 1.5421218761345594, 187.58000190104764), (10.0, 1.0, 100.0)],
)
def test_a_witness_faster_than_all_poles_is_at_infinity(pole, gain, knee):
    """There 1 + gain r (1 + 5 e) = 0: with r = 1 + m/2 and e = -m it is a quadratic in m."""
    r = rp.uncertain.real("r", 1, percent=50)
    weight = 0.5 * rp.uncertain.dynamics("e") * control.tf([1, knee / 10], [0.1, knee])
    plant = control.ss([[-pole]], [[1]], [[-0.3 * pole]], [[1.0]])
    margin = rp.robust_stability((plant * r * (1 + weight) * gain).feedback())
    assert margin.upper == pytest.approx(max(np.roots([2.5, 4.5, -1 - 1 / gain]).real), rel=1e-6)
    assert margin.critical_frequency == np.inf


def test_a_number_that_only_adds_damping_both_ways():
    # (s + 1)(s + 2) + k^2: stable for all k, which is shown up to a thousand times what k may be
    k = rp.uncertain.real("k", 1, percent=50)
    margin = rp.robust_stability(rp.uncertain.system([[-1, k], [-k, -2]], [[0], [1]], [[1, 0]]))
    assert (margin.status, margin.upper, margin.proven) == ("no witness", np.inf, True)
    assert margin.lower == pytest.approx(1e3)
    assert margin.robust
    assert covers(margin.intervals)


def test_uncertainty_that_does_not_matter():
    k = rp.uncertain.real("k", 1, percent=50)
    # above the diagonal it is in no loop
    margin = rp.robust_stability(rp.uncertain.system([[-1, k], [0, -2]], [[0], [1]], [[1, 0]]))
    assert (margin.status, margin.lower, margin.upper) == ("unaffected", np.inf, np.inf)
    assert "acts back" in margin.reason
    certain = rp.robust_stability(rp.uncertain.system([[-1]], [[1]], [[1]]))
    assert (certain.status, certain.proven) == ("unaffected", True)


def test_a_number_that_no_size_of_makes_unstable():
    loop = random_loop(1019)
    margin = rp.robust_stability(loop)
    assert (margin.lower, margin.upper, margin.proven) == (np.inf, np.inf, True)
    element = loop.blocks[0].element
    for delta in (-1e6, -3.0, 7.0, 1e6):
        assert loop.at({element.name: element.value(delta)}).poles().real.max() < 0


@pytest.mark.parametrize("damping", [1e-1, 1e-2, 1e-4])
def test_narrow_resonances_are_reached(damping):
    # The largest gain of 0.1 / (s^2 + c s + 4) is at 2 rad/s nearly, 0.05 / c.
    resonance = control.ss([[0, 1], [-4, -damping]], [[0], [0.1]], [[1, 0]], 0)
    margin = rp.robust_stability(rp.feedback(1, resonance * rp.uncertain.dynamics("d")))
    assert margin.upper <= 1.002 * margin.lower
    assert margin.lower <= 1 / rp.hinf_norm(resonance).value * (1 + 1e-8) <= margin.upper * 1.0001


def test_no_uncertain_system():
    with pytest.raises(rp.InvalidInputError, match="UncertainSystem"):
        rp.robust_stability(control.ss([[-1.0]], [[1.0]], [[1.0]], 0))
