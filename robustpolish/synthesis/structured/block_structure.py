"""Controllers made of tunable blocks: where to start, what cannot work, and the way back."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
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
from robustpolish.synthesis.nonsmooth.descent import Bounds, ReflectedParametrisation
from robustpolish.synthesis.problem.matrices import PlantMatrices, augmented, close_static_loop
from robustpolish.synthesis.problem.scaling import PlantPart, ScaledPlant
from robustpolish.synthesis.structured.block_parts import (
    ParameterSlot,
    ParameterTransform,
    TunedBlock,
    TunedBlocks,
    TunedNumber,
)
from robustpolish.synthesis.structured.block_wiring import (
    BlockGain,
    LoopUnits,
    Placement,
    block_parametrisation,
)
from robustpolish.synthesis.structured.search import (
    POLICY,
    ControllerStructure,
    Norm,
    PartDesign,
    PartProblem,
    StartProposal,
    bound_in_words,
    scaled_part,
)
from robustpolish.synthesis.structured.starts import (
    DrawnStarts,
    KnownStarts,
    RegulatorStart,
    StabilisingStart,
)

# Where the search for the numbers of blocks starts.

# Gains of a first guess, where 1 makes the loop cross over: low, so that a stable plant stays so.
_LOW = 0.1
# Scatter of drawn numbers, in natural logarithms, and how often a gain has another sign than the
# others of its block.
_SCATTER, _ODD = 1.0, 0.15


@dataclass(frozen=True, eq=False)
class BlockStarts:
    """Guesses from what makes the loop cross over somewhere.

    Attributes
    ----------
    placement : Placement
    scaled : ScaledPlant
    units : LoopUnits
    initial : mapping of str to float
        Values to start from, by name.
    """

    placement: Placement
    scaled: ScaledPlant
    units: LoopUnits
    initial: Mapping[str, float]

    @cached_property
    def gain(self) -> BlockGain:
        """K of the numbers."""
        return block_parametrisation(self.placement, self.scaled, self.units)

    @cached_property
    def first(self) -> Vector:
        """Numbers that were given, and low gains."""
        return self._guess(self.units.middle, _LOW, None)

    @cached_property
    def bounds(self) -> Bounds:
        """Limits of the coordinates."""
        pairs = zip(self.gain.coordinates, self.first, strict=True)
        low, high = np.array([c.bounds(t) for c, t in pairs]).T
        return low, high

    def propose(
        self, earlier: Sequence[Vector], budget: Budget, rng: np.random.Generator
    ) -> Iterator[Vector]:
        """Propose the first guess, then numbers for a crossover drawn anew each time."""
        yield self.first
        folded = ReflectedParametrisation(self.gain, self.bounds)
        low, high = np.log(self.units.band)
        while True:
            drawn = self._guess(float(np.exp(rng.uniform(low, high))), 1.0, rng)
            yield folded.point(drawn)

    def _guess(self, crossover: float, share: float, rng: np.random.Generator | None) -> Vector:
        units = LoopUnits(self.units.plant, crossover)
        signs = np.ones(len(self.placement.blocks))
        if rng is not None:
            signs = rng.choice([-1.0, 1.0], len(signs))
        # Numbers that were given are kept in half of the draws.
        keep = rng is None or rng.random() < 0.5
        there = block_parametrisation(self.placement, self.scaled, units).coordinates
        theta = []
        for number, own, size in zip(
            self.placement.numbers, self.gain.coordinates, there, strict=True
        ):
            scatter = 0.0 if rng is None else rng.normal() * _SCATTER
            value = self.initial.get(number.key, number.tunable.value)
            if value is not None and keep:
                odd = 0.0 if rng is None else 0.3 * scatter
                theta.append(own.theta(value) + (odd if own.search != "linear" else 0.0))
                continue
            if number.slot.default:
                value = number.slot.default * size.size * math.exp(scatter)
            else:
                value = share * signs[number.block] * size.size * math.exp(scatter)
                if rng is not None and rng.random() < _ODD:
                    value = -value
            theta.append(_placed(own, value))
        return np.array(theta)


def _placed(coordinate: ParameterTransform, value: float) -> float:
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
        """State the search over the numbers; see :meth:`Structure.problem`."""
        placement, what = self.placement, "choice of the blocks' numbers"
        scaled, inner = scaled_part(part.plant, what, placement.mask)
        gain, bounds, starts = self._search(scaled, inner)
        order = len(gain.leave) - part.plant.nu
        _refuse_unstabilisable(placement, gain, augmented(inner, order), starts[-1], self.norm)
        return PartProblem(
            scaled=scaled,
            norm=self.norm,
            order=order,
            parametrisation=gain,
            starts=starts,
            what=what,
            gain_bound=self.gain_bound,
            demands=bound_in_words(self.gain_bound),
            bounds=bounds,
            effort=POLICY.blocks,
            advice="Look whether limits force signs (u = K y: sign=-1 is negative feedback), free "
            "more numbers",
        )

    def _search(
        self, scaled: ScaledPlant, inner: PlantMatrices
    ) -> tuple[BlockGain, Bounds | None, tuple[StartProposal, ...]]:
        """Return K of the numbers, their limits, and where to start."""
        if not _entries_alone(self.placement):
            guesses = BlockStarts(self.placement, scaled, LoopUnits(inner), self.initial)
            return guesses.gain, guesses.bounds, (guesses,)
        # K itself is free: the search is that of a static or fixed-order feedback.
        gain = block_parametrisation(self.placement, scaled)
        numbers = self.placement.numbers
        rest = np.array([0.0 if inner.discrete else n.slot.default for n in numbers])
        given = [self.initial.get(n.key) for n in numbers]
        pairs = zip(given, gain.coordinates, rest, strict=True)
        first = np.array([r if v is None else c.theta(v) for v, c, r in pairs])
        loop = augmented(inner, len(gain.leave) - inner.nu)
        mask = gain.gain(np.ones(gain.size)) != 0

        def coordinates(K: Matrix) -> Vector:
            # Each number is one entry of K, so that the adjoint is the inverse.
            return gain.back(np.zeros(gain.size), K)

        starts = (
            KnownStarts([first]),
            StabilisingStart(loop, mask, coordinates),
            RegulatorStart(loop, mask, coordinates),
            DrawnStarts(-1.5, 1.5, relative=False, base=rest),
        )
        return gain, None, starts

    def join(
        self,
        plant: GeneralizedPlant,
        parts: Sequence[PlantPart],
        designs: Sequence[PartDesign | None],
    ) -> tuple[control.StateSpace, dict[str, Any]]:
        """Return the controller with named states, and the blocks with their numbers."""
        (found,) = designs
        assert found is not None
        point, scaled = found.point, found.scaled
        gain, _, _ = self._search(scaled, PlantMatrices.of(scaled.plant))
        controller = _controller(plant, self.placement, gain.gain(point), scaled)
        numbers = zip(self.placement.numbers, gain.coordinates, point, strict=True)
        idle = tuple(number.key for number, c, theta in numbers if c.idle(theta))
        blocks = _tuned(self.placement, gain.numbers(point))
        return controller, {"blocks": blocks, "idle_integrals": idle}


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
    starts: StartProposal,
    norm: Norm,
) -> None:
    """Refuse integrators that no number stabilises, and feedthroughs that no H2 norm has."""
    names, at = _integrators(placement)
    stuck, always, tried = set(names), True, 0
    for theta in islice(starts.propose((), Budget(), np.random.default_rng(0)), 1, 4 * _TRIES):
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
    if not len(A) or not integrators:
        return np.zeros(len(integrators), bool)
    found = np.linalg.eig(A)
    mode = int(np.argmin(np.abs(found[0])))
    if abs(found[0][mode]) > _STUCK * np.linalg.norm(A, 2):
        return np.zeros(len(integrators), bool)
    return np.abs(found[1][:, mode])[integrators] > 1e-6


def _integrators(placement: Placement) -> tuple[list[str], list[int]]:
    """Return the names of stages that integrate, and where their integrals stand from the end."""
    names, at, state = [], [], 0
    for _, _, stage in placement.places:
        for k, label in enumerate(stage.states):
            if label in stage.integrators:
                names.append(stage.name or stage.kind)
                at.append(state + k)
        state += len(stage.states)
    return names, [i - state for i in at]


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
    free = {n.key: (n, float(v)) for n, v in zip(placement.numbers, values, strict=True)}
    units = placement.plant.units

    def told(slot: ParameterSlot, key: str, into: Sequence[str], out: Sequence[str]) -> TunedNumber:
        unit = slot.unit(into, out)
        if slot.held is not None:
            return TunedNumber(slot.name, slot.held, unit, key, slot.held, slot.held, False)
        number, value = free[key]
        limits = number.tunable.low, number.tunable.high
        return TunedNumber(slot.name, value, unit, key, *limits, True)

    found = []
    for i, j, stage in placement.places:
        block = placement.blocks[i]
        y = [units.get(name, "") for name in block.measurements]
        u = [units.get(name, "") for name in block.controls]
        into, out = block.around(j, y, u)
        numbers = tuple(told(s, placement.key(stage, s), into, out) for s in stage.slots)
        found.append(TunedBlock(stage.name or stage.kind, stage.formula, numbers))
    return TunedBlocks(tuple(found), tuple(block.law for block in placement.blocks))
