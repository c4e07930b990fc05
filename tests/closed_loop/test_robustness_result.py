"""What a check over many machines says."""

import numpy as np
import pytest

import robustpolish as rp


def check(norms, left_out=()):
    norms = np.array(norms)
    masses = np.arange(1.0, norms.size + 1)[:, None]
    return rp.results.RobustnessCheck(
        "hinf", 1.0, norms, ("dof.x.mass",), masses, np.array([1.0]), left_out
    )


def test_the_least_share_is_the_exact_bound_of_clopper_and_pearson():
    """With all of n stable, the share p at which p^n is 5 %; with none of them, nothing."""
    assert check([1.0] * 59).least_share_stable == pytest.approx(0.05 ** (1 / 59))
    assert check([1.0, np.inf]).least_share_stable == pytest.approx(1 - 0.95**0.5)
    assert check([np.inf, np.inf]).least_share_stable == 0.0


def test_the_worst_machine_is_named():
    found = check([0.9, 3.0, 1.2])
    assert (found.samples, found.share_stable) == (3, 1.0)
    assert (found.median, found.worst) == (1.2, 3.0)
    assert found.worst_parameters == {"dof.x.mass": 2.0}


def test_the_picture_leaves_unstable_loops_out_and_says_so():
    ax = check([0.9, 1.1, np.inf, 1.2]).plot()
    assert sum(bar.get_height() for bar in ax.patches) == 3
    assert ax.get_title() == "1 of 4 unstable"
    assert check([0.9]).plot().get_title() == ""


def test_the_card_tells_what_was_not_drawn():
    text = str(check([0.9, np.inf], ("spring[0].stiffness",)))
    assert "50 %" in text
    assert "Not drawn, because not determined: spring[0].stiffness." in text
    assert "Not drawn" not in str(check([0.9]))


def test_limits_hold_as_often_as_they_say():
    # Norms evenly between 0 and 1 stand for any distribution: the share within r is r.
    random, held, worst = np.random.default_rng(0), 0, 0
    for _ in range(2000):
        one = check(random.uniform(size=30))
        held += one.least_share_within(0.8, 0.9) <= 0.8
        worst += one.least_share_within(one.worst) <= one.worst
    assert held / 2000 > 0.9 - 0.02
    assert worst / 2000 == pytest.approx(0.95, abs=0.015)


def test_upper_limit_of_the_share():
    assert check([1.0] * 3).most_share_stable == 1.0
    assert check([1.0, np.inf]).most_share_stable == pytest.approx(0.95**0.5)
    with pytest.raises(rp.InvalidInputError, match="between 0 and 1"):
        check([1.0]).least_share_within(1.0, 95)
