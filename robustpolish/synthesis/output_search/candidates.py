"""Controllers whose loop has been checked, and the choice among them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import control
import numpy as np

from robustpolish.analysis import h2_norm, hinf_norm
from robustpolish.synthesis.certificate.quick_norm import quick_norm
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices, balanced, close

# Up to so many states of the loop an exact norm is quick, where doubles cannot tell.
_SMALL = 16


@dataclass(frozen=True, eq=False)
class Candidate:
    """A controller that stabilises the scaled plant.

    Attributes
    ----------
    controller : Controller
        For the plant without D22, its states balanced.
    achieved : float
        The norm of its loop, computed from the loop.
    claimed : float
        The bound that its method promised.
    origin : str
        The method, and the setting that made it.
    """

    controller: Controller
    achieved: float
    claimed: float
    origin: str

    @property
    def gain(self) -> float:
        """Largest entry of the controller's matrices, in scaled units."""
        return self.controller.gain

    @property
    def honest(self) -> bool:
        """Whether the loop keeps the promise."""
        return self.achieved <= self.claimed * (1 + 1e-3)


@dataclass
class Findings:
    """What an engine has found on one plant.

    Attributes
    ----------
    method, backend : str
    candidates : list of Candidate
        Every controller whose loop was checked and stable.
    history : list of dict
        One entry for every step.
    converged : bool
        Whether the norm stopped falling before accuracy or time ran out.
    falling : bool
        Whether it was still falling when the search met a limit of gain or accuracy.
    expired : bool
        Whether time ran out.
    remarks : list of str
        What the user should know, such as a solver's false claim.
    """

    method: str
    backend: str
    candidates: list[Candidate] = field(default_factory=list)
    history: list[dict[str, Any]] = field(default_factory=list)
    converged: bool = False
    falling: bool = False
    expired: bool = False
    remarks: list[str] = field(default_factory=list)

    @property
    def best(self) -> float:
        """The smallest norm of a checked loop; infinite if there is none."""
        return min((c.achieved for c in self.candidates), default=np.inf)


def loop_norm(plant: PlantMatrices, K: Controller, norm: str = "hinf") -> float:
    """Return the norm from w to z; infinite if the loop is not stable.

    The result guides a search. It is certified once the search is over.
    """
    loop = close(plant, K)
    if not all(np.isfinite(M).all() for M in loop):
        return np.inf
    poles: Any = np.linalg.eigvals(loop.A) if loop.A.size else np.zeros(0)
    margin = 1 - np.abs(poles) if plant.discrete else -poles.real
    if margin.min(initial=1.0) <= 0:
        return np.inf
    if 0 in loop.D.shape:
        return 0.0
    if norm == "hinf" and not plant.discrete:
        found = quick_norm(*loop)
        if found.settled or len(loop.A) > _SMALL:
            return found.value
    system = control.StateSpace(*loop, plant.discrete)
    if norm == "h2":
        return float(h2_norm(system, tolerance=1e-3).value)
    proven = hinf_norm(system, tolerance=1e-6)
    return float(proven.value) if proven.stable else np.inf


def examine(
    plant: PlantMatrices, K: Controller, claimed: float, origin: str, norm: str = "hinf"
) -> Candidate | None:
    """Balance a controller and check its loop; None if it does not stabilise."""
    if not all(np.isfinite(M).all() for M in K):
        return None
    K = balanced(K)
    achieved = loop_norm(plant, K, norm)
    return Candidate(K, achieved, claimed, origin) if np.isfinite(achieved) else None


def preferred(candidates: Iterable[Candidate], slack: float, level: float = 0.0) -> list[Candidate]:
    """Sort candidates by preference.

    Parameters
    ----------
    candidates : iterable of Candidate
    slack : float
        How far above the best norm, relative, a smaller gain is preferred to a smaller norm.
    level : float
        A norm below which smaller ones are worth nothing.

    Returns
    -------
    list of Candidate
        Those within the slack first, by gain and then order; the others by norm. If the level
        decides, the third and later ones below it come last.
    """
    listed = list(candidates)
    best = min((c.achieved for c in listed), default=np.inf)
    limit = max(best * (1 + slack), level)
    within = [c for c in listed if c.achieved <= limit]
    within.sort(key=lambda c: (c.gain, len(c.controller.A)))
    above = sorted((c for c in listed if c.achieved > limit), key=lambda c: c.achieved)
    # Far below the level loops are ever harder to prove, above it ever easier.
    first = within[:2] if level > best * (1 + slack) else within
    return [*first, *above, *within[len(first) :]]
