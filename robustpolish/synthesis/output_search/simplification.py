"""Shorter controllers: fast modes replaced by their gain, nearly cancelling ones dropped."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from scipy import linalg

from robustpolish.synthesis.output_search.candidates import Candidate, examine
from robustpolish.synthesis.problem.deadline import Deadline
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices

_MANY = 24


def simplify(
    plant: PlantMatrices, candidate: Candidate, limit: float, deadline: Deadline, norm: str = "hinf"
) -> Candidate:
    """Remove modes of the controller while the norm of its loop stays below a limit.

    Near the optimum the central controller has a mode that runs away; elsewhere modes
    cancel against each other or against the plant. Both cost gain and order for nothing.

    Parameters
    ----------
    plant : PlantMatrices
        Scaled.
    candidate : Candidate
    limit : float
        The largest norm that is accepted.
    deadline : Deadline
    norm : {"hinf", "h2"}

    Returns
    -------
    Candidate
        The last one that passed, perhaps `candidate` itself.
    """
    current = candidate
    if len(candidate.controller.A) > _MANY:
        return _halved(plant, candidate, limit, deadline, norm)
    while len(current.controller.A) and not deadline.expired:
        shorter = _shorter(plant, current, limit, deadline, norm)
        if shorter is None:
            break
        current = shorter
    return current


def _halved(
    plant: PlantMatrices, current: Candidate, limit: float, deadline: Deadline, norm: str
) -> Candidate:
    """Remove the fastest half, quarter or eighth of many modes, for every trial takes long."""
    speeds = np.sort(np.abs(np.linalg.eigvals(current.controller.A)))
    n = len(speeds)
    for count in (n // 2, n // 4, n // 8):
        # Between two speeds, so that no pair is torn apart.
        bound = float(np.sqrt(speeds[n - count] * speeds[n - count - 1])) if count < n else 0.0
        trials = _without(
            current.controller, lambda v, b=bound: np.abs(v) > b, residualise=norm == "hinf"
        )
        for K in trials:
            if deadline.expired:
                return current
            found = examine(plant, K, limit, current.origin, norm)
            if found is not None and found.achieved <= limit and found.gain <= 1.5 * current.gain:
                return found
    return current


def _shorter(
    plant: PlantMatrices, current: Candidate, limit: float, deadline: Deadline, norm: str
) -> Candidate | None:
    for K in _reductions(current.controller, norm):
        if deadline.expired:
            return None
        found = examine(plant, K, limit, current.origin, norm)
        if found is not None and found.achieved <= limit and found.gain <= 1.5 * current.gain:
            return found
    return None


def _reductions(K: Controller, norm: str) -> Iterator[Controller]:
    """Propose controllers with one mode less: without the fastest, without the weakest."""
    values = np.linalg.eigvals(K.A)
    fastest = np.abs(values).max()
    yield from _without(K, lambda v: np.abs(v) > 0.9 * fastest, residualise=norm == "hinf")
    weakest = _weakest(K, values)
    if weakest is not None:
        close = 1e-9 * fastest
        yield from _without(
            K,
            lambda v: (np.abs(v - weakest) <= close) | (np.abs(v - weakest.conjugate()) <= close),
            residualise=False,
        )


def _weakest(K: Controller, values: Any) -> complex | None:
    """Return the eigenvalue whose mode adds least to the controller's response."""
    _, vectors = np.linalg.eig(K.A)
    try:
        left = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        return None
    damping = np.maximum(np.abs(values.real), 1e-12 * np.abs(values).max())
    size = np.linalg.norm(K.C @ vectors, axis=0) * np.linalg.norm(left @ K.B, axis=1) / damping
    i = int(np.argmin(size))
    return complex(values[i]) if size[i] <= 1e-2 * size.max() else None


def _without(
    K: Controller, removed: Callable[[Any], Any], residualise: bool
) -> Iterator[Controller]:
    """Split off the modes that `removed` selects and drop them, perhaps keeping their gain."""
    try:
        T, Z, kept = linalg.schur(  # type: ignore[misc]
            K.A, output="real", sort=lambda re, im: not removed(np.array(complex(re, im)))
        )
        n = len(T)
        if kept == n:
            return
        slow, fast = slice(0, kept), slice(kept, n)
        X = linalg.solve_sylvester(T[slow, slow], -T[fast, fast], -T[slow, fast])
        B, C = Z.T @ K.B, K.C @ Z
        B_slow, C_fast = B[slow] - X @ B[fast], C[:, fast] + C[:, slow] @ X
        D = K.D
        if residualise:
            D = D - C_fast @ np.linalg.solve(T[fast, fast], B[fast])
    except (linalg.LinAlgError, ValueError):
        return
    yield Controller(T[slow, slow], B_slow, C[:, slow], D)
