"""The protocol of the engines of feedback synthesis: the task of one part, and what they find."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import control
import numpy as np

from robustpolish.base.budget import Budget, step_cost
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.synthesis.certificate import ANY_NORM, Certificate, Norm, NormTarget
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices, balanced, close
from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.problem.preflight import ScaledPlant
from robustpolish.synthesis.proofs.bounded_real import estimate_norm
from robustpolish.synthesis.riccati.gamma import LowerBound

# Rungs of the ladder of regularisations: half decades, for gamma falls by at most a third from one
# to the next where it settles. Below 3e-9 rounding decides (AC12, ROC10).
EPSILONS = tuple(10.0 ** (-k / 2) for k in range(2, 18))
# By how much the axis is moved, over the plant's unit of frequency, where D12 and D21 have full
# rank and zeros lie on it: as much as the norm allows, for the poles keep this distance. It has to
# be less than that of the slowest weight, whose poles nothing moves.
SHIFTS = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
# A relative fall of the norm that is none.
SETTLED = 3e-4
# A norm that two decades of the ladder have lowered to less than this share falls on.
FALLING = 0.9
# More states than this make every check of a loop take long, so that fewer are made.
COSTLY_STATES = 24
# An infimum that is approached without end counts as zero below this share of the norm at the start
# of the descent; smaller norms would cost gain for nothing (AC1, UWV).
AS_GOOD_AS_ZERO = 1e-6
# A ladder ends within this share of the tolerance above the lower bound. The rest of the tolerance
# buys smaller gains and fewer states.
_NEAR = 0.25


@dataclass(frozen=True)
class Settings:
    """What the user asks of the engines.

    Attributes
    ----------
    norm, method, backend, solver, tolerance, wanted
        As in the public functions.
    engines : tuple of type
        Called one after the other until the goal is reached.
    full_state : bool
        State feedback: y = x, and a static gain is wanted.
    regions : tuple of PoleRegion
        Where the closed-loop poles have to lie, in the plant's unit of time.
    gain_bound : float or None
        Bound on the largest singular value of a static gain, in the plant's units.
    reference : float
        A norm of the whole plant beside which one that falls without end counts as zero.
    relaxations : tuple of float
        Factors on the tolerance of the engines, the next one where no controller of the one before
        could be certified.
    """

    norm: Norm
    method: str
    backend: str
    solver: str | None
    tolerance: float
    wanted: NormTarget = ANY_NORM
    engines: tuple[type[Engine], ...] = ()
    full_state: bool = False
    regions: tuple[PoleRegion, ...] = ()
    gain_bound: float | None = None
    reference: float = 0.0
    relaxations: tuple[float, ...] = (1.0,)


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
    wanted : NormTarget
        What was asked for, in scaled units.
    scaled : ScaledPlant or None
        The units of the part, for state feedback.
    """

    plant: PlantMatrices
    norm: Norm
    regular: bool
    tolerance: float
    bound: LowerBound | None
    wanted: NormTarget = ANY_NORM
    scaled: ScaledPlant | None = None

    @property
    def goal(self) -> float:
        """The norm below which smaller ones are worth nothing; zero if the infimum is unknown."""
        return self.wanted.limited(self._above_bound(0.99))

    @property
    def near(self) -> float:
        """The norm at which a search may end; zero if the infimum is unknown."""
        return self.wanted.limited(self._above_bound(_NEAR))

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
    def keeps_claim(self) -> bool:
        """Whether the loop keeps the promise."""
        return self.achieved <= self.claimed * (1 + 1e-3)

    @property
    def promise(self) -> float:
        """What the method claimed; LQG promises no number, so that its norm is its claim."""
        return self.claimed if np.isfinite(self.claimed) else self.achieved


class Engine(ABC):
    """One search for controllers of one part, and what it has found.

    Attributes
    ----------
    settings : Settings
    problem : Task
    budget : Budget
    method, backend : str
        Who searched, as designs tell it.
    candidates : list of Candidate
        Every controller whose loop was checked and stable.
    history : list of dict
        One entry for every step.
    falling : bool
        Whether the norm was still falling when the search met a limit of gain or accuracy.
    remarks : list of str
        What the user should know, such as a solver's false claim.
    bound : LowerBound or None
        A norm that no controller falls below, where the engine looked for it.
    constrained : bool
        Whether a demand of which the bound knows nothing keeps a norm from being called optimal.
    """

    method = "riccati"
    backend = "scipy"

    def __init__(self, settings: Settings, problem: Task, budget: Budget) -> None:
        self.settings, self.problem, self.budget = settings, problem, budget
        self.candidates: list[Candidate] = []
        self.history: list[dict[str, Any]] = []
        self.remarks: list[str] = []
        self.falling = self.constrained = False
        self.bound: LowerBound | None = None

    @staticmethod
    def is_useful(problem: Task, earlier: Sequence[Engine]) -> bool:
        """Tell whether a search is of use after those of other engines that missed the goal."""
        return True

    @abstractmethod
    def search(self) -> None:
        """Look for controllers with a small norm."""

    def objections(
        self, K: control.StateSpace, proof: Certificate, promised: float
    ) -> Sequence[str]:
        """Tell what else a certified controller in the plant's units breaks."""
        return ()

    @property
    def best(self) -> float:
        """The smallest norm of a checked loop; infinite if there is none."""
        return min((c.achieved for c in self.candidates), default=np.inf)

    def checked(self, K: Controller, claimed: float, origin: str) -> Candidate | None:
        """Return a controller with the norm of its loop; None if it does not stabilise."""
        return check_candidate(self.problem, K, claimed, origin, self.budget)


def check_candidate(
    problem: Task, K: Controller, claimed: float, origin: str, budget: Budget
) -> Candidate | None:
    """Balance a controller and check its loop; None if it does not stabilise."""
    if not all(np.isfinite(M).all() for M in K):
        return None
    K = balanced(K)
    states = problem.plant.nx + len(K.A)
    # Beyond so many states of a loop its norm comes from its modes, at the expense of a step on
    # the plant.
    modal = states > 100 and problem.norm == "hinf"
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
        found = estimate_norm(*loop)
        # Up to so many states of a loop an exact norm is quick where doubles cannot tell.
        if found.settled or len(loop.A) > 16:
            return found.value
    system = control.StateSpace(*loop, plant.discrete)
    if norm == "h2":
        return float(h2_norm(system, tolerance=1e-3).value)
    proven = hinf_norm(system, tolerance=1e-6)
    return float(proven.value) if proven.stable else np.inf
