"""Controllers made of tunable blocks: where to start, what cannot work, and the way back."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from typing import Any, ClassVar

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import AnyVector as Vector
from robustpolish.base.budget import Budget
from robustpolish.errors import InfeasibleError
from robustpolish.plants.blocks import named_system
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.nonsmooth.descent import Bounds, ReflectedParametrisation
from robustpolish.synthesis.problem.matrices import PlantMatrices, augmented, close_static_loop
from robustpolish.synthesis.problem.preflight import PlantPart, ScaledPlant
from robustpolish.synthesis.structured import starts
from robustpolish.synthesis.structured.block_parts import (
    ParameterTransform,
    TunedBlock,
    TunedBlocks,
    TunedNumber,
)
from robustpolish.synthesis.structured.block_wiring import (
    BlockGain,
    LoopSize,
    Placement,
    block_parametrisation,
    crossover_band,
    crossover_size,
)
from robustpolish.synthesis.structured.search import (
    ControllerStructure,
    PartDesign,
    PartProblem,
    SearchEffort,
    StartProposal,
    drawn_starts,
    scaled_part,
)

# Gains of a first guess, where 1 makes the loop cross over: low, so that a stable plant stays so.
_LOW = 0.1
# Scatter of drawn numbers, in natural logarithms, and how often a gain has another sign than the
# others of its block.
_SCATTER, _ODD = 1.0, 0.15


# Scatter of the entries of a K that is free, in decimal logarithms, as of static feedback.
_WIDE = (-1.5, 1.5)


@dataclass(frozen=True, eq=False)
class BlockStructure(ControllerStructure):
    """Tunable blocks between measurements and controls of the whole plant.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    placement : Placement
    gain_bound : float or None
    initial : mapping of str to float
        Where to start, by the names of numbers.
    """

    norm: Norm
    placement: Placement
    gain_bound: float | None = None
    initial: Mapping[str, float] = field(default_factory=dict)
    method: ClassVar[str] = "blocks"

    def problem(self, part: PlantPart) -> PartProblem | None:
        """State the search over the numbers."""
        placement, what = self.placement, "choice of the blocks' numbers"
        scaled, inner = scaled_part(part.plant, what, placement.mask)
        search = self._search_of_entries if _entries_alone(placement) else self._search_of_numbers
        gain, bounds, proposals, rest = search(scaled, inner)
        order = len(gain.leave) - part.plant.nu
        loop = augmented(inner, order)
        rng = np.random.default_rng(0)
        drawn = (
            proposals[-1](Budget(), rng)
            if rest is None
            else drawn_starts(_WIDE, [rest], False, rng)
        )
        _refuse_unstabilisable(placement, gain, loop, drawn, self.norm)
        return PartProblem(
            scaled=scaled,
            norm=self.norm,
            order=order,
            parametrisation=gain,
            starts=proposals,
            scatter=None if rest is None else _WIDE,
            rest=rest,
            what=what,
            gain_bound=self.gain_bound,
            bounds=bounds,
            # Blocks have few numbers, and their descents mostly agree.
            effort=SearchEffort(descents=60, fewest=5, patience=12),
            advice="Look whether limits force signs (u = K y: sign=-1 is negative feedback), free "
            "more numbers",
        )

    def _search_of_entries(
        self, scaled: ScaledPlant, inner: PlantMatrices
    ) -> tuple[BlockGain, None, tuple[StartProposal, ...], Vector]:
        """Return K of the numbers, and the starts of a static or fixed-order feedback."""
        gain, numbers = block_parametrisation(self.placement, scaled), self.placement.numbers
        rest = np.array([0.0 if inner.discrete else n.slot.default for n in numbers])
        given = [self.initial.get(n.key) for n in numbers]
        pairs = zip(given, gain.coordinates, rest, strict=True)
        first = np.array([r if v is None else c.theta(v) for v, c, r in pairs])
        loop = augmented(inner, len(gain.leave) - inner.nu)
        mask = gain.gain(np.ones(gain.size)) != 0
        # Each number is one entry of K, so that the adjoint is the inverse.
        coordinates = partial(gain.back, np.zeros(gain.size))
        proposals = (
            partial(starts.known, [first]),
            partial(starts.stabilising, loop, mask, coordinates),
            partial(starts.regulator, loop, mask, coordinates),
        )
        return gain, None, proposals, rest

    def _search_of_numbers(
        self, scaled: ScaledPlant, inner: PlantMatrices
    ) -> tuple[BlockGain, Bounds, tuple[StartProposal, ...], None]:
        """Return K of the numbers, their limits, and guesses for a crossover of the loop."""
        placement, initial, band = self.placement, self.initial, crossover_band(inner)
        middle = crossover_size(inner, float(np.sqrt(band[0] * band[1])))
        gain = block_parametrisation(placement, scaled, middle)

        def guess(units: LoopSize, share: float, rng: np.random.Generator | None) -> Vector:
            signs = np.ones(len(placement.blocks))
            if rng is not None:
                signs = rng.choice([-1.0, 1.0], len(signs))
            # Numbers that were given are kept in half of the draws.
            keep = rng is None or rng.random() < 0.5
            there = block_parametrisation(placement, scaled, units).coordinates
            theta = []
            for number, own, size in zip(placement.numbers, gain.coordinates, there, strict=True):
                scatter = 0.0 if rng is None else rng.normal() * _SCATTER
                given = initial.get(number.key, number.tunable.value)
                if given is not None and keep:
                    odd = 0.0 if own.search == "linear" else 0.3 * scatter
                    theta.append(own.theta(given) + odd)
                    continue
                if number.slot.default:
                    value = number.slot.default * size.size * math.exp(scatter)
                else:
                    value = share * signs[number.block] * size.size * math.exp(scatter)
                    if rng is not None and rng.random() < _ODD:
                        value = -value
                theta.append(_within_limits(own, value))
            return np.array(theta)

        first = guess(middle, _LOW, None)
        low, high = np.array([c.bounds(t) for c, t in zip(gain.coordinates, first, strict=True)]).T
        folded = ReflectedParametrisation(gain, (low, high))

        def propose(budget: Budget, rng: np.random.Generator) -> Iterator[Vector]:
            yield first
            while True:
                crossover = float(np.exp(rng.uniform(*np.log(band))))
                yield folded.point(guess(crossover_size(inner, crossover), 1.0, rng))

        return gain, (low, high), (propose,), None

    def join(
        self,
        plant: GeneralizedPlant,
        parts: Sequence[PlantPart],
        designs: Sequence[PartDesign | None],
    ) -> tuple[control.StateSpace, dict[str, Any]]:
        """Return the controller with named states, and the blocks with their numbers."""
        (found,) = designs
        assert found is not None
        gain: Any = found.part.parametrisation
        numbers = zip(self.placement.numbers, gain.coordinates, found.point, strict=True)
        idle = tuple(number.key for number, c, theta in numbers if c.idle(theta))
        controller = _controller(plant, self.placement, gain.gain(found.point), found.part.scaled)
        blocks = _tuned(self.placement, gain.numbers(found.point))
        return controller, {"blocks": blocks, "idle_integrals": idle}


def _within_limits(coordinate: ParameterTransform, value: float) -> float:
    """Return the coordinate of a number, or of one that its limits allow."""
    low, high = coordinate.low, coordinate.high
    if not low < value < high:
        value = min(max(-value, low), high)
    if value in (low, high):
        if math.isfinite(low) and math.isfinite(high):
            value = math.sqrt(low * high) if low > 0 else 0.5 * (low + high)
        elif coordinate.search == "positive":
            value = 2 * low if math.isfinite(low) and low > 0 else 0.5 * high
    return coordinate.theta(value)


def _entries_alone(placement: Placement) -> bool:
    """Whether K itself is free but for its zeros."""
    joined = np.zeros(placement.mask.shape)
    for block in placement.blocks:
        (stage, *more) = block.stages
        if more or not stage.resizable or any(slot.given is not None for slot in stage.slots):
            return False
        joined[block.driven[:, None], block.read] += 1
    return bool((joined <= 1).all())


# A mode that stays within this share of the state matrix of 0, whatever the numbers, is stuck.
_STUCK = 1e-11
_TRIES = 5


def _refuse_unstabilisable(
    placement: Placement,
    gain: BlockGain,
    loop: PlantMatrices,
    drawn: Iterator[Vector],
    norm: Norm,
) -> None:
    """Refuse integrators that no number stabilises, and feedthroughs that no H2 norm has."""
    names, at = _integrators(placement)
    stuck, always, tried = set(names), True, 0
    for theta in islice(drawn, 1, 4 * _TRIES):
        closed = close_static_loop(loop, gain.gain(theta))
        if closed is None:
            continue
        tried += 1
        always &= bool(np.abs(closed.D).max(initial=0.0) > 0)
        stuck &= {names[i] for i in np.flatnonzero(_integrators_at_zero(closed.A, at))}
        if tried == _TRIES:
            break
    if stuck and tried:
        listed = " and ".join(sorted(stuck))
        raise InfeasibleError(
            f"No numbers stabilise the integrators of {listed}: the loop keeps a mode at 0. Either "
            "the plant passes nothing constant from control to measurement (a zero at 0), or there "
            "are more integrators than controls or measurements tell apart. Leave one out "
            "(kind='PD' or 'P').",
            [0j],
        )
    if norm == "h2" and not loop.discrete and always and tried:
        through = "The plant passes w straight to z (D11)" if loop.D11.any() else ""
        blocks = "The blocks pass the noise of w straight on to z"
        raise InfeasibleError(
            f"The H2 norm is infinite whatever the numbers. {through or blocks}. "
            "Put rp.tunable.low_pass() in series with the blocks "
            "or choose fixed_order(feedthrough=False), "
            "filter disturbances that reach z directly, or use norm='hinf'."
        )


def _integrators_at_zero(A: Matrix, integrators: Sequence[int]) -> NDArray[np.bool_]:
    """Tell which integrators take part in a mode of the loop at 0."""
    if len(A) and integrators:
        values, vectors = np.linalg.eig(A)
        mode = int(np.argmin(np.abs(values)))
        if abs(values[mode]) <= _STUCK * np.linalg.norm(A, 2):
            return np.abs(vectors[:, mode])[integrators] > 1e-6
    return np.zeros(len(integrators), bool)


def _integrators(placement: Placement) -> tuple[list[str], list[int]]:
    """Return the names of stages that integrate, and where their integrals stand from the end."""
    labels = [
        (stage.name or stage.kind, x) for _, _, stage in placement.places for x in stage.states
    ]
    at = [i for i, (_, label) in enumerate(labels) if label == "integral"]
    return [labels[i][0] for i in at], [i - len(labels) for i in at]


def _controller(
    plant: GeneralizedPlant, placement: Placement, K: Matrix, scaled: ScaledPlant
) -> control.StateSpace:
    u, y = scaled.control[:, None], scaled.measurement
    k = len(K) - plant.nu
    A, B = K[:k, :k] / scaled.time, K[:k, k:] / scaled.time / y
    C, D = u * K[k:, :k], u * K[k:, k:] / y
    states = [f"{stage.name}.{label}" for _, _, stage in placement.places for label in stage.states]
    names = (plant.measurement_names, plant.control_names, states)
    return named_system((A, B, C, D), plant.dt, *names)


def _tuned(placement: Placement, values: Vector) -> TunedBlocks:
    free = {n.key: (n.tunable, float(v)) for n, v in zip(placement.numbers, values, strict=True)}
    units, found = placement.plant.units, []
    for i, j, stage in placement.places:
        block = placement.blocks[i]
        y = [units.get(name, "") for name in block.measurements]
        u = [units.get(name, "") for name in block.controls]
        numbers = []
        for slot in stage.slots:
            key, unit = placement.key(stage, slot), slot.unit(*block.around(j, y, u))
            if slot.held is None:
                number, value = free[key]
                limits = number.low, number.high
            else:
                value, limits = slot.held, (slot.held, slot.held)
            tuned = slot.held is None
            numbers.append(TunedNumber(slot.name, value, unit, key, *limits, tuned))
        found.append(TunedBlock(stage.name or stage.kind, stage.formula, tuple(numbers)))
    return TunedBlocks(
        tuple(found), tuple(b.law(b.measurements, b.controls) for b in placement.blocks)
    )
