"""Starts for a controller of few states: a controller of fewer states, grown."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import AnyVector as Vector
from robustpolish.long_calls import Budget
from robustpolish.synthesis.structured_search.multistart import descend_from
from robustpolish.synthesis.structured_search.policy import POLICY
from robustpolish.synthesis.structured_search.structure import PartProblem


@dataclass(frozen=True, eq=False)
class GrownStarts:
    """The best controller of fewer states with states added that nobody hears yet.

    The added states listen to y and the others, and their outputs have no weight: the loop is that
    of the shorter controller, and the gradient over their weights is not zero. So no order does
    worse than a lower one that was searched.

    Attributes
    ----------
    shorter : PartProblem
        The same search for fewer states.
    order : int
        Of the grown controller.
    coordinates : callable
        From K to the free numbers.
    """

    shorter: PartProblem
    order: int
    coordinates: Callable[[Matrix], Vector]

    def propose(
        self, earlier: Sequence[Vector], budget: Budget, rng: np.random.Generator
    ) -> Iterator[Vector]:
        """Propose the best shorter controller with several draws of what is added."""
        own = budget.share(POLICY.grown_share)
        found = descend_from(
            self.shorter.proposals(own, rng),
            self.shorter.below(POLICY.ceilings[0]),
            self.shorter.stability,
            POLICY.grown,
            own,
            rng,
        )
        if found.point is None:
            return
        K = self.shorter.parametrisation.gain(found.point)
        for _ in range(POLICY.growths):
            yield self.coordinates(self._grown(K, rng))

    def _grown(self, K: Matrix, rng: np.random.Generator) -> Matrix:
        """Add states of drawn time constants between those of K and its signals."""
        k, more = self.shorter.order, self.order - self.shorter.order
        (rows, columns), discrete = K.shape, self.shorter.loop.discrete
        grown = np.zeros((rows + more, columns + more))
        old_rows = np.r_[:k, k + more : rows + more]
        old_columns = np.r_[:k, k + more : columns + more]
        grown[np.ix_(old_rows, old_columns)] = K
        new = slice(k, k + more)
        rates = 10 ** rng.uniform(*POLICY.rates, size=more)
        grown[new, new] = np.diag(np.exp(-rates) if discrete else -rates)
        grown[new, old_columns] = rng.normal(size=(more, columns))
        return grown
