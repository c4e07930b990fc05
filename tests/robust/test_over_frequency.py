"""Bounds over frequency, what blocks cost, and machines at the witness."""

import math

import control
import numpy as np
import pytest

import robustpolish as rp

s = control.tf("s")
CONTROLLER = 2.3 + 3 / s + 0.38 * s / (0.001 * s + 1)


def pid_loop(percent=40.0, share=0.5):
    """A spring known to some percent, a gain that is off by a share at any frequency, and a PID."""
    k = rp.uncertain.real("k", 10, percent=percent)
    plant = rp.uncertain.system([[0, 1], [-k, -1.8]], [[0], [18]], [[1, 0]])
    plant = plant * (1 + share * rp.uncertain.dynamics("delta"))
    return (plant * CONTROLLER).feedback()


@pytest.fixture(scope="module")
def margin():
    return rp.robust_stability(pid_loop())


def lines(ax):
    return {line.get_label(): np.array(line.get_data()) for line in ax.get_lines()}


def test_curves_stay_below_the_proven_level_and_reach_it(margin):
    drawn = lines(margin.plot())
    below, above = drawn["at least"][1], drawn["at most"][1]
    known = np.isfinite(below)
    assert known.sum() > 20
    assert (below[known] <= above[known] * (1 + 1e-6)).all()
    level = drawn["proven"][1][0]
    assert level == pytest.approx(1 / margin.lower)
    assert np.nanmax(above) <= level
    assert np.nanmax(above) >= 0.995 * level
    mark = drawn["critical frequency"]
    assert mark[0, 0] == pytest.approx(margin.critical_frequency / (2 * math.pi))
    assert mark[1, 0] == pytest.approx(1 / margin.upper)


def test_sensitivity_is_what_a_larger_range_costs(margin):
    shares = margin.sensitivity
    assert sum(shares.values()) == pytest.approx(1.0, abs=0.02)
    # The same loops with one range or the other a tenth larger.
    changed = {
        "k": rp.robust_stability(pid_loop(percent=44.0)),
        "delta": rp.robust_stability(pid_loop(share=0.55)),
    }
    for name, other in changed.items():
        measured = math.log(margin.upper / other.upper) / math.log(1.1)
        assert shares[name] == pytest.approx(measured, abs=0.05)


def test_the_machine_at_the_witness_is_on_the_boundary(margin):
    poles = margin.worst_plant().poles()
    nearest = poles[np.argmin(np.abs(poles - 1j * margin.critical_frequency))]
    assert abs(nearest.real) < 1e-6 * abs(nearest)


def test_the_worst_machine_has_the_worst_gain():
    c = rp.uncertain.real("c", 0.4, percent=50)
    gain = rp.uncertain.complex("gain", 1.0, radius=0.2)
    mass = rp.uncertain.system([[0, 1], [-1, -c]], [[0], [1]], [[1, 0]]) * gain
    worst = rp.worst_case_gain(mass)
    machine = worst.worst_plant()
    assert float(rp.hinf_norm(machine)) == pytest.approx(worst.lower, rel=1e-6)
    assert isinstance(worst.witness["gain"], complex)
    drawn = lines(worst.plot())
    assert np.nanmax(drawn["at most"][1]) == pytest.approx(worst.upper, rel=5e-3)
    # A gain is in proportion to 1.2, of which 0.2 are uncertain.
    assert worst.sensitivity["gain"] == pytest.approx(1 / 6, abs=0.02)
    assert set(worst.sensitivity) == {"c", "gain"}


def test_values_of_systems_and_of_matrices():
    M = control.ss([[0, 1], [-4, -0.1]], [[0], [1]], [[1, 0]], 0)
    mu = rp.structured_singular_value(M, ["complex"])
    drawn = lines(mu.plot())
    true = np.abs(M(2j * np.pi * drawn["at most"][0]))
    assert drawn["at most"][1] == pytest.approx(true, rel=1e-4)
    assert mu.sensitivity == {"complex_0": pytest.approx(1.0, abs=1e-4)}
    with pytest.raises(rp.InvalidInputError, match="no loop behind it"):
        rp.structured_singular_value([[1.0]], ["complex"]).plot()


def test_performance_draws_itself_and_without_a_loop_there_is_no_picture():
    error = rp.uncertain.dynamics("error", bound=0.2)
    loop = rp.feedback(control.ss([[-1.0]], [[2.0]], [[1.0]], 0) * (1 + error))
    found = rp.robust_performance(loop, gamma=1.0)
    assert lines(found.plot())["proven"][1][0] == pytest.approx(found.mu[1])
    assert found.worst_plant().nstates >= 1
    c = rp.uncertain.real("c", -1.0, percent=10)
    unstable = rp.robust_stability(rp.uncertain.system([[0, 1], [-1, -c]], [[0], [1]], [[1, 0]]))
    with pytest.raises(rp.InvalidInputError, match="status"):
        unstable.plot()
