"""Write a full-order controller as an observer with a state feedback.

Any strictly proper controller of the plant's order is, in suitable coordinates, a Luenberger
observer with u = F xhat (Bender and Fowell 1985; Alazard and Apkarian 1999). So the
H-infinity problem over F and L, which is bilinear in (10.74) of the thesis, has the same infimum
as the convex one over strictly proper controllers.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robustpolish.synthesis.problem.matrices import Matrix

# Up to this many real poles and pairs every choice is tried; beyond, some drawn at random.
_ALL_CHOICES = 10
_DRAWN_CHOICES = 30


class ObserverForm(NamedTuple):
    """u = F xhat, xhat' = A xhat + B u + L (y - C xhat - D u), and how well it is conditioned."""

    F: Matrix
    L: Matrix
    condition: float


def observer_form(
    A: Matrix, B: Matrix, C: Matrix, D: Matrix, Ak: Matrix, Bk: Matrix, Ck: Matrix
) -> ObserverForm | None:
    """Find F and L whose observer-based controller equals a given one.

    The controller's state is T xhat with T of the invariant subspace [I; T] of the loop matrix;
    the loop's poles are then those of A + B F, chosen for the subspace, and of A - L C. Among the
    choices the one with the best conditioned T is taken.

    Parameters
    ----------
    A, B, C, D : ndarray
        The plant from u to y, with n states.
    Ak, Bk, Ck : ndarray
        A strictly proper controller with n states.

    Returns
    -------
    ObserverForm or None
        None if no choice gives an invertible T to working accuracy.
    """
    n = len(A)
    loop = np.block([[A, B @ Ck], [Bk @ C, Ak + Bk @ D @ Ck]])
    found = np.linalg.eig(loop)
    poles, vectors = np.asarray(found[0], complex), np.asarray(found[1], complex)
    best: ObserverForm | None = None
    for choice in _choices(poles, n):
        top, bottom = vectors[:n, choice], vectors[n:, choice]
        if np.linalg.cond(top) > 1e12:
            continue
        T = np.linalg.solve(top.T, bottom.T).T
        if np.abs(T.imag).max() > 1e-6 * np.abs(T).max():
            continue
        T = T.real
        condition = float(np.linalg.cond(T))
        if condition < 1e10 and (best is None or condition < best.condition):
            best = ObserverForm(Ck @ T, np.linalg.solve(T, Bk), condition)
    return best


def _choices(poles: NDArray[np.complex128], n: int) -> list[list[int]]:
    """Return sets of n poles closed under conjugation; all of them for small plants."""
    groups = _conjugate_groups(poles)
    if len(groups) <= _ALL_CHOICES:
        return [
            [i for group in members for i in group]
            for count in range(len(groups) + 1)
            for members in combinations(groups, count)
            if sum(map(len, members)) == n
        ]
    rng = np.random.default_rng(0)
    orders = [groups, groups[::-1]]
    orders += [[groups[i] for i in rng.permutation(len(groups))] for _ in range(_DRAWN_CHOICES)]
    filled = [_filled(order, n) for order in orders]
    return [choice for choice in filled if len(choice) == n]


def _filled(groups: list[list[int]], n: int) -> list[int]:
    """Take groups in their order as long as they fit."""
    choice: list[int] = []
    for group in groups:
        if len(choice) + len(group) <= n:
            choice.extend(group)
    return choice


def _conjugate_groups(poles: NDArray[np.complex128]) -> list[list[int]]:
    """Return the indices of real poles and of complex pairs, slow ones first."""
    order = sorted(range(len(poles)), key=lambda i: (-poles[i].real, abs(poles[i].imag)))
    groups: list[list[int]] = []
    used: set[int] = set()
    for i in order:
        if i in used:
            continue
        group = [i]
        rest = [j for j in order if j not in used and j != i]
        if poles[i].imag != 0 and rest:
            group.append(min(rest, key=lambda j: abs(poles[j] - np.conj(poles[i]))))
        used.update(group)
        groups.append(group)
    return groups
