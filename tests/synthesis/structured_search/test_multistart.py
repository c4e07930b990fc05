"""Several descents: which minimum is found, and why they end."""

import numpy as np
import pytest

from robustpolish.base.budget import Budget
from robustpolish.synthesis.nonsmooth.descent import ActivePiece, Problem, Requirement
from robustpolish.synthesis.nonsmooth.measures import FrobeniusMeasure
from robustpolish.synthesis.nonsmooth.parametrisations import MaskedGain
from robustpolish.synthesis.structured.search import SearchEffort, descend_from, stabilise

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


class Beyond:
    """How far k^2 is beyond that of the edge: what has to be negative for a stable loop."""

    work = 0.1

    def pieces(self, K, width, frequencies):
        return [ActivePiece(K.item() ** 2 - EDGE**2, 2 * K)]


class Floor:
    """A loop that nothing makes stable: the abscissa is at least 1/2."""

    work = 0.1

    def pieces(self, K, width, frequencies):
        k = K.item()
        return [ActivePiece(0.5 + k**2, np.array([[2 * k]]))]


class Nowhere:
    """A norm that is infinite everywhere."""

    work = 1.0

    def pieces(self, K, width, frequencies):
        return []


FREE = MaskedGain(np.ones((1, 1), bool))
PROBLEM = Problem(FREE, Wells())
# The minima of 4 k^3 - 4 k + 1/4 = 0; the left one is the lower.
LEFT, _, RIGHT = np.sort(np.roots([4.0, 0.0, -4.0, 0.25]).real)


def search(starts, problem=PROBLEM, effort=None, budget=None, **options):
    points = [np.array([float(k)]) for k in starts]
    rng = np.random.default_rng(0)
    stability = options.pop("stability", Beyond())
    return descend_from(
        points, problem, stability, effort or SearchEffort(), budget or Budget(), rng, **options
    )


def test_the_lowest_of_the_minima_is_kept():
    found = search([0.9, -0.9])
    assert found.point == pytest.approx([LEFT], abs=1e-4)
    assert np.exp(found.value) == pytest.approx(2 + (LEFT**2 - 1) ** 2 + LEFT / 4)
    assert found.reason == "starts"
    assert len(found.history) == 2
    assert found.history[0]["value"] == pytest.approx(2 + (RIGHT**2 - 1) ** 2 + RIGHT / 4)


def test_agreement_and_patience_end_the_search():
    agreed = search([-0.9] * 20, effort=SearchEffort(fewest=2))
    assert (agreed.reason, len(agreed.history)) == ("agreed", 2)
    patient = search([-0.9] + [0.9] * 20, effort=SearchEffort(patience=2))
    assert (patient.reason, len(patient.history)) == ("patience", 3)
    most = search([-0.9] * 20, effort=SearchEffort(descents=3))
    assert (most.reason, len(most.history)) == ("starts", 3)


def test_a_target_ends_the_search_at_once():
    found = search([0.9] * 5, target=np.log(2.5))
    assert (found.reason, len(found.history)) == ("target", 1)
    assert np.exp(found.value) < 2.5


def test_spent_work_ends_the_search_with_what_it_has():
    budget = Budget(5.0)
    found = search([0.9] * 5, budget=budget)
    assert (found.reason, len(found.history)) == ("work", 1)
    assert found.point is not None
    assert found.history[0]["work"] == pytest.approx(budget.spent)


def test_unstable_starts_are_stabilised_first():
    point, abscissa = stabilise(PROBLEM, Beyond(), np.array([9.0]), Budget())
    assert abs(point.item()) < EDGE
    assert abscissa == pytest.approx(point.item() ** 2 - EDGE**2)
    found = search([9.0])
    assert found.point is not None
    assert min(abs(found.point.item() - k) for k in (LEFT, RIGHT)) < 1e-4


def test_an_abscissa_that_falls_without_end_is_followed_to_the_ceiling_only():
    class Linear(Beyond):
        """K itself, as for x' = k x: the lower the better, without end."""

        def pieces(self, K, width, frequencies):
            return [ActivePiece(K.item(), np.ones((1, 1)))]

    held = Problem(FREE, Wells(), ceiling=100.0)
    point, abscissa = stabilise(held, Linear(), np.array([9.0]), Budget())
    assert -100.0 <= point.item() == abscissa < 0.0
    assert held.model(point) is not None


def test_what_stays_unstable_is_told_with_the_least_instability():
    found = search([3.5, 4.0], Problem(FREE, Nowhere()), stability=Floor())
    assert found.point is None
    assert found.value == np.inf
    assert found.instability == pytest.approx(0.5, abs=1e-6)
    assert [entry["outcome"] for entry in found.history] == ["not stabilised"] * 2


def test_bounds_and_requirements_are_kept():
    bounds = (np.array([0.5]), np.array([0.8]))
    found = search([-5.0, 5.0], bounds=bounds)
    # Within the bounds it falls towards the upper one, next to the right minimum.
    assert found.point == pytest.approx([0.8], abs=1e-6)
    small = Problem(FREE, Wells(), (Requirement(FrobeniusMeasure(), 0.6),))
    found = search([0.1, -2.0], small)
    assert found.point is not None
    assert found.point == pytest.approx([-0.6], abs=1e-5)
    assert found.point[0] >= -0.6 * (1 + 1e-8)


def test_a_structure_without_free_numbers_is_evaluated_once():
    fixed = Problem(MaskedGain(np.zeros((1, 1), bool)), Wells())
    found = search([1.0, 2.0], fixed)
    assert found.point is not None
    assert found.point.size == 0
    assert np.exp(found.value) == pytest.approx(3.0)  # at k = 0
    assert len(found.history) == 1
