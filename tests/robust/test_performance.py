import control
import numpy as np
import pytest

import robustpolish as rp
from tests.reference.examples import damper, servo
from tests.robust.loops import covers, in_other_units, random_loop


def test_gain_of_the_witness():
    loop = servo()
    margin = rp.robust_performance(loop, gamma=2.0)
    machine = loop.at(margin.witness)
    gain = abs(complex(machine(1j * margin.critical_frequency)))
    assert gain == pytest.approx(2.0 / margin.upper, rel=1e-6)
    assert margin.upper <= 1.002 * margin.lower


def test_worst_case_gain():
    loop = servo()
    worst = rp.worst_case_gain(loop)
    assert worst.lower <= worst.upper <= 1.002 * worst.lower
    assert worst.proven
    assert covers(worst.intervals)
    machine = loop.at(worst.witness)
    assert machine.poles().real.max() < 0
    assert rp.hinf_norm(machine).value == pytest.approx(worst.lower, rel=1e-4)
    assert 6 <= worst.witness["k"] <= 14
    assert rp.hinf_norm(worst.witness["delta"]).value <= 1 + 1e-6
    assert max(rp.hinf_norm(one).value for one in loop.sample(10)) <= worst.upper
    assert worst.nominal == pytest.approx(rp.hinf_norm(loop.nominal).value)


def test_worst_gain_where_a_machine_is_unstable():
    worst = rp.worst_case_gain(damper())
    assert worst.lower == worst.upper == np.inf
    assert worst.status == "unstable"
    assert worst.witness["c"] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("find", [rp.worst_case_gain, rp.robust_performance])
@pytest.mark.parametrize(
    "seed",
    [seed if seed in (3, 35) else pytest.param(seed, marks=pytest.mark.long) for seed in range(60)],
)
def test_units_of_random_loops_do_not_matter(seed, find):
    loop = random_loop(seed)
    first, second = find(loop), find(in_other_units(loop, seed)[0])
    assert second.lower == pytest.approx(first.lower, rel=1e-6)
    assert second.upper == pytest.approx(first.upper, rel=1e-6)
    assert second.status == first.status


def test_statuses_say_why():
    d = rp.uncertain.dynamics("d", bound=0.5)
    unstable = control.ss([[1.0]], [[1.0]], [[1.0]], 0) * (1 + d)
    marginal = control.ss([[0.0]], [[1.0]], [[1.0]], 0) * (1 + d)
    for question in (rp.robust_performance, rp.worst_case_gain):
        assert "nominal loop is unstable" in question(unstable).reason
        assert question(marginal).status == "marginal"
        assert "on the boundary" in question(marginal).reason
    assert (rp.robust_performance(marginal).lower, rp.robust_performance(marginal).upper) == (0, 0)
    assert rp.worst_case_gain(marginal).upper == np.inf
    # the nominal damper is stable, the one without damping is not
    assert "machine within the bounds" in rp.worst_case_gain(damper()).reason
    assert "proven above" in rp.worst_case_gain(servo()).reason


def test_uncertainty_that_does_not_matter():
    k = rp.uncertain.real("k", 1, percent=50)
    loop = rp.uncertain.append(control.ss([[-1.0]], [[1.0]], [[1.0]], 0), 0.1 * k)
    worst = rp.worst_case_gain(loop)
    assert worst.lower == pytest.approx(1)
    assert worst.lower <= worst.upper <= 1.002 * worst.lower
    nothing = control.ss([[-1.0]], [[1.0]], [[0.0]], 0) * (1 + k)
    assert rp.worst_case_gain(nothing).lower == 0
    # scalings never prove 0, only less and less
    assert rp.worst_case_gain(nothing).upper < 1e-4


def test_bad_input():
    with pytest.raises(rp.InvalidInputError, match="gamma"):
        rp.robust_performance(servo(), gamma=-1.0)
    with pytest.raises(rp.InvalidInputError, match="UncertainSystem"):
        rp.worst_case_gain(1.0)
