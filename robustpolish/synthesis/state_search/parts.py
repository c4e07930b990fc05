"""One decoupled part of a plant: scaled, solved, brought back to its own units."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robustpolish.errors import SolverError
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.design.status import Status
from robustpolish.synthesis.problem.pole_regions import Disk, PoleRegion
from robustpolish.synthesis.problem.scaling import ScaledPlant, scale_plant
from robustpolish.synthesis.problem.state_feedback_problem import StateFeedbackProblem
from robustpolish.synthesis.state_search.engines import Answer, Engine, minimise
from robustpolish.synthesis.state_search.gain_bound import GainBound, minimise_bounded
from robustpolish.synthesis.state_search.shrinking_price import (
    almost_no_control,
    is_regular,
    solve_singular,
)

Matrix = NDArray[np.float64]

# A norm that keeps falling is followed down to this share of what almost no control gives.
_VANISHED = 1e-4


@dataclass(frozen=True, eq=False)
class PartAnswer:
    """The gain of one part in the plant's units, and what is known about it.

    Attributes
    ----------
    F : ndarray, shape (nu, nx)
    claimed : float
        Bound on the norm of the part, in the plant's units.
    status : str
        As in :class:`robustpolish.Design`.
    history : tuple of dict
        Norms in the plant's units.
    """

    F: Matrix
    claimed: float
    status: Status
    history: tuple[dict[str, Any], ...]


@dataclass(frozen=True, eq=False)
class Part:
    """A part in its own and in scaled units.

    Attributes
    ----------
    scaled : ScaledPlant
    problem : StateFeedbackProblem
        Of the scaled plant.
    regions : tuple of PoleRegion
        In the scaled unit of time.
    """

    scaled: ScaledPlant
    problem: StateFeedbackProblem
    regions: tuple[PoleRegion, ...] = ()

    @classmethod
    def of(cls, plant: GeneralizedPlant, regions: Sequence[PoleRegion] = ()) -> Part:
        """Scale a plant and its regions."""
        scaled = scale_plant(plant)
        inside = tuple(region.in_unit_of_time(scaled.time) for region in regions)
        return cls(scaled, StateFeedbackProblem.of(scaled.plant), inside)

    def gain_size(self, F: Matrix) -> float:
        """Return the largest singular value of a scaled gain in the plant's units."""
        return float(np.linalg.norm(self.scaled.state_gain(F), 2)) if F.size else 0.0

    @property
    def fingerprint(self) -> bytes:
        """Bytes that are the same for parts with the same matrices."""
        plant = self.scaled.original
        matrices = (plant.A, plant.B1, plant.B2, plant.C1, plant.D11, plant.D12)
        return b"|".join(str(m.shape).encode() + m.tobytes() for m in matrices)

    @property
    def is_idle(self) -> bool:
        """Whether nothing is to be minimised: no disturbance, or no performance output."""
        p = self.problem
        return not p.B1.any() or not (p.C.any() or p.D12.any() or p.D11.any())

    @property
    def is_direct(self) -> bool:
        """Whether the inequalities have an optimum without a price on u."""
        bounded = any(isinstance(region, Disk) for region in self.regions)
        return is_regular(self.problem) or bounded

    def in_units(self, answer: Answer, engine: Engine, status: Status) -> PartAnswer:
        """Bring an answer back to the plant's units."""
        unit = self.scaled.norm(1.0, engine.norm)
        history = tuple(
            entry | {key: entry[key] * unit for key in _NORMS if key in entry}
            for entry in answer.history
        )
        return PartAnswer(self.scaled.state_gain(answer.F), answer.claimed * unit, status, history)


_NORMS = ("claimed", "achieved", "no_gain_found_at")


def reference_norm(part: Part, engine: Engine) -> float:
    """Return the norm of a part that has no optimum with almost no control; 0 for others."""
    if part.problem.nu == 0 or part.is_idle or part.is_direct:
        return 0.0
    value = almost_no_control(part.problem, engine.norm)
    return part.scaled.norm(value, engine.norm) if math.isfinite(value) else 0.0


def solve_part(
    part: Part, engine: Engine, reference: float, gain_bound: float | None = None
) -> PartAnswer:
    """Minimise the norm of one part.

    Parameters
    ----------
    part : Part
    engine : Engine
    reference : float
        Norm of the whole plant with almost no control: what a vanishing norm is small against.
    gain_bound : float, optional
        Bound on the largest singular value of the gain in the plant's units.

    Returns
    -------
    PartAnswer

    Raises
    ------
    SolverError
        If no verified gain was found.
    """
    p = part.problem
    if p.nu == 0:
        F = np.zeros((0, p.nx))
        return _as_it_is(part, engine, F)
    if part.is_idle:
        return _stabilised(part, engine)
    if gain_bound is not None:
        return _bounded(part, engine, gain_bound)
    if part.is_direct:
        answer = minimise(engine, p, part.regions)
        if answer is not None:
            status: Status = "suboptimal" if part.regions or not answer.sharp else "optimal"
            return part.in_units(answer, engine, status)
    target = part.scaled.scaled_norm(_VANISHED * reference, engine.norm)
    found = solve_singular(engine, p, target, part.gain_size, part.regions)
    if found is None:
        raise _nothing_found(part, engine)
    status = "infimum_not_attained" if not found.attained else "optimal"
    if part.regions:
        status = "infimum_not_attained" if found.vanishing else "suboptimal"
    return part.in_units(found.answer, engine, status)


def _bounded(part: Part, engine: Engine, bound: float) -> PartAnswer:
    scaled = part.scaled
    gain = GainBound(np.diag(scaled.control), np.diag(1 / scaled.state), bound)
    answer, free = minimise_bounded(engine, part.problem, gain, is_regular(part.problem))
    if answer is None:
        raise SolverError(
            f"No stabilising gain with a largest singular value of at most {bound:.6g} was found. "
            "That none exists is not proven. Raise gain_bound, or set control_weight instead."
        )
    return part.in_units(answer, engine, "optimal" if free and answer.sharp else "suboptimal")


def _stabilised(part: Part, engine: Engine) -> PartAnswer:
    """Stabilise a part that has nothing to minimise, with little effort."""
    p = part.problem
    none = np.zeros((p.nu, p.nx))
    if not part.regions and p.is_stable(none):
        return _as_it_is(part, engine, none)
    effort = p.only_effort(1.0)
    answer = minimise(replace(engine, norm="h2"), effort, part.regions)
    if answer is None:
        raise _nothing_found(part, engine)
    achieved = p.achieved(answer.F, engine.norm)
    return part.in_units(replace(answer, claimed=achieved, achieved=achieved), engine, "optimal")


def _as_it_is(part: Part, engine: Engine, F: Matrix) -> PartAnswer:
    achieved = part.problem.achieved(F, engine.norm)
    return part.in_units(Answer(F, achieved, achieved), engine, "optimal")


def _nothing_found(part: Part, engine: Engine) -> SolverError:
    states = ", ".join(part.scaled.original.states[:6])
    out_of_time = engine.remaining() <= 0
    return SolverError(
        f"No verified state feedback was found for the part with the states {states}"
        + (" before the time limit. Raise time_limit" if out_of_time else "")
        + (
            ". Widen pole_region: the inequalities use one Lyapunov matrix for all demands"
            if part.regions
            else ""
        )
        + ". Try the other method or backend."
    )
