"""What the search needs to know of a kind of controller, and of one part of the plant."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal, Protocol

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import AnyVector as Vector
from robustpolish.long_calls import Budget
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.nonsmooth import (
    Bounds,
    GainMeasure,
    H2Measure,
    HinfMeasure,
    Measure,
    Parametrisation,
    Problem,
    Requirement,
    StabilityMeasure,
    WorstMeasure,
)
from robustpolish.synthesis.problem.decoupling import (
    PlantPart,
    joined_controller,
    named_controller,
)
from robustpolish.synthesis.problem.fixed_modes import refuse_fixed_modes
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.scaling import ScaledPlant, scale_plant
from robustpolish.synthesis.problem.static_loop import augmented, controller_loop
from robustpolish.synthesis.structured_search.policy import POLICY, Effort

Norm = Literal["hinf", "h2"]


class StartProposal(Protocol):
    """One way to find starts for the descents."""

    def propose(
        self, earlier: Sequence[Vector], budget: Budget, rng: np.random.Generator
    ) -> Iterator[Vector]:
        """Propose free numbers, the best first; `earlier` lists what others proposed before."""
        ...


@dataclass(frozen=True, eq=False)
class PartProblem:
    """The search for the controller of one decoupled part.

    Attributes
    ----------
    scaled : ScaledPlant
        The part before and after scaling.
    norm : {"hinf", "h2"}
    order : int
        States of the controller.
    parametrisation : Parametrisation
        From the free numbers to K = [[Ak, Bk], [Ck, Dk]] of the scaled part.
    starts : tuple of StartProposal
        Asked one after the other, until the search is over.
    what : str
        What is designed, for messages.
    gain_bound : float or None
        Bound of the controller's largest singular value over frequency, in plant units.
    specifications : tuple of Requirement
        What is demanded besides.
    demands : str
        All that is demanded in words, for messages; empty if nothing is.
    effort : Effort
    objective_loop : PlantMatrices or None
        The loop whose norm is minimised, if it is another than `loop`.
    bounds : pair of ndarray or None
        Bounds of the free numbers.
    open_ended : ndarray of bool or None
        Whose upper bound only ends the search: at it the infimum is not attained.
    size : Measure or None
        What is made small in the end; the largest singular value of K by default.
    slack : float
        Share of the norm that is given away for that.
    advice : str
        What to try where nothing stable was found.
    extra : bytes
        What tells the problem from another one of its structure on the same matrices.
    """

    scaled: ScaledPlant
    norm: Norm
    order: int
    parametrisation: Parametrisation
    starts: tuple[StartProposal, ...]
    what: str
    gain_bound: float | None = None
    specifications: tuple[Requirement, ...] = ()
    demands: str = ""
    effort: Effort = POLICY.static
    objective_loop: PlantMatrices | None = None
    bounds: Bounds | None = None
    open_ended: NDArray[np.bool_] | None = None
    size: Measure | None = None
    slack: float = POLICY.slack
    advice: str = "Raise order="
    extra: bytes = b""

    @property
    def plant(self) -> GeneralizedPlant:
        """The part in its own units."""
        return self.scaled.original

    @cached_property
    def loop(self) -> PlantMatrices:
        """The scaled part, with integrators for a dynamic controller."""
        return augmented(PlantMatrices.of(self.scaled.plant), self.order)

    @cached_property
    def objective(self) -> Measure:
        """The norm that is minimised."""
        return norm_measure(self.objective_loop or self.loop, self.norm)

    @cached_property
    def controller_loop(self) -> PlantMatrices:
        """The controller itself from y to u, in plant units."""
        left, right = np.diag(self.scaled.control), np.diag(1 / self.scaled.measurement)
        return controller_loop(self.order, left, right, self.plant.is_discrete)

    @cached_property
    def requirements(self) -> tuple[Requirement, ...]:
        """All specifications and the bound on the gain, over frequency if K is dynamic."""
        if self.gain_bound is None:
            return self.specifications
        if self.order:
            size: Measure = HinfMeasure(self.controller_loop)
        else:
            size = GainMeasure(np.diag(self.scaled.control), np.diag(1 / self.scaled.measurement))
        return (*self.specifications, Requirement(size, self.gain_bound))

    @property
    def stable_loops(self) -> tuple[PlantMatrices, ...]:
        """What has to be stable: the loop, and a dynamic controller whose gain is bounded."""
        alone = self.gain_bound is not None and self.order > 0
        return (self.loop, self.controller_loop) if alone else (self.loop,)

    @property
    def stability(self) -> Measure:
        """Negative where all that has to be stable is."""
        size = float(np.linalg.norm(self.loop.A, 2)) or 1.0
        return WorstMeasure(tuple(StabilityMeasure.of(each, size) for each in self.stable_loops))

    def below(self, ceiling: float) -> Problem:
        """Return what the descents minimise, over gains below a ceiling."""
        return Problem(self.parametrisation, self.objective, self.requirements, ceiling)

    def proposals(self, budget: Budget, rng: np.random.Generator) -> Iterator[Vector]:
        """Ask one proposal of starts after the other."""
        earlier: list[Vector] = []
        for proposal in self.starts:
            for start in proposal.propose(tuple(earlier), budget, rng):
                earlier.append(start)
                yield start

    @property
    def key(self) -> tuple[bytes, ...]:
        """What is the same for problems with the same answer."""
        return (self.extra, *PlantMatrices.of(self.plant).fingerprint)

    def controller(self, K: Matrix) -> control.StateSpace:
        """Return K = [[Ak, Bk], [Ck, Dk]] of the scaled part as a controller in plant units."""
        # Entries that only rounding left in place of a zero are zeros.
        K = np.where(np.abs(K) < 1e-13 * np.abs(K).max(initial=0.0), 0.0, K)
        k = self.order
        own = control.StateSpace(
            K[:k, :k], K[:k, k:], K[k:, :k], K[k:, k:], self.plant.dt, remove_useless_states=False
        )
        back = self.scaled.controller(own)
        return named_controller(self.plant, *map(np.array, (back.A, back.B, back.C, back.D)))


@dataclass(frozen=True, eq=False)
class PartDesign:
    """The controller of one part, in its units, and how the search went.

    Attributes
    ----------
    scaled : ScaledPlant
    controller : control.StateSpace
    point : ndarray
        The free numbers, for the scaled part.
    norm : float
        As the descent measured it; the certificate computes it anew.
    reason : str
        Why the search stopped.
    agreeing, descents : int
        How many descents reached the best norm, of how many.
    at_ceiling : bool
        The norm still fell when a limit of the gain was met.
    history : tuple of mapping
        One entry per descent.
    """

    scaled: ScaledPlant
    controller: control.StateSpace
    point: Vector
    norm: float
    reason: str
    agreeing: int
    descents: int
    at_ceiling: bool
    history: tuple[Any, ...]


class Structure(ABC):
    """A kind of controller: how it is searched part by part, and put together."""

    method: ClassVar[str] = "descent"

    @abstractmethod
    def problem(self, part: PlantPart) -> PartProblem | None:
        """State the problem of one part; None if the structure leaves nothing to choose in it.

        Raises
        ------
        InfeasibleError
            If no controller of the structure does.
        """

    def join(
        self,
        plant: GeneralizedPlant,
        parts: Sequence[PlantPart],
        designs: Sequence[PartDesign | None],
    ) -> tuple[control.StateSpace, dict[str, Any]]:
        """Return the controller of the whole plant, and what the method wants to tell of it."""
        return joined_controller(plant, parts, [d and d.controller for d in designs]), {}


def bound_in_words(gain_bound: float | None) -> str:
    """Return a bound on the gain as a demand in words."""
    return "" if gain_bound is None else f"the gain bound {gain_bound:g}"


def scaled_part(
    plant: GeneralizedPlant, what: str, mask: NDArray[np.bool_] | None = None
) -> tuple[ScaledPlant, PlantMatrices]:
    """Scale a part, unless an unstable mode of it is fixed for all gains with the mask.

    Raises
    ------
    InfeasibleError
        If one is; it is named.
    """
    scaled = scale_plant(plant)
    inner = PlantMatrices.of(scaled.plant)
    free = np.ones((plant.nu, plant.ny), bool) if mask is None else mask
    refuse_fixed_modes(inner, free, plant.states, scaled.time, what)
    return scaled, inner


def norm_measure(loop: PlantMatrices, norm: Norm) -> Measure:
    """Return the norm of a loop; of its states where no disturbance reaches any output."""
    if not (loop.nw and loop.nz):
        n, zeros = loop.nx, np.zeros
        loop = loop.replace(
            B1=np.eye(n),
            C1=np.eye(n),
            D11=zeros((n, n)),
            D12=zeros((n, loop.nu)),
            D21=zeros((loop.ny, n)),
        )
    return HinfMeasure(loop) if norm == "hinf" else H2Measure(loop)
