"""BFGS with a weak Wolfe line search for functions with kinks (Lewis and Overton, 2013)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import AnyVector as Vector
from robustpolish.arrays import Array
from robustpolish.long_calls import Budget

Function = Callable[[Vector], tuple[float, Vector]]


@dataclass(frozen=True, eq=False)
class Descent:
    """Where a descent ended.

    Attributes
    ----------
    point, value : ndarray, float
    iterations : int
    reason : str
        "stationary", "stalled", "target", "iterations", "work" or "time".
    """

    point: Vector
    value: float
    iterations: int
    reason: str


def bfgs(
    function: Function,
    start: Vector,
    budget: Budget,
    work: float = 1.0,
    iterations: int = 300,
    target: float = -np.inf,
    tolerance: float = 1e-7,
) -> Descent:
    """Minimise a function that is smooth almost everywhere.

    Parameters
    ----------
    function : callable
        theta -> (value, gradient); the value may be infinite.
    start : ndarray
        A point with a finite value.
    budget : Budget
    work : float
        What one evaluation of the function takes of it.
    iterations : int
        Largest number of steps.
    target : float
        Stop as soon as the value is below it.
    tolerance : float
        Stop when twenty steps together gain less than this.

    Returns
    -------
    Descent
    """

    def counted(point: Vector) -> tuple[float, Vector]:
        budget.spend(work)
        return function(point)

    x = np.array(start, dtype=float)
    f, g = counted(x)
    H = np.eye(len(x)) / max(1.0, float(np.linalg.norm(g)))
    past = [f]
    fresh = True
    for count in range(1, iterations + 1):
        if f < target:
            return Descent(x, f, count, "target")
        if budget.over:
            return Descent(x, f, count, ended_by(budget))
        direction = -H @ g
        slope = float(g @ direction)
        downhill = np.isfinite(slope) and slope < 0
        step = _weak_wolfe(counted, x, f, g, direction, slope, budget) if downhill else None
        if step is None:
            if fresh:
                return Descent(x, f, count, "stalled" if downhill else "stationary")
            H, fresh = np.eye(len(x)) / max(1.0, float(np.linalg.norm(g))), True
            continue
        x_new, f_new, g_new = step
        H = _update(H, x_new - x, g_new - g, fresh)
        x, f, g, fresh = x_new, f_new, g_new, False
        past.append(f)
        if len(past) > 20 and past[-21] - f < tolerance:
            return Descent(x, f, count, "stalled")
    return Descent(x, f, iterations, "iterations")


def ended_by(budget: Budget) -> str:
    """Return what ended a search whose budget is over: "work" or "time"."""
    return "work" if budget.exhausted else "time"


def _weak_wolfe(
    function: Function,
    x: Vector,
    f: float,
    g: Vector,
    direction: Vector,
    slope: float,
    budget: Budget,
) -> tuple[Vector, float, Vector] | None:
    """Bisect for a step that descends and lets the slope rise; the best descent if none."""
    low, high, t = 0.0, np.inf, 1.0
    best: tuple[Vector, float, Vector] | None = None
    for _ in range(40):
        x_new = x + t * direction
        f_new, g_new = function(x_new)
        if not f_new <= f + 1e-4 * t * slope:
            high = t
        else:
            best = (x_new, f_new, g_new)
            if g_new @ direction >= 0.5 * slope:
                return best
            low = t
        t = 0.5 * (low + high) if np.isfinite(high) else 2 * low
        if budget.over:
            break
    return best if best is not None and best[1] < f else None


def _update(H: Array, s: Vector, y: Vector, first: bool) -> Array:
    """Return the BFGS update of the inverse Hessian, unchanged where curvature is lost."""
    curvature = float(s @ y)
    if not np.isfinite(curvature) or curvature <= 1e-14 * np.linalg.norm(s) * np.linalg.norm(y):
        return H
    if first:
        H = np.eye(len(s)) * curvature / float(y @ y)
    rho = 1 / curvature
    Hy = H @ y
    mixed = np.outer(s, Hy)
    return H - rho * (mixed + mixed.T) + rho * (1 + rho * float(y @ Hy)) * np.outer(s, s)
