"""Controllers with fewer states: candidates, which the certified loop then judges."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any, NamedTuple

import control
import numpy as np
from scipy import linalg

from robustpolish.base.arrays import NOTHING, Matrix, Vector
from robustpolish.linear.scaling import border_scale
from robustpolish.linear.stability import lyapunov_solution, square_root
from robustpolish.linear.systems import named_like
from robustpolish.plants.blocks import matrices_of
from robustpolish.plants.plant import GeneralizedPlant

Parts = tuple[Matrix, Matrix, Matrix, Matrix]
"""A, B, C and D."""

# Gramians of a controller by itself, of its coprime factors, and inside its closed loop.


class WeightedGramians(NamedTuple):
    """A system to be reduced, with the Gramians that say which of its states matter.

    ``matrices`` : A, B, C, D; ``reach``, ``see`` : Gramians; ``back`` : how a reduced one becomes a
    controller, "" for as it is, "left" or "right" for a coprime factor.
    """

    name: str
    matrices: Parts
    reach: Matrix
    see: Matrix
    back: str = ""


def stable(A: Matrix, discrete: bool) -> bool:
    """Tell whether all eigenvalues, as doubles see them, are stable."""
    if not A.size:
        return True
    values: Any = np.linalg.eigvals(A)
    return bool(np.abs(values).max() < 1 if discrete else values.real.max() < 0)


def own_gramians(name: str, K: Parts, discrete: bool, back: str = "") -> list[WeightedGramians]:
    """Weigh the states of a stable system by what they pass on from input to output."""
    A, B, C, _ = K
    if not stable(A, discrete):
        return []
    reach = lyapunov_solution(A, B @ B.T, discrete)
    see = lyapunov_solution(A.T, C.T @ C, discrete)
    return [WeightedGramians(name, K, reach, see, back)]


def loop_gramians(plant: GeneralizedPlant, K: Parts, loop: Matrix) -> list[WeightedGramians]:
    """Weigh the states of a controller by what they do inside its loop.

    Parameters
    ----------
    plant : GeneralizedPlant
    K : tuple of ndarray
        A, B, C, D of the controller.
    loop : ndarray
        State matrix of the closed loop, the plant's states first.

    Returns
    -------
    list of Weighted
        From w to z, and from disturbances of y and u to y and u: the first keeps the norm, the
        second stability and robustness.

    Notes
    -----
    P. M. R. Wortelboer, M. Steinbuch, O. H. Bosgra, "Iterative model and controller reduction
    using closed-loop balancing", Int. J. Robust and Nonlinear Control 9 (1999) 123-142.
    """
    _, B, C, D = K
    n, nu, ny, discrete = plant.nx, plant.nu, plant.ny, plant.is_discrete
    # (y, u) of states, and of what is added to y and to u.
    shut = np.block([[np.eye(ny), -plant.D22], [-D, np.eye(nu)]])
    on_x = np.linalg.solve(shut, np.asarray(linalg.block_diag(plant.C2, C)))
    on_added = np.linalg.inv(shut)
    enters = np.zeros((len(loop), ny + nu))
    enters[:n, ny:], enters[n:, :ny] = plant.B2, B
    noise = enters @ on_added
    w = noise[:, :ny] @ plant.D21
    w[:n] += plant.B1
    z = plant.D12 @ on_x[ny:]
    z[:, :n] += plant.C1
    pairs = {"closed-loop": (w, z), "robustness": (noise, on_x)}
    weighed = []
    for name, (into, out) in pairs.items():
        reach = lyapunov_solution(loop, into @ into.T, discrete)[n:, n:]
        see = lyapunov_solution(loop.T, out.T @ out, discrete)[n:, n:]
        weighed.append(WeightedGramians(name, K, reach, see))
    return weighed


def coprime_gramians(K: Parts, discrete: bool) -> list[WeightedGramians]:
    """Weigh the states of normalised coprime factors, which are stable whatever the controller.

    Notes
    -----
    D. C. McFarlane, K. Glover, Robust Controller Design Using Normalized Coprime Factor Plant
    Descriptions, Springer 1990, chapter 5.
    """
    if discrete:
        return []
    A, B, C, D = K
    found = []
    if (left := _left_factor(A, B, C, D)) is not None:
        found += own_gramians("left coprime", left, False, "left")
    if (right := _left_factor(A.T, C.T, B.T, D.T)) is not None:
        turned = (right[0].T, right[2].T, right[1].T, right[3].T)
        found += own_gramians("right coprime", turned, False, "right")
    return found


def _left_factor(A: Matrix, B: Matrix, C: Matrix, D: Matrix) -> Parts | None:
    """Return [N M] with K = inv(M) N and N N~ + M M~ = 1."""
    R = np.eye(len(D)) + D @ D.T
    try:
        X = linalg.solve_continuous_are(A.T, C.T, B @ B.T, R, s=B @ D.T)
    except (np.linalg.LinAlgError, ValueError):
        return None
    L = -np.linalg.solve(R, (X @ C.T + B @ D.T).T).T
    values, vectors = np.linalg.eigh(R)
    root = vectors / np.sqrt(values) @ vectors.T
    entry, through = np.hstack([B + L @ D, L]), np.hstack([D, np.eye(len(D))])
    return A + L @ C, entry, root @ C, root @ through


def from_factor(matrices: Parts, back: str, inputs: int, outputs: int) -> Parts:
    """Return the controller that coprime factors stand for."""
    A, B, C, D = matrices
    if back == "left":
        over = np.linalg.inv(D[:, inputs:])
        own = B[:, inputs:] @ over
        return A - own @ C, B[:, :inputs] - own @ D[:, :inputs], over @ C, over @ D[:, :inputs]
    over = np.linalg.inv(D[outputs:])
    own = over @ C[outputs:]
    return A - B @ own, B @ over, C[:outputs] - D[:outputs] @ own, D[:outputs] @ over


# Controllers of a given order that may stand for a longer one.


class ReducedCandidate(NamedTuple):
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
            ways = [
                *own_gramians("balanced", K, plant.is_discrete),
                *_or_none(loop_gramians, plant, K, loop),
            ]
            ways += _or_none(coprime_gramians, K, plant.is_discrete)
        self._ways = [(way, *balancing_projection(way)) for way in ways]
        self.hankel: dict[str, Vector] = {way.name: values for way, _, _, values in self._ways}

    def of_order(self, order: int) -> Iterator[ReducedCandidate]:
        """Yield the candidates of an order: the weak states truncated, and held at rest."""
        m, p = self._controller.ninputs, self._controller.noutputs
        for way, T, Ti, _ in self._ways:
            A, B, C, D = way.matrices
            kept = min(order, T.shape[1])  # fewer where the others do nothing at all
            turned = Ti @ A @ T, Ti @ B, C @ T, D
            for how, shorten in (("truncated", _truncated), ("residualised", self._residual)):
                try:
                    with np.errstate(all="ignore"):
                        found = shorten(turned, kept)
                        if found is not None and way.back:
                            found = from_factor(found, way.back, m, p)
                except np.linalg.LinAlgError:
                    continue
                if found is not None and all(np.isfinite(M).all() for M in found):
                    controller = named_like(self._controller, found, self._controller.dt)
                    yield ReducedCandidate(f"{way.name}, {how}", controller)

    def _residual(self, K: Parts, order: int) -> Parts | None:
        """Hold the weak states at rest, which keeps the gain at frequency zero."""
        A, B, C, D = K
        kept, rest = slice(order), slice(order, len(A))
        slow = -A[rest, rest]
        if self._discrete:
            slow = np.eye(len(slow)) + slow
        if not len(slow) or np.linalg.cond(slow) > 1e12:
            return None
        on_x, on_y = np.linalg.solve(slow, A[rest, kept]), np.linalg.solve(slow, B[rest])
        out, through = C[:, kept] + C[:, rest] @ on_x, D + C[:, rest] @ on_y
        return A[kept, kept] + A[kept, rest] @ on_x, B[kept] + A[kept, rest] @ on_y, out, through


def _truncated(K: Parts, order: int) -> Parts:
    A, B, C, D = K
    return A[:order, :order], B[:order], C[:, :order], D


def balancing_projection(way: WeightedGramians) -> tuple[Matrix, Matrix, Vector]:
    """Return coordinates in which both Gramians are equal and diagonal, largest first.

    States that cannot be told from nothing are left out, which loses nothing that counts.
    """
    reach, see = square_root(way.reach), square_root(way.see)
    U, values, Vt = np.linalg.svd(see.T @ reach)
    kept = values > values.max(initial=0.0) * 1e-13
    kept &= values > NOTHING
    size = np.sqrt(values[kept])
    T = reach @ Vt.T[:, kept] / size
    Ti = (see @ U[:, kept] / size).T
    return T, Ti, values


def _or_none(weigh: Any, *arguments: Any) -> list[WeightedGramians]:
    """Return what a way gives; none where its equations have no solution."""
    try:
        found = weigh(*arguments)
    except (np.linalg.LinAlgError, ValueError):
        return []
    return [w for w in found if np.isfinite(w.reach).all() and np.isfinite(w.see).all()]
