"""The search part by part: closed forms in the plant's units, equal parts, refusals."""

import numpy as np
import pytest

from robustpolish.base.budget import Budget
from robustpolish.errors import SolverError
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.problem.pole_regions import HalfPlane
from robustpolish.synthesis.state_feedback.lmi import LmiStateEngine
from robustpolish.synthesis.state_feedback.riccati import RiccatiStateEngine
from robustpolish.synthesis.state_feedback.search import solve_parts


def lag(a=-1.0, price=1.0, force=1.0, watched=1.0, state="x"):
    """X' = a x + w + force u, z = (watched x, price u)."""
    return GeneralizedPlant.from_matrices(
        [[a]],
        [[1.0]],
        [[force]],
        [[watched], [0.0]],
        [[1.0]],
        D12=[[0.0], [price]],
        states=[state],
    )


def solve(*plants, norm: Norm = "hinf", gain_bound=None, budget=None, regions=(), engine=None):
    engine = (engine or RiccatiStateEngine)(norm, regions=regions)
    return solve_parts(plants, engine, 1e-4, gain_bound, budget or Budget())


def test_an_optimum_in_closed_form_is_reached_and_proven():
    # sqrt(1 + k^2)/(1 + k) is least for k = 1.
    (found,) = solve(lag())
    assert found.status == "optimal"
    assert found.achieved == pytest.approx(np.sqrt(0.5), rel=1e-4)
    assert np.sqrt(0.5) * (1 - 1e-4) < found.lower_bound <= np.sqrt(0.5) * (1 + 1e-9)
    # The regulator of x' = x + u: k = 1 + sqrt(2), and the squared norm is the same number.
    (found,) = solve(lag(a=1.0), norm="h2")
    assert found.achieved**2 == pytest.approx(1 + np.sqrt(2), rel=1e-6)
    assert found.F.item() == pytest.approx(-(1 + np.sqrt(2)), rel=1e-6)


@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_answers_are_in_the_units_of_the_plant(norm):
    (plain,) = solve(lag(), norm=norm)
    # Time in ms, u in mN, z in um.
    (other,) = solve(
        GeneralizedPlant.from_matrices(
            [[-1e-3]], [[1e-3]], [[1e-6]], [[1e6], [0.0]], [[1.0]], D12=[[0.0], [1e3]]
        ),
        norm=norm,
    )
    unit = 1e6 if norm == "hinf" else 1e6 / np.sqrt(1e3)
    assert other.F.item() == pytest.approx(1e3 * plain.F.item(), rel=0.05)
    assert other.achieved == pytest.approx(unit * plain.achieved, rel=1e-4)
    assert other.lower_bound == pytest.approx(unit * plain.lower_bound, rel=1e-4)
    assert other.history[0]["achieved"] == pytest.approx(other.achieved, rel=0.05)


def test_equal_parts_are_solved_once():
    single, double = Budget(), Budget()
    solve(lag(), budget=single)
    found = solve(lag(), lag(), budget=double)
    assert found[0] is found[1]
    assert double.spent == single.spent > 0


def test_a_part_in_which_nothing_happens_is_only_stabilised():
    # The least effort for x' = 2 x + u moves the pole to -2; z has nothing but zeros.
    idle, asleep = solve(lag(a=2.0, price=0.0, watched=0.0), lag(a=-2.0, price=0.0, watched=0.0))
    assert idle.status == asleep.status == "optimal"
    assert idle.F.item() < -2.0
    assert (idle.achieved, asleep.achieved) == (0.0, 0.0)
    assert asleep.F.item() == 0.0


def test_a_part_that_vanishes_beside_the_others_is_not_driven_to_zero():
    # Alone the free lag falls to 1e-4 of its own norm, 1; beside one of 100 to 1e-4 of that.
    (alone,) = solve(lag(price=0.0))
    beside, large = solve(lag(price=0.0), lag(price=0.0, watched=100.0))
    assert alone.status == beside.status == "infimum_not_attained"
    assert alone.achieved <= 1e-4
    assert 2e-3 < beside.achieved <= 1e-2
    assert large.achieved <= 1e-2


def test_regions_are_kept_and_nothing_is_called_optimal():
    (found,) = solve(lag(), regions=(HalfPlane(-4.0),), engine=LmiStateEngine)
    # k > 3 with sqrt(1 + k^2)/(1 + k) rising there.
    assert found.F.item() <= -3.0
    assert found.status == "suboptimal"
    assert found.achieved == pytest.approx(np.sqrt(10) / 4, rel=1e-3)
    assert found.lower_bound <= np.sqrt(0.5) * (1 + 1e-9)


def test_refusals_name_the_states_and_the_way_out():
    with pytest.raises(SolverError, match=r"with the states depth\. Try the other method"):
        solve(lag(a=1.0, force=0.0, price=0.0, state="depth"))
    with pytest.raises(SolverError, match=r"at most 0\.5 was found.*Raise gain_bound"):
        solve(lag(a=1.0), gain_bound=0.5)
    late = Budget(seconds=0.0)
    with pytest.raises(SolverError, match="Raise time_limit"):
        solve(lag(a=1.0, price=0.0), budget=late)
