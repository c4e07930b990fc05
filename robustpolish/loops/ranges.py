"""For which machines near the model a loop is proven stable: its modes and actuators moved."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy import linalg

from robustpolish.base.arrays import SAME, Matrix
from robustpolish.linear.stability import eigensystem
from robustpolish.loops.loop import Loop, sample_step
from robustpolish.loops.requirements import LoopRequirements
from robustpolish.plants.uncertain.build import (
    append,
    feedback,
    series,
    uncertain_real,
    uncertain_system,
)
from robustpolish.robust.questions import RobustStability, robust_stability

MOST_STATES, MOST_NUMBERS = 60, 24
"""Of loops that are asked about: some seconds."""
# How far, relative, the bounds of a range may lie apart.
_GAP = 0.02


def proven_range(loop: Loop, asked: LoopRequirements) -> RobustStability | None:
    """Prove stability while stiffness and damping of every mode and all actuators' gains differ.

    A mode of the plant obeys q'' + c q' + k q = b u, with q such that the control that moves it
    most acts on q'' alone. Its k and c are moved; those of sampled modes to first order. Real poles
    on both sides of the axis are a mode of negative stiffness, other real poles stay.

    Parameters
    ----------
    loop : Loop
        Delays that the plant keeps are Padé's.
    asked : LoopRequirements
        Says how far each may differ.

    Returns
    -------
    RobustStability or None
        In shares of what was asked; None for a loop that is too large.
    """
    A, B, C, D = loop.plant_matrices
    scales = linalg.matrix_balance(A, permute=False, separate=True)[1][0] if A.size else np.ones(0)
    moved: Any = A * scales / scales[:, None]
    B, C = B / scales[:, None], C * scales
    share = np.array([asked.stiffness_percent, asked.damping_percent]) / 100
    names: list[str] = []
    changes = []
    for hertz, by, rows, columns in _modes(moved, sample_step(loop.dt)):
        one, two = rows @ moved @ columns, rows @ B
        at = int(np.abs(two).max(axis=0).argmax())
        own = np.array([two[1, at], -two[0, at]]) if two[:, at].any() else np.eye(2)[0]
        q = np.vstack([own, own @ one])
        # Directions at a smaller angle are one.
        if not abs(np.linalg.det(q)) > SAME * np.prod(np.linalg.norm(q, axis=1)):
            continue
        into = columns @ np.linalg.inv(q)[:, 1:]
        moves = share[:, None] * by @ q @ rows
        for word, row in zip(("stiffness", "damping"), moves, strict=True):
            if row.any():
                names.append(_free(f"{word} of the mode at {hertz:.3g} Hz", names))
                changes.append((row[None], uncertain_real(names[-1], 0.0, range=(-1, 1)), into))
    for name in loop.plant.control_names:
        names.append(f"gain of {name}")
    if len(A) + loop.controller.nstates > MOST_STATES or len(names) > MOST_NUMBERS:
        return None
    for row, number, into in changes:
        unit = np.sqrt(np.linalg.norm(row) / np.linalg.norm(into))
        moved = moved + series(row / unit, number, into * unit)
    percent = asked.actuator_percent
    drives = [uncertain_real(name, 1.0, percent=percent) for name in names[len(changes) :]]
    plant = series(append(*drives), uncertain_system(moved, B, C, D, loop.dt))
    return robust_stability(feedback(plant, loop.controller, 1), gap=_GAP)


def _free(name: str, taken: list[str]) -> str:
    """Return a name, with a number behind if it is taken."""
    tries = (name, *(f"{name} ({i})" for i in range(2, len(taken) + 2)))
    return next(one for one in tries if one not in taken)


def _modes(A: Matrix, step: float) -> Iterator[tuple[Any, ...]]:
    """Return hertz, moves, and dual bases of the left and right subspaces of each mode.

    The moves are how -(a0, a1) of the mode's polynomial differ where k, or c, is larger by all of
    itself: k and c themselves in continuous time.
    """
    spectrum = eigensystem(A)
    values, left, right = spectrum.values, spectrum.left, spectrum.right
    known = (values.imag != 0) | (values.real > 0) if step else np.ones(values.size, bool)
    rates: Any = np.log(np.where(known, values, 1)) / step if step else values
    pairs = [(i, i) for i in np.flatnonzero(rates.imag > 0)]
    sinking = known & (rates.imag == 0) & (rates.real < -spectrum.errors)
    still = list(np.flatnonzero(sinking))
    for i in np.flatnonzero(known & (rates.imag == 0) & (rates.real > spectrum.errors)):
        if still:
            still.remove(j := min(still, key=lambda j: abs(rates[i] + rates[j])))
            pairs.append((i, j))
    for i, j in pairs:
        parts = ((v[:, i].real, v[:, i].imag if i == j else v[:, j].real) for v in (left, right))
        rows, columns = (np.column_stack(pair) for pair in parts)
        inner = rows.T @ columns
        if not abs(np.linalg.det(inner)) > SAME:
            continue  # nearly multiple
        one, two = rates[i], rates[i].conj() if i == j else rates[j]
        k, c, apart = (one * two).real, -(one + two).real, one - two
        by = np.diag([-k, -c])
        if step:  # z^2 + a1 z + a0 has the roots exp(rates * step)
            first, second = (step * np.exp(rate * step) / apart for rate in (one, two))
            a1 = k * (first - second), c * (one * first - two * second)
            by = -np.array([[0, a1[0].real], [-step * c * np.exp(-c * step), a1[1].real]])
        yield abs(k) ** 0.5 / (2 * np.pi), by, np.linalg.solve(inner, rows.T), columns
