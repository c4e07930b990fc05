"""Descents from several starts, the starts themselves, and what a search tells."""

from functools import partial
from itertools import islice

import numpy as np
import pytest
from small_plants import oscillator, static_plant

from robustpolish.base.budget import Budget
from robustpolish.errors import SolverError
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.nonsmooth.descent import ActivePiece, MaskedGain, Problem, Requirement
from robustpolish.synthesis.nonsmooth.measures import FrobeniusMeasure
from robustpolish.synthesis.problem.preflight import whole_plant
from robustpolish.synthesis.structured import starts
from robustpolish.synthesis.structured.search import (
    CEILINGS,
    MultistartSearch,
    SearchEffort,
    design_part,
    stabilise,
)
from robustpolish.synthesis.structured.structures import StaticStructure

EDGE = 3.0


class Wells:
    """2 + (k^2 - 1)^2 + k/4 for k below the edge, else infinite: minima near -1 and 1."""

    work = 1.0

    def pieces(self, K, width, frequencies):
        k = K.item()
        if k >= EDGE:
            return []
        value = 2 + (k**2 - 1) ** 2 + k / 4
        return [ActivePiece(value, np.array([[4 * k * (k**2 - 1) + 0.25]]))]


class Abscissa:
    """A spectral abscissa as a function of k."""

    work = 0.1

    def __init__(self, value, slope):
        self.value, self.slope = value, slope

    def pieces(self, K, width, frequencies):
        return [ActivePiece(self.value(K.item()), np.array([[self.slope(K.item())]]))]


class Nowhere:
    """A norm that is infinite everywhere."""

    work = 1.0

    def pieces(self, K, width, frequencies):
        return []


BEYOND = Abscissa(lambda k: k**2 - EDGE**2, lambda k: 2 * k)
FREE = MaskedGain(np.ones((1, 1), bool))
PROBLEM = Problem(FREE, Wells())
# The minima of 4 k^3 - 4 k + 1/4 = 0; the left one is the lower.
LEFT, _, RIGHT = np.sort(np.roots([4.0, 0.0, -4.0, 0.25]).real)


def search(points, problem=PROBLEM, effort=None, budget=None, stability=BEYOND, **options):
    points = [np.array([float(k)]) for k in points]
    effort, budget = effort or SearchEffort(), budget or Budget()
    found = MultistartSearch(problem, stability, effort, budget, **options)
    return found.run(points, np.random.default_rng(0))


def test_the_lowest_of_the_minima_is_kept():
    found = search([0.9, -0.9])
    assert found.point == pytest.approx([LEFT], abs=1e-4)
    assert np.exp(found.value) == pytest.approx(2 + (LEFT**2 - 1) ** 2 + LEFT / 4)
    assert (found.reason, len(found.history)) == ("starts", 2)
    assert found.history[0]["value"] == pytest.approx(2 + (RIGHT**2 - 1) ** 2 + RIGHT / 4)


@pytest.mark.parametrize(
    ("points", "effort", "ends"),
    [
        ([-0.9] * 20, SearchEffort(fewest=2), ("agreed", 2)),
        ([-0.9] + [0.9] * 20, SearchEffort(patience=2), ("patience", 3)),
        ([-0.9] * 20, SearchEffort(descents=3), ("starts", 3)),
    ],
)
def test_agreement_patience_and_the_number_of_descents_end_a_search(points, effort, ends):
    found = search(points, effort=effort)
    assert (found.reason, len(found.history)) == ends


def test_a_target_and_spent_work_end_a_search_with_what_it_has():
    found = search([0.9] * 5, target=np.log(2.5))
    assert (found.reason, len(found.history)) == ("target", 1)
    assert np.exp(found.value) < 2.5
    budget = Budget(5.0)
    found = search([0.9] * 5, budget=budget)
    assert (found.reason, len(found.history)) == ("work", 1)
    assert found.history[0]["work"] == pytest.approx(budget.spent)


def test_unstable_starts_are_stabilised_first():
    point, abscissa = stabilise(PROBLEM, BEYOND, np.array([9.0]), Budget())
    assert abs(point.item()) < EDGE
    assert abscissa == pytest.approx(point.item() ** 2 - EDGE**2)
    found = search([9.0])
    assert min(abs(found.point.item() - k) for k in (LEFT, RIGHT)) < 1e-4
    # An abscissa that falls without end is followed to the ceiling only.
    held = Problem(FREE, Wells(), ceiling=100.0)
    falling = Abscissa(lambda k: k, lambda k: 1.0)
    point, abscissa = stabilise(held, falling, np.array([9.0]), Budget())
    assert -100.0 <= point.item() == abscissa < 0.0
    assert held.model(point) is not None


def test_what_stays_unstable_is_told_with_the_least_instability():
    floor = Abscissa(lambda k: 0.5 + k**2, lambda k: 2 * k)
    found = search([3.5, 4.0], Problem(FREE, Nowhere()), stability=floor)
    assert (found.point, found.value) == (None, np.inf)
    assert found.instability == pytest.approx(0.5, abs=1e-6)
    assert [entry["outcome"] for entry in found.history] == ["not stabilised"] * 2


