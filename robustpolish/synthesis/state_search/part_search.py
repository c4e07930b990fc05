"""The search on one decoupled part of a plant: scaled, solved, brought back to its own units."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.errors import SolverError
from robustpolish.long_calls import Budget
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.design.wanted_norm import ANY_NORM, WantedNorm
from robustpolish.synthesis.problem.full_state import (
    is_regular,
    measuring_states,
    only_effort,
    stabilises,
    state_gain_norm,
)
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.pole_regions import Disk
from robustpolish.synthesis.problem.scaling import ScaledPlant, scale_plant
from robustpolish.synthesis.riccati.state import least_state_norm
from robustpolish.synthesis.state_search.engine import StateEngine, StateGain
from robustpolish.synthesis.state_search.gain_bound import GainBound, minimise_bounded
from robustpolish.synthesis.state_search.policy import POLICY
from robustpolish.synthesis.state_search.singular_problem import almost_no_control, solve_singular
from robustpolish.synthesis.state_search.smallest_gain import SmallestGain


def solve_parts(
    plants: Sequence[GeneralizedPlant],
    engine: StateEngine,
    tolerance: float,
    gain_bound: float | None,
    budget: Budget,
    wanted: WantedNorm = ANY_NORM,
) -> list[StateGain]:
    """Minimise the norm of every part.

    Parameters
    ----------
    plants : sequence of GeneralizedPlant
    engine : StateEngine
        With regions in the plants' unit of time.
    tolerance : float
        Distance from the lower bound within which a gain is "optimal"; the engine's own may
        be relaxed.
    gain_bound : float or None
        Bound on the largest singular value of every gain in the plants' units.
    budget : Budget
    wanted : WantedNorm, optional
        A norm that will do for every part, in the plants' units.

    Returns
    -------
    list of StateGain
        In the plants' units.

    Raises
    ------
    SolverError
        If no verified gain was found for one of them.
    """
    parts = [_Part.of(plant, engine, budget) for plant in plants]
    references = [part.reference() for part in parts]
    reference = max(references) if engine.norm == "hinf" else math.hypot(*references)
    # Machines are symmetric: equal parts are solved once.
    known: dict[tuple[bytes, ...], StateGain] = {}
    for part in parts:
        if part.fingerprint not in known:
            known[part.fingerprint] = part.solve(reference, gain_bound, tolerance, wanted)
    return [known[part.fingerprint] for part in parts]


@dataclass(frozen=True, eq=False)
class _Part:
    """A part in its own and in scaled units, and who searches it.

    Attributes
    ----------
    scaled : ScaledPlant
    plant : PlantMatrices
        Of the scaled plant.
    engine : StateEngine
        With regions in the scaled unit of time.
    budget : Budget
    """

    scaled: ScaledPlant
    plant: PlantMatrices
    engine: StateEngine
    budget: Budget

    @classmethod
    def of(cls, plant: GeneralizedPlant, engine: StateEngine, budget: Budget) -> _Part:
        """Scale a plant and the regions of the engine."""
        scaled = scale_plant(plant)
        inside = engine.in_unit_of_time(scaled.time)
        return cls(scaled, measuring_states(PlantMatrices.of(scaled.plant)), inside, budget)

    @property
    def fingerprint(self) -> tuple[bytes, ...]:
        """What is the same for parts with the same matrices."""
        return PlantMatrices.of(self.scaled.original).fingerprint

    @property
    def is_idle(self) -> bool:
        """Whether nothing is to be minimised: no disturbance, or no performance output."""
        p = self.plant
        return not p.B1.any() or not (p.C1.any() or p.D12.any() or p.D11.any())

    @property
    def is_direct(self) -> bool:
        """Whether the inequalities have an optimum without a price on u."""
        bounded = any(isinstance(region, Disk) for region in self.engine.regions)
        return is_regular(self.plant) or bounded

    def reference(self) -> float:
        """Return the norm with almost no control if the part has no optimum; 0 otherwise."""
        if self.plant.nu == 0 or self.is_idle or self.is_direct:
            return 0.0
        value = almost_no_control(self.plant, self.engine.norm)
        return self.scaled.norm(value, self.engine.norm) if math.isfinite(value) else 0.0

    def solve(
        self, reference: float, gain_bound: float | None, tolerance: float, wanted: WantedNorm
    ) -> StateGain:
        """Minimise the norm.

        Parameters
        ----------
        reference : float
            Norm of the whole with almost no control: what a vanishing norm is small against.
        gain_bound : float or None
        tolerance : float
        wanted : WantedNorm
        """
        p = self.plant
        if p.nu == 0 or self.is_idle:
            return self.in_units(self.stabilised())
        norm = self.engine.norm
        enough = wanted.in_unit(self.scaled.norm(1.0, norm)).limited(0.0)
        if gain_bound is not None:
            found = self.bounded(gain_bound)
        else:
            found = self.engine.search(p, self.budget) if self.is_direct else None
            found = self.singular(reference, enough) if found is None else found
        if found.achieved <= enough:
            left, right = np.diag(self.scaled.control), np.diag(1 / self.scaled.state)
            found = SmallestGain(self.engine, p, left, right, self.budget).within(enough, found)
        least = least_state_norm(p, norm, found.achieved, tolerance, self.budget)
        # With regions it says no more than that the region costs nothing visible.
        if found.achieved <= least * (1 + tolerance) and not self.engine.regions:
            found = replace(found, status="optimal")
        return self.in_units(replace(found, lower_bound=least))

    def stabilised(self) -> StateGain:
        """Stabilise a part whose norm no control changes, with little effort."""
        p, engine = self.plant, self.engine
        none = np.zeros((p.nu, p.nx))
        if p.nu == 0 or (not engine.regions and stabilises(p, none)):
            found = StateGain(none, 0.0, 0.0)
        else:
            effort = only_effort(p, 1.0)
            found = replace(engine, norm="h2").search(effort, self.budget)
        if found is None:
            raise self.nothing_found()
        norm = state_gain_norm(p, found.F, engine.norm)
        return replace(found, claimed=norm, achieved=norm, lower_bound=norm, status="optimal")

    def bounded(self, bound: float) -> StateGain:
        """Minimise the norm under a bound on the gain."""
        gain = GainBound(np.diag(self.scaled.control), np.diag(1 / self.scaled.state), bound)
        found = minimise_bounded(self.engine, self.plant, gain, self.budget)
        if found is None:
            raise SolverError(
                f"No stabilising gain with a largest singular value of at most {bound:.6g} was "
                "found. That none exists is not proven. Raise gain_bound, or set control_weight "
                "instead."
            )
        return found

    def singular(self, reference: float, enough: float) -> StateGain:
        """Follow the infimum of a norm for which control is free, down to `enough`."""
        norm, regions = self.engine.norm, self.engine.regions
        target = max(self.scaled.scaled_norm(POLICY.vanished * reference, norm), enough)
        found = solve_singular(self.engine, self.plant, target, self.gain_size, self.budget)
        if found is None:
            raise self.nothing_found()
        fell = found.achieved <= target
        return replace(found, status="suboptimal") if regions and not fell else found

    def gain_size(self, F: Matrix) -> float:
        """Return the largest singular value of a scaled gain in the plant's units."""
        return float(np.linalg.norm(self.scaled.state_gain(F), 2)) if F.size else 0.0

    def in_units(self, found: StateGain) -> StateGain:
        """Bring an answer back to the plant's units."""
        unit = self.scaled.norm(1.0, self.engine.norm)
        history = tuple(
            entry | {key: entry[key] * unit for key in _NORMS if key in entry}
            for entry in found.history
        )
        return replace(
            found,
            F=self.scaled.state_gain(found.F),
            claimed=found.claimed * unit,
            achieved=found.achieved * unit,
            lower_bound=found.lower_bound * unit,
            history=history,
        )

    def nothing_found(self) -> SolverError:
        """Return the error for a part without an answer."""
        states = ", ".join(self.scaled.original.states[:6])
        return SolverError(
            f"No verified state feedback was found for the part with the states {states}"
            + (" before the time limit. Raise time_limit" if self.budget.late else "")
            + (
                ". Widen pole_region: the inequalities use one Lyapunov matrix for all demands"
                if self.engine.regions
                else ""
            )
            + ". Try the other method or backend."
        )


_NORMS = ("claimed", "achieved", "no_gain_found_at")
