"""Limits of actuators, and what a controller learns of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

import control
import numpy as np
from scipy import linalg

from robustpolish.arrays import Matrix, Vector
from robustpolish.models.plant.blocks import matrices_of
from robustpolish.validation import described, invalid, one_of

Limits = float | tuple[float, float] | Mapping[str, Any] | Sequence[Any] | None
"""None, one size for all controls, (low, high) for all, or a mapping from names to either."""

Form = Literal["auto", "conditioned", "observer", "none"]

_REMEDY = 'Pass a size, (low, high), or a mapping such as {"F": 10.0, "M": (-1.0, 2.0)}.'
_SLOWEST = 0.999
"""Largest pole of a conditioned controller whose memory of a saturation is called short enough."""


class AntiWindup(NamedTuple):
    """x+ = A x + B y + L (u - v), with v = C x + D y and u its part within the limits."""

    L: Matrix
    form: str


def control_limits(limits: Limits, names: Sequence[str]) -> tuple[Vector, Vector] | None:
    """Return the lowest and the highest value of every control.

    Parameters
    ----------
    limits : float, (float, float), mapping, sequence or None
        A size s stands for (-s, s); a mapping leaves controls that it does not name unlimited; a
        list has an entry per control.
    names : sequence of str
        Of the controls.

    Returns
    -------
    (low, high) or None
        Infinite where there is no limit; None if there is none at all.

    Raises
    ------
    InvalidInputError
        If a name is unknown, or low does not lie below high.
    """
    if limits is None:
        return None
    low, high = np.full(len(names), -np.inf), np.full(len(names), np.inf)
    given: dict[str, Any]
    if isinstance(limits, Mapping):
        unknown = [name for name in limits if name not in names]
        if unknown:
            raise invalid(
                ("limits", str(unknown[0])), unknown[0], f"one of {', '.join(names)}", _REMEDY
            )
        given = dict(limits)
    elif isinstance(limits, list):
        if len(limits) != len(names):
            raise invalid("limits", limits, f"{len(names)} entries, one per control", _REMEDY)
        given = dict(zip(names, limits, strict=True))
    else:
        given = dict.fromkeys(names, limits)
    for i, name in enumerate(names):
        if name in given and given[name] is not None:
            low[i], high[i] = _pair(name, given[name])
    return (low, high) if np.isfinite([low, high]).any() else None


def anti_windup(controller: control.StateSpace, form: str = "auto") -> AntiWindup:
    """Return how a discrete controller's states follow what the actuators really do.

    Parameters
    ----------
    controller : control.StateSpace
        Discrete.
    form : {"auto", "conditioned", "observer", "none"}, optional
        "conditioned" (Hanus): the states move as if y had asked for just what the actuators do,
        L = B inv(D); it needs an invertible D. "observer": L makes A - L C stable, by a Kalman
        filter for noise that enters as y does. "auto" takes the first if it suits, the second
        otherwise.

    Returns
    -------
    AntiWindup

    Raises
    ------
    InvalidInputError
        If "conditioned" does not suit the controller.

    Notes
    -----
    R. Hanus, M. Kinnaert, J.-L. Henrotte, "Conditioning technique, a general anti-windup and
    bumpless transfer method", Automatica 23 (1987) 729-739; K. J. Astrom, L. Rundqwist,
    "Integrator windup and how to avoid it", American Control Conference 1989. Both leave the loop
    as it is while no limit is reached. No norm is claimed for a loop at its limits: simulate it.
    """
    one_of("anti_windup", form, ("auto", "conditioned", "observer", "none"))
    A, B, C, D = matrices_of(controller)
    n, nu = A.shape[0], C.shape[0]
    if form == "none" or n == 0:
        return AntiWindup(np.zeros((n, nu)), "none")
    if form in ("auto", "conditioned"):
        L = _conditioned(A, B, C, D)
        if L is not None:
            return AntiWindup(L, "conditioned")
        if form == "conditioned":
            shown = described("'conditioned' for a D without an inverse that leaves stable zeros")
            remedy = "Use anti_windup='observer'."
            raise invalid("anti_windup", shown, "an invertible D and stable zeros", remedy)
    return AntiWindup(_observer(A, B, C), "observer")


def _conditioned(A: Matrix, B: Matrix, C: Matrix, D: Matrix) -> Matrix | None:
    if D.shape[0] != D.shape[1] or np.linalg.cond(D) > 1e8:
        return None
    L = np.asarray(np.linalg.solve(D.T, B.T).T, dtype=float)
    size = np.abs(np.linalg.eigvals(A - L @ C)).max()
    return L if size < _SLOWEST else None


def _observer(A: Matrix, B: Matrix, C: Matrix) -> Matrix:
    """Return the gain of a Kalman filter; none where the controller is stable but unseen."""
    n = len(A)
    drive = B @ B.T
    drive = drive / max(np.linalg.norm(drive), 1e-300) + 1e-9 * np.eye(n)
    noise = C @ C.T / max(n, 1) + 1e-12 * max(np.linalg.norm(C) ** 2, 1e-300) * np.eye(len(C))
    try:
        P = linalg.solve_discrete_are(A.T, C.T, drive, noise)
    except (np.linalg.LinAlgError, ValueError):
        return np.zeros((n, len(C)))
    L = np.linalg.solve(C @ P @ C.T + noise, C @ P @ A.T).T
    stable = np.isfinite(L).all() and np.abs(np.linalg.eigvals(A - L @ C)).max() < 1
    return L if stable else np.zeros((n, len(C)))


def _pair(name: str, value: Any) -> tuple[float, float]:
    key = ("limits", name)
    try:
        numbers = np.atleast_1d(np.asarray(value, dtype=float))
    except (TypeError, ValueError):
        raise invalid(key, value, "a size or (low, high)", _REMEDY) from None
    if numbers.shape == (1,):
        numbers = np.array([-numbers[0], numbers[0]])
    if numbers.shape != (2,) or np.isnan(numbers).any() or not numbers[0] < numbers[1]:
        raise invalid(key, value, "a positive size, or (low, high) with low < high", _REMEDY)
    return float(numbers[0]), float(numbers[1])
