"""The form of the engines that search state feedbacks, and of their answers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import Budget, step_cost
from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.problem.preflight import Status

# The thresholds of the search for a state feedback, each with its reason and its case.


@dataclass(frozen=True)
class StatePolicy:
    """When a search steps, stops and gives away.

    All numbers are relative or in scaled units, in which entries of the plant are about one.

    Attributes
    ----------
    work : float
        Steps that one design may take, a few milliseconds each. A bound on the gain of the brush's
        plant takes 13 000 of them, everything else on it less than 1 000, and one program for 40
        states 15 000.
    coarse : float
        Tolerance where a design only serves as a start or shows a trend; a fifth of it is a
        tenth of the norm, which keeps gains small.
    bracket : float
        Final width of the bisection on gamma over the slack that is given away afterwards.
    price_step : float
        Factor between two prices on u.
    prices : tuple of float
        Prices on u, falling by ``price_step``: from "no control" to rounding errors.
    converged : float
        A norm that moves by less than this share from price to price has reached its limit ...
    solver_tolerance, eased_tolerance : float
        Of interior-point solvers; the second where the first makes them break down.
    noise : tuple of float
        One round of inequalities each, with this disturbance on all states over the one
        that is there, for the H2 norm. Without it Y is singular where w excites little (one axis of
        the bearing at rest), and without a pole region the optimal gain does not depend on it.
    smallest_share : float
        Eigenvalues below this share of the largest are rounding errors of a solver.
    coarse_slack : float
        With more slack than this the gain of least effort is taken as it is.
    bound_starts : int
        Starts from which each search under a bound on the gain is run.
    starting_prices : tuple of float
        Prices on u, falling, whose designs are those starts.
    iterations : int
        Steps of one descent on the true norm.
    gained : float
        A step that gains less than this share ends a search.
    bound_margin : float
        The bound is kept by this share, so that rounding does not break it.
    bound_noise : float
        States that w hardly reaches are still given this share of the disturbance.
    """

    work: float = 1e5
    coarse: float = 0.5
    bracket: float = 1e-2
    price_step: float = 10.0
    prices: tuple[float, ...] = tuple(10.0**k for k in range(3, -9, -1))
    converged: float = 3e-4
    solver_tolerance: float = 1e-9
    eased_tolerance: float = 1e-7
    noise: tuple[float, ...] = (1e-1, 1e-2, 1e-3, 1e-4, 1e-4)
    smallest_share: float = 1e-13
    coarse_slack: float = 1e-2
    bound_starts: int = 2
    starting_prices: tuple[float, ...] = tuple(10.0**k for k in range(4, -10, -1))
    iterations: int = 150
    gained: float = 1e-5
    bound_margin: float = 1e-9
    bound_noise: float = 1e-3

    @staticmethod
    def gain_work(states: int) -> float:
        """Return the work of one Riccati equation and the norm of its loop."""
        return step_cost(2 * states)


POLICY = StatePolicy()


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
        As in :class:`robustpolish.results.Design`; a search that minimises a norm says
        "suboptimal",
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
        # Share of the tolerance that is given away for a smaller gain: the gain often grows
        # without limit towards the optimum (force actuation, H-infinity: 1.7e8 at 2e-5 from the
        # optimum).
        return 0.2 * self.tolerance

    def with_least_tolerance(self, tolerance: float) -> StateEngine:
        """Return the engine with at least this tolerance."""
        return replace(self, tolerance=max(self.tolerance, tolerance))
