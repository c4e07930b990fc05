"""Starts for a controller of few states: full-order designs, reduced."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import control
import numpy as np
from scipy.linalg import block_diag

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import AnyVector as Vector
from robustpolish.base.budget import Budget, step_cost
from robustpolish.implementation.reduction import Reducer
from robustpolish.plants.blocks import matrices_of
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.nonsmooth.measures import StabilityMeasure
from robustpolish.synthesis.nonsmooth.parametrisations import ObserverGain
from robustpolish.synthesis.problem.matrices import PlantMatrices, augmented
from robustpolish.synthesis.structured.observer import RiccatiStarts
from robustpolish.synthesis.structured.search import (
    POLICY,
    Norm,
    PartProblem,
    descend_from,
    norm_measure,
)

# Starts for a controller of few states: a controller of fewer states, grown.


@dataclass(frozen=True, eq=False)
class AugmentedStarts:
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
        # Share of the work for a controller of fewer states to start from, and how many draws of
        # the states that are added to it.
        own = budget.share(0.35)
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
        for _ in range(3):
            yield self.coordinates(self._augmented(K, rng))

    def _augmented(self, K: Matrix, rng: np.random.Generator) -> Matrix:
        """Add states of drawn time constants between those of K and its signals."""
        k, more = self.shorter.order, self.order - self.shorter.order
        (rows, columns), discrete = K.shape, self.shorter.loop.discrete
        grown = np.zeros((rows + more, columns + more))
        old_rows = np.r_[:k, k + more : rows + more]
        old_columns = np.r_[:k, k + more : columns + more]
        grown[np.ix_(old_rows, old_columns)] = K
        new = slice(k, k + more)
        # Decimal logarithms of the slowest and the fastest added state, in the plant's unit of
        # time.
        rates = 10 ** rng.uniform(*(-1.0, 1.0), size=more)
        grown[new, new] = np.diag(np.exp(-rates) if discrete else -rates)
        grown[new, old_columns] = rng.normal(size=(more, columns))
        return grown


@dataclass(frozen=True, eq=False)
class ReducedStarts:
    """Central H-infinity and LQG controllers of full order, shortened in every way there is.

    A reduced controller seldom keeps the norm, and often not even stability, but lies where good
    controllers of its order are, which random draws on plants with many states hardly ever do.

    Attributes
    ----------
    plant : GeneralizedPlant
        Scaled.
    norm : {"hinf", "h2"}
    order : int
    coordinates : callable
        From K = [[Ak, Bk], [Ck, Dk]] to the free numbers.
    """

    plant: GeneralizedPlant
    norm: Norm
    order: int
    coordinates: Callable[[Matrix], Vector]

    def propose(
        self, earlier: Sequence[Vector], budget: Budget, rng: np.random.Generator
    ) -> Iterator[Vector]:
        """Propose the stable loops by their norm, then the others by their abscissa."""
        inner = PlantMatrices.of(self.plant)
        if not (inner.nx and inner.nu and inner.ny):
            return
        own = budget.share(POLICY.start_share)
        with np.errstate(all="ignore"), warnings.catch_warnings():
            # Ill-conditioned equations of extreme designs: what comes of them is judged below.
            warnings.simplefilter("ignore")
            found = list(self._shortened(inner, own, rng))
            loop = augmented(inner, self.order)
            norm = norm_measure(loop, self.norm)
            size = float(np.linalg.norm(loop.A, 2)) or 1.0
            stability = StabilityMeasure.of(loop, size)

            def merit(K: Matrix) -> tuple[bool, float]:
                if own.over or not np.abs(K).max(initial=0.0) <= POLICY.ceilings[0]:
                    return True, np.inf
                own.spend(norm.work)
                pieces = norm.pieces(K, 0.0, ())
                if pieces:
                    return False, pieces[0].value
                pieces = stability.pieces(K, 0.0, ())
                return True, pieces[0].value if pieces else np.inf

            judged = [(merit(K), i) for i, K in enumerate(found)]
        kept: list[tuple[bool, float]] = []
        for value, i in sorted(judged):
            # Several ways of reduction often give the same controller.
            alike = any(
                # Starts whose norms differ by less than this share count as the same.
                value[0] == other[0] and abs(value[1] - other[1]) <= 1e-3 * abs(value[1])
                for other in kept
            )
            if alike or not np.isfinite(value[1]):
                continue
            kept.append(value)
            yield self.coordinates(found[i])
            if len(kept) >= POLICY.proposals:
                return

    def _shortened(
        self, inner: PlantMatrices, budget: Budget, rng: np.random.Generator
    ) -> Iterator[Matrix]:
        n, k = inner.nx, self.order
        form = ObserverGain(inner.A, inner.B2, inner.C2, inner.D22)
        for point in RiccatiStarts(inner, self.norm, form).propose((), budget, rng):
            K = form.gain(point)
            parts = K[:n, :n], K[:n, n:], K[n:, :n], K[n:, n:]
            own = control.StateSpace(*parts, self.plant.dt, remove_useless_states=False)
            # Its Gramians are those of a loop with twice the states.
            budget.spend(10 * step_cost(2 * n))
            try:
                reducer = Reducer(self.plant, own)
            except (np.linalg.LinAlgError, ValueError):
                continue
            for candidate in reducer.of_order(k):
                short = candidate.controller
                yield padded(short, k)


def padded(controller: control.StateSpace, order: int) -> Matrix:
    """Return [[Ak, Bk], [Ck, Dk]] of a controller, with idle states up to an order."""
    A, B, C, D = matrices_of(controller)
    more = order - len(A)
    idle = 0.5 if controller.isdtime(strict=True) else -1.0
    return np.block(
        [
            [block_diag(A, idle * np.eye(more)), np.pad(B, ((0, more), (0, 0)))],
            [np.pad(C, ((0, 0), (0, more))), D],
        ]
    )
