"""The form of the engines that search state feedbacks, and of their answers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.long_calls import Budget
from robustpolish.synthesis.certificate.certificate import Norm
from robustpolish.synthesis.design.status import Status
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.state_search.policy import POLICY


@dataclass(frozen=True, eq=False)
class StateGain:
    """A gain F of u = F x with a norm that was computed from its loop, and how it was found.

    Attributes
    ----------
    F : ndarray, shape (nu, nx)
    claimed, achieved : float
        What the search promises, and what the loop has.
    lower_bound : float
        No gain has a smaller norm; 0 says nothing.
    status : str
        As in :class:`robustpolish.Design`; a search that minimises a norm says "suboptimal",
        because only the lower bound can tell that it is "optimal".
    history : tuple of dict
        One entry per step.
    """

    F: Matrix
    claimed: float
    achieved: float
    lower_bound: float = 0.0
    status: Status = "suboptimal"
    history: tuple[dict[str, Any], ...] = ()


@dataclass(frozen=True)
class StateEngine(ABC):
    """One way to minimise a norm over state feedbacks.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    tolerance : float
        Relative; a share of it is given away for a smaller gain.
    regions : tuple of PoleRegion
        Where the poles have to lie, in the plant's unit of time.
    backend, solver : str, str or None
        Who solves the inequalities, be it only those of a bound on the gain.
    """

    norm: Norm
    tolerance: float = 1e-4
    regions: tuple[PoleRegion, ...] = ()
    backend: str = "cvxpy"
    solver: str | None = None

    @abstractmethod
    def search(self, plant: PlantMatrices, budget: Budget) -> StateGain | None:
        """Minimise the norm of a scaled plant whose D12 has full column rank.

        Parameters
        ----------
        plant : PlantMatrices
            Its states are taken as measured.
        budget : Budget
            The search ends when it is over.

        Returns
        -------
        StateGain or None
            None if no stabilising gain was found.
        """

    @property
    def slack(self) -> float:
        """Relative distance from the optimum that is given away for a smaller gain."""
        return POLICY.given_away * self.tolerance

    def coarser(self, tolerance: float) -> StateEngine:
        """Return the engine with at least this tolerance."""
        return replace(self, tolerance=max(self.tolerance, tolerance))

    def in_unit_of_time(self, seconds: float) -> StateEngine:
        """Return the engine for a plant whose time is counted in units of `seconds`."""
        return replace(self, regions=tuple(r.in_unit_of_time(seconds) for r in self.regions))
