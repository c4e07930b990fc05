"""What every engine of output feedback is given and returns: one problem, one kind of findings."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import control
import numpy as np

from robustpolish.analysis import h2_norm, hinf_norm
from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.long_calls import Budget, step_cost
from robustpolish.synthesis.certificate.certificate import Norm
from robustpolish.synthesis.certificate.quick_norm import quick_norm
from robustpolish.synthesis.design.wanted_norm import ANY_NORM, WantedNorm
from robustpolish.synthesis.output_search.policy import POLICY
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices, balanced, close
from robustpolish.synthesis.riccati.infimum import LowerBound


@dataclass(frozen=True)
class Settings:
    """What the user asks of the engines."""

    norm: Norm
    method: str
    backend: str
    solver: str | None
    tolerance: float
    wanted: WantedNorm = ANY_NORM


@dataclass(frozen=True, eq=False)
class Task:
    """One part of a plant as the engines see it.

    Attributes
    ----------
    plant : PlantMatrices
        Scaled, without D22; without D11 for the H2 norm.
    norm : {"hinf", "h2"}
    regular : bool
        Whether D12 and D21 have full rank.
    tolerance : float
        How far above the infimum, relative, is good enough.
    bound : LowerBound or None
        A norm below which no controller comes, in scaled units; None if none is known.
    wanted : WantedNorm
        What was asked for, in scaled units.
    """

    plant: PlantMatrices
    norm: Norm
    regular: bool
    tolerance: float
    bound: LowerBound | None
    wanted: WantedNorm = ANY_NORM

    @property
    def goal(self) -> float:
        """The norm below which smaller ones are worth nothing; zero if the infimum is unknown."""
        return self.wanted.limited(self._above_bound(0.99))

    @property
    def near(self) -> float:
        """The norm at which a search may end; zero if the infimum is unknown."""
        return self.wanted.limited(self._above_bound(POLICY.near))

    @property
    def asked(self) -> float:
        """A norm above the infimum that was asked for and will do; zero if none was."""
        asked = self.wanted.enough
        return asked if asked > self._above_bound(1.0) else 0.0

    def _above_bound(self, share: float) -> float:
        """Return the norm that lies by a share of the tolerance above the lower bound."""
        return 0.0 if self.bound is None else self.bound.value * (1 + share * self.tolerance)


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
    def order(self) -> int:
        """Number of the controller's states."""
        return len(self.controller.A)

    @property
    def honest(self) -> bool:
        """Whether the loop keeps the promise."""
        return self.achieved <= self.claimed * (1 + 1e-3)

    @property
    def promise(self) -> float:
        """What the method claimed; LQG promises no number, so that its norm is its claim."""
        return self.claimed if np.isfinite(self.claimed) else self.achieved

    def beside(self, feedback: Matrix) -> Candidate:
        """Return the candidate together with a static controller that was closed before."""
        K = self.controller
        return replace(self, controller=K._replace(D=K.D + feedback))


@dataclass
class Found:
    """What an engine has found on one part.

    Attributes
    ----------
    method, backend : str
    candidates : list of Candidate
        Every controller whose loop was checked and stable.
    history : list of dict
        One entry for every step.
    falling : bool
        Whether the norm was still falling when the search met a limit of gain or accuracy.
    remarks : list of str
        What the user should know, such as a solver's false claim.
    """

    method: str
    backend: str
    candidates: list[Candidate] = field(default_factory=list)
    history: list[dict[str, Any]] = field(default_factory=list)
    falling: bool = False
    remarks: list[str] = field(default_factory=list)

    @property
    def best(self) -> float:
        """The smallest norm of a checked loop; infinite if there is none."""
        return min((c.achieved for c in self.candidates), default=np.inf)


class Engine(ABC):
    """A way to find controllers.

    Parameters
    ----------
    settings : Settings
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings

    def adds(self, problem: Task, earlier: Sequence[Found]) -> bool:
        """Tell whether a search is of use after those of other engines that missed the goal."""
        return True

    @abstractmethod
    def search(self, problem: Task, budget: Budget) -> Found:
        """Look for controllers with a small norm."""


def examine(
    problem: Task, K: Controller, claimed: float, origin: str, budget: Budget
) -> Candidate | None:
    """Balance a controller and check its loop; None if it does not stabilise."""
    if not all(np.isfinite(M).all() for M in K):
        return None
    K = balanced(K)
    states = problem.plant.nx + len(K.A)
    modal = states > POLICY.modal_loop_states and problem.norm == "hinf"
    budget.spend(step_cost(problem.plant.nx if modal else states))
    achieved = _loop_norm(problem.plant, K, problem.norm)
    return Candidate(K, achieved, claimed, origin) if np.isfinite(achieved) else None


def _loop_norm(plant: PlantMatrices, K: Controller, norm: Norm) -> float:
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
        if found.settled or len(loop.A) > POLICY.exact_loop_states:
            return found.value
    system = control.StateSpace(*loop, plant.discrete)
    if norm == "h2":
        return float(h2_norm(system, tolerance=1e-3).value)
    proven = hinf_norm(system, tolerance=1e-6)
    return float(proven.value) if proven.stable else np.inf