def test_bounds_and_requirements_are_kept():
    # Within the bounds it falls towards the upper one, next to the right minimum.
    found = search([-5.0, 5.0], bounds=(np.array([0.5]), np.array([0.8])))
    assert found.point == pytest.approx([0.8], abs=1e-6)
    small = Problem(FREE, Wells(), (Requirement(FrobeniusMeasure(), 0.6),))
    found = search([0.1, -2.0], small)
    assert found.point == pytest.approx([-0.6], abs=1e-5)
    assert found.point[0] >= -0.6 * (1 + 1e-8)
    fixed = Problem(MaskedGain(np.zeros((1, 1), bool)), Wells())
    found = search([1.0, 2.0], fixed)
    assert (found.point.size, len(found.history)) == (0, 1)
    assert np.exp(found.value) == pytest.approx(3.0)  # at k = 0


# Starts.


def proposed(start, count=10):
    return list(islice(start(Budget(1e5), np.random.default_rng(0)), count))


def same(K):
    """Every entry is a free number."""
    return K.ravel()


def test_a_stabilising_gain_where_few_are():
    # An oscillator that is pushed apart: k2 > 0 and k1 > 4 are needed, u = -k y.
    plant = static_plant([[0.0, 1.0], [4.0, 0.5]], [[0.0], [1.0]], np.eye(2))
    (theta,) = proposed(partial(starts.stabilising, plant, np.ones((1, 2), bool), same))
    closed = plant.A + plant.B2 @ theta.reshape(1, 2) @ plant.C2
    assert np.linalg.eigvals(closed).real.max() < 0
    # Semidefinite programs are left to small plants.
    n = starts.STABILISING_STATES + 1
    large = static_plant(-np.eye(n), np.ones((n, 1)), np.ones((1, n)))
    assert proposed(partial(starts.stabilising, large, np.ones((1, 1), bool), same)) == []


# The search of one part.


def lag(price=1.0, a=-1.0, unit=1.0):
    """X' = a x + w + u, z = unit (x, price u): u = -k x gives sqrt(1 + (price k)^2)/(k - a)."""
    return GeneralizedPlant.from_matrices(
        [[a]], [[1.0]], [[1.0]], [[unit], [0.0]], [[1.0]], D12=[[0.0], [price * unit]]
    )


def design(plant, target=0.0, budget=None, **structure):
    problem = StaticStructure("hinf", **structure).problem(whole_plant(plant))
    return design_part(problem, budget or Budget(1e3), 3, target)


def gain(found):
    return np.asarray(found.controller.D).item()


def test_an_optimum_in_closed_form_is_reached_in_the_units_of_the_plant():
    # k = 1 is the best, sqrt(1/2); only a little of it is given away for a smaller gain.
    unit = 1e-6
    found = design(lag(unit=unit), budget=Budget(1e5))
    assert found.norm == pytest.approx(unit * np.sqrt(0.5), rel=7.5e-5)
    assert gain(found) == pytest.approx(-1.0, abs=0.05)
    assert (found.at_ceiling, found.reason) == (False, "agreed")
    assert found.agreeing >= 4
    assert min(e["value"] for e in found.history if "value" in e) <= found.norm


def test_bounds_ceilings_and_targets():
    bounded = design(lag(), gain_bound=0.5, budget=Budget(200.0))
    assert gain(bounded) == pytest.approx(-0.5, rel=1e-6)
    assert bounded.norm == pytest.approx(np.sqrt(1.25) / 1.5, rel=1e-4)
    # A norm that falls without end is stopped at a ceiling and certified.
    falling = design(lag(price=0.0))
    assert falling.at_ceiling
    assert abs(gain(falling)) > 0.5 * CEILINGS[-1]
    assert falling.norm == pytest.approx(1 / (1 - gain(falling)), rel=1e-6)
    early = design(lag(price=0.0), target=0.1)
    assert (early.reason, len(early.history)) == ("target", 1)
    assert early.norm < 0.1


def test_a_gain_that_cancels_the_disturbance_does_so_exactly():
    # y = w and u = -y leave nothing: x' = -x.
    plant = GeneralizedPlant.from_matrices(
        [[-1.0]], [[0.3]], [[0.1]], [[1.0]], [[0.0]], D21=[[1.0]]
    )
    found = design(plant)
    assert gain(found) == pytest.approx(-3.0, abs=1e-9)
    assert found.norm < 1e-12


def test_the_same_seed_gives_the_same_bits():
    first, again = (design(oscillator(), order=1, budget=Budget(60.0)) for _ in range(2))
    assert first.point.tobytes() == again.point.tobytes()
    assert first.history == again.history


def test_refusals_say_what_was_tried_and_what_to_do():
    # A double integrator with its position measured needs a derivative.
    unstable = GeneralizedPlant.from_matrices(
        [[0, 1], [0, 0]], [[0], [1]], [[0], [1]], [[1, 0]], [[1, 0]]
    )
    with pytest.raises(SolverError, match=r"No stabilising static gain.*lowest.*Raise order=, try"):
        design(unstable, budget=Budget(100.0))
    # x' = x + u needs k > 1.
    with pytest.raises(SolverError, match=r"that meets the gain bound 0\.9 was found"):
        design(lag(a=1.0), gain_bound=0.9, budget=Budget(300.0))
    with pytest.raises(SolverError, match=r"before time ran out.*raise time_limit"):
        design(lag(a=1.0), budget=Budget(seconds=0.0))
