"""Controllers of a given order that may stand for a longer one."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any, NamedTuple

import control
import numpy as np

from robustpolish.arrays import Matrix, Vector
from robustpolish.implementation.reduction.gramians import (
    Weighted,
    alone,
    coprime,
    from_factor,
    in_loop,
)
from robustpolish.implementation.sampled.matrices import named_like
from robustpolish.implementation.sampled.scaled_map import border_scale
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.blocks import matrices_of

Parts = tuple[Matrix, Matrix, Matrix, Matrix]

_NOTHING = 1e-30


class Candidate(NamedTuple):
    """A shorter controller, and how it came about."""

    name: str
    controller: control.StateSpace


class Reducer:
    """All ways to shorten a controller, with what they share computed once.

    Parameters
    ----------
    plant : GeneralizedPlant
    controller : control.StateSpace
        It stabilises the plant.

    Attributes
    ----------
    hankel : mapping of str to ndarray
        Hankel singular values of every way, largest first.
    """

    def __init__(self, plant: GeneralizedPlant, controller: control.StateSpace) -> None:
        self._controller, self._discrete = controller, plant.is_discrete
        A, B, C, D = matrices_of(controller)
        even = border_scale(A, np.abs(B).max(axis=1), np.abs(C).max(axis=0))
        K = A * even / even[:, None], B / even[:, None], C * even, D
        scaled = named_like(controller, K, controller.dt)
        loop = np.asarray(plant.closed_loop(scaled).A, dtype=float)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # ill-conditioned equations: what follows is judged
            ways = [*alone(K, plant.is_discrete), *_quietly(in_loop, plant, K, loop)]
            ways += _quietly(coprime, K, plant.is_discrete)
        self._ways = [(way, *_projection(way)) for way in ways]
        self.hankel: dict[str, Vector] = {way.name: values for way, _, _, values in self._ways}

    def of_order(self, order: int) -> Iterator[Candidate]:
        """Yield the candidates of an order: the weak states truncated, and held at rest."""
        m, p = self._controller.ninputs, self._controller.noutputs
        for way, T, Ti, _ in self._ways:
            A, B, C, D = way.matrices
            kept = min(order, T.shape[1])  # fewer where the others do nothing at all
            turned = Ti @ A @ T, Ti @ B, C @ T, D
            for how, shorten in (("truncated", _truncated), ("residualised", self._residual)):
                with np.errstate(all="ignore"):
                    found = shorten(turned, kept)
                    if found is not None and way.back:
                        found = _factored(found, way.back, m, p)
                if found is not None and all(np.isfinite(M).all() for M in found):
                    controller = named_like(self._controller, found, self._controller.dt)
                    yield Candidate(f"{way.name}, {how}", controller)

    def _residual(self, K: Parts, order: int) -> Parts | None:
        """Hold the weak states at rest, which keeps the gain at frequency zero."""
        A, B, C, D = K
        n = len(A)
        rest = slice(order, n)
        slow = np.eye(n - order) - A[rest, rest] if self._discrete else -A[rest, rest]
        if n == order or np.linalg.cond(slow) > 1e12:
            return None
        on_x, on_y = np.linalg.solve(slow, A[rest, :order]), np.linalg.solve(slow, B[rest])
        return (
            A[:order, :order] + A[:order, rest] @ on_x,
            B[:order] + A[:order, rest] @ on_y,
            C[:, :order] + C[:, rest] @ on_x,
            D + C[:, rest] @ on_y,
        )


def _truncated(K: Parts, order: int) -> Parts:
    A, B, C, D = K
    return A[:order, :order], B[:order], C[:, :order], D


def _factored(found: Parts, back: str, inputs: int, outputs: int) -> Parts | None:
    try:
        return from_factor(found, back, inputs, outputs)
    except np.linalg.LinAlgError:
        return None


def _projection(way: Weighted) -> tuple[Matrix, Matrix, Vector]:
    """Return coordinates in which both Gramians are equal and diagonal, largest first.

    States that cannot be told from nothing are left out, which loses nothing that counts.
    """
    reach, see = _root(way.reach), _root(way.see)
    U, values, Vt = np.linalg.svd(see.T @ reach)
    kept = values > values.max(initial=0.0) * 1e-13
    kept &= values > _NOTHING
    size = np.sqrt(values[kept])
    T = reach @ Vt.T[:, kept] / size
    Ti = (see @ U[:, kept] / size).T
    return T, Ti, values


def _root(M: Matrix) -> Matrix:
    values, vectors = np.linalg.eigh((M + M.T) / 2)
    return vectors * np.sqrt(np.maximum(values, 0.0))


def _quietly(weigh: Any, *arguments: Any) -> list[Weighted]:
    """Return what a way gives; none where its equations have no solution."""
    try:
        found = weigh(*arguments)
    except (np.linalg.LinAlgError, ValueError):
        return []
    return [w for w in found if np.isfinite(w.reach).all() and np.isfinite(w.see).all()]
