"""Observers with state feedback: the controller of F and L, and F and L of a controller."""

from __future__ import annotations

from itertools import combinations

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.checks import matrix
from robustpolish.plants.blocks import named_system
from robustpolish.plants.plant import GeneralizedPlant

# Up to this many real poles and pairs every choice of poles is tried; beyond, some drawn at random.
_ALL_CHOICES = 10
_DRAWN_CHOICES = 30


def observer_form(
    A: Matrix, B: Matrix, C: Matrix, D: Matrix, Ak: Matrix, Bk: Matrix, Ck: Matrix
) -> tuple[Matrix, Matrix] | None:
    """Find F and L whose observer-based controller equals a given one.

    Any strictly proper controller of the plant's order is, in suitable coordinates, a Luenberger
    observer with u = F xhat (Bender and Fowell 1985; Alazard and Apkarian 1999). So the H-infinity
    problem over F and L, which is bilinear in (10.74) of the thesis, has the same infimum as the
    convex one over strictly proper controllers. The controller's state is T xhat with T of the
    invariant subspace [I; T] of the loop matrix; the loop's poles are then those of A + B F, chosen
    for the subspace, and of A - L C. Among the choices the best conditioned T is taken.

    Parameters
    ----------
    A, B, C, D : ndarray
        The plant from u to y, with n states.
    Ak, Bk, Ck : ndarray
        A strictly proper controller with n states.

    Returns
    -------
    tuple of ndarray or None
        None if no choice gives an invertible T to working accuracy.
    """
    n = len(A)
    loop = np.block([[A, B @ Ck], [Bk @ C, Ak + Bk @ D @ Ck]])
    found = np.linalg.eig(loop)
    poles, vectors = np.asarray(found[0], complex), np.asarray(found[1], complex)
    best, condition = None, 1e10
    for choice in _choices(poles, n):
        top, bottom = vectors[:n, choice], vectors[n:, choice]
        if np.linalg.cond(top) > 1e12:
            continue
        T = np.linalg.solve(top.T, bottom.T).T
        own = float(np.linalg.cond(T.real))
        if np.abs(T.imag).max() <= 1e-6 * np.abs(T).max() and own < condition:
            best, condition = (Ck @ T.real, np.linalg.solve(T.real, Bk)), own
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
    choices = []
    for order in orders:
        choice: list[int] = []
        for group in order:
            if len(choice) + len(group) <= n:
                choice.extend(group)
        choices.append(choice)
    return [choice for choice in choices if len(choice) == n]


def _conjugate_groups(poles: NDArray[np.complex128]) -> list[list[int]]:
    """Return the indices of real poles and of complex pairs, slow ones first."""
    rest = sorted(range(len(poles)), key=lambda i: (-poles[i].real, abs(poles[i].imag)))
    groups: list[list[int]] = []
    while rest:
        group = [rest.pop(0)]
        pole = poles[group[0]]
        if pole.imag != 0 and rest:
            group.append(min(rest, key=lambda j: abs(poles[j] - np.conj(pole))))
            rest.remove(group[1])
        groups.append(group)
    return groups


def observer_controller(plant: GeneralizedPlant, F: ArrayLike, L: ArrayLike) -> control.StateSpace:
    """Return the observer (10.63) with u = F xhat as a controller u = K y.

    Parameters
    ----------
    plant : GeneralizedPlant
    F : array_like, shape (nu, nx)
        State feedback, the thesis's D_c.
    L : array_like, shape (nx, ny)
        Observer gain, the thesis's C_c.

    Returns
    -------
    control.StateSpace
        Its states are the estimates, named after the plant's states with ``_hat``.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> K = rp.synthesis.observer_controller(plant, [[-3.0]], [[4.0]])
    >>> sorted(plant.closed_loop(K).poles().real.round(9).tolist())
    [-3.0, -2.0]
    """
    F = matrix("F", F, (plant.nu, plant.nx))
    L = matrix("L", L, (plant.nx, plant.ny))
    A = plant.A + plant.B2 @ F - L @ (plant.C2 + plant.D22 @ F)
    states = [f"{name}_hat" for name in plant.states]
    names = (plant.measurement_names, plant.control_names, states)
    return named_system((A, L, F, np.zeros((plant.nu, plant.ny))), plant.dt, *names)
