"""The driver of prescribed structures: arguments, parts, verdicts."""

import numpy as np
import pytest
from small_plants import oscillator

from robustpolish.base.budget import Budget
from robustpolish.errors import InfeasibleError, InvalidInputError, SolverError
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.problem.scaling import decoupled_parts
from robustpolish.synthesis.structured.methods import (
    StructuredOptions,
    checked_bound,
    design_structured,
)
from robustpolish.synthesis.structured.search import POLICY
from robustpolish.synthesis.structured.structures import StaticStructure


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("h3", 1.0, 0), "norm"),
        (("h2", 0.0, 0), "time_limit"),
        (("hinf", 1.0, 0, -1.0), "target"),
    ],
)
def test_bad_arguments_are_named(arguments, named):
    with pytest.raises(InvalidInputError, match=rf"^{named}: "):
        StructuredOptions.checked(*arguments)
    with pytest.raises(InvalidInputError, match=r"^gain_bound: "):
        checked_bound(0.0)


def test_work_is_limited_on_every_machine():
    orders = StructuredOptions.checked("h2", 5.0, 3)
    assert (orders.budget.work, orders.budget.seconds) == (POLICY.work, 5.0)
    assert (orders.seed, orders.target) == (3, 0.0)
    assert checked_bound(None) is None


def lags(rates, price=1.0, controls=None):
    """X' = -a x + w + u for each rate a, z = x and the priced u, y = x."""
    n = len(rates)
    eye, none = np.eye(n), np.zeros((n, n))
    B2 = eye if controls is None else eye[:, controls]
    nu = B2.shape[1]
    return GeneralizedPlant.from_matrices(
        -np.diag(rates),
        eye,
        B2,
        np.vstack([eye, none]),
        eye,
        D12=np.vstack([none[:, :nu], price * eye[:, :nu]]),
    )


def design(plant, norm: Norm = "hinf", mask=None, budget=None):
    structure = StaticStructure(norm, mask=mask)
    parts = decoupled_parts(plant, mask)
    orders = StructuredOptions(budget or Budget(600.0), 0)
    return design_structured(plant, plant, parts, structure, norm, orders)


def test_parts_are_designed_alone_and_certified_together():
    found = design(lags([1.0, 2.0]))
    # u = -k x: sqrt(1 + k^2)/(a + k) is least for k = 1/a: sqrt(1/(1 + a^2)).
    norms = np.sqrt([1 / 2, 1 / 5])
    assert found.details["part_norms"] == pytest.approx(tuple(norms), rel=1e-3)
    assert found.certificate.achieved == pytest.approx(norms[0], rel=1e-3)
    assert found.certificate.valid
    assert {entry["part"] for entry in found.history} == {0, 1}
    assert found.details["descents"] == len(found.history)
    assert found.gain is not None
    assert np.diag(found.gain) == pytest.approx([-1.0, -0.5], abs=0.05)
    assert found.status == "suboptimal"
    assert "descents ended there" in found.message


def test_equal_parts_are_searched_once_and_share_no_work():
    single, double = Budget(300.0), Budget(300.0)
    design(lags([1.0]), budget=single)
    found = design(lags([1.0, 1.0]), budget=double)
    assert double.spent == single.spent
    assert found.gain is not None
    assert found.gain[0, 0] == found.gain[1, 1]


def test_a_part_that_is_left_alone_has_to_be_stable():
    only_first = np.array([[True, False], [False, False]])
    with pytest.raises(InfeasibleError, match=r"\(state x2\) to a control and a measurement"):
        design(lags([1.0, -2.0]), mask=only_first)
    found = design(lags([1.0, 0.5]), mask=only_first)
    assert found.details["part_norms"] == pytest.approx((np.sqrt(0.5),), rel=1e-3)
    assert found.certificate.achieved == pytest.approx(2.0, rel=1e-6)


def test_verdicts():
    idle = design(lags([1.0]), mask=np.zeros((1, 1), bool))
    assert "the loop is the open loop" in idle.message
    assert idle.status == "suboptimal"
    falls = design(lags([1.0], price=0.0))
    assert falls.status == "infimum_not_attained"
    assert "gain_bound" in falls.message
    assert falls.lower_bound is None
    spent = design(lags([1.0]), budget=Budget(5.0))
    assert "The work of one search was spent." in spent.message
    late = design(lags([1.0]), budget=Budget(seconds=0.0))
    assert late.status == "time_limit"
    assert "Raise time_limit" in late.message


@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_disturbances_that_reach_nothing_leave_an_optimum_of_zero(norm):
    # w moves x2; u, z and y have to do with x1 only.
    first, second = [[1.0], [0.0]], [[0.0], [1.0]]
    watched = GeneralizedPlant.from_matrices(-np.eye(2), second, first, [[1.0, 0.0]], [[1.0, 0.0]])
    found = design(watched, norm)
    assert (found.status, found.certificate.achieved, found.lower_bound) == ("optimal", 0.0, 0.0)
    assert found.certificate.bound == 0.0
    assert "do not reach" in found.message


def test_what_is_not_found_is_an_error():
    with pytest.raises(SolverError, match="No stabilising static gain"):
        # Pushed apart and damped negatively: a spring alone, u = k x, does not help.
        design(oscillator().replace(A=np.array([[0.0, 1.0], [1.0, 0.1]])), budget=Budget(50.0))
