"""Static and fixed-order output feedback with a pattern of free entries."""

from __future__ import annotations

from dataclasses import dataclass, replace

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.errors import InfeasibleError
from robustpolish.synthesis.nonsmooth import AffineGain, MaskedGain
from robustpolish.synthesis.problem.decoupling import PlantPart
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.scaling import ScaledPlant
from robustpolish.synthesis.problem.static_loop import augmented
from robustpolish.synthesis.structured_search.grown_starts import GrownStarts
from robustpolish.synthesis.structured_search.reduced_starts import ReducedStarts
from robustpolish.synthesis.structured_search.starts import (
    DrawnStarts,
    KnownStarts,
    RegulatorStart,
    StabilisingStart,
)
from robustpolish.synthesis.structured_search.structure import (
    Norm,
    PartProblem,
    StartProposal,
    Structure,
    bound_in_words,
    scaled_part,
)
from robustpolish.validation import described, invalid


@dataclass(frozen=True, eq=False)
class StaticStructure(Structure):
    """Output feedback [[Ak, Bk], [Ck, Dk]] of a given order, with free entries where allowed.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    order : int
        States of the controller of each part.
    mask : ndarray of bool, shape (order + nu, order + ny), or None
        Free entries, of the whole plant; all of each part by default.
    gain_bound : float or None
    initial : control.StateSpace or None
        For the whole plant: where to start first.
    """

    norm: Norm
    order: int = 0
    mask: NDArray[np.bool_] | None = None
    gain_bound: float | None = None
    initial: control.StateSpace | None = None

    def problem(self, part: PlantPart) -> PartProblem | None:
        """State the search over the free entries of one part; see :meth:`Structure.problem`."""
        plant, order, start = part.plant, self.order, self.initial
        own = np.ix_(part.controls, part.measurements)
        if self.mask is None:
            mask = np.ones((order + plant.nu, order + plant.ny), bool)
        else:
            mask = self.mask if order else self.mask[own]
        if plant.nx == 0 or not mask.any():
            return None
        if start is not None and not order:
            start = control.StateSpace([], [], [], np.asarray(start.D)[own], plant.dt)
        what = f"controller of order {order}" if order else "static gain"
        # Whatever the pattern of a dynamic controller, it moves no mode that no gain moves.
        scaled, inner = scaled_part(plant, what, None if order else mask)
        loop = augmented(inner, order)
        free = MaskedGain(mask) if self.norm == "hinf" else free_gain(mask, loop)
        rest = free.coordinates(resting(mask.shape, order, loop.discrete))
        known = [] if start is None else [free.coordinates(scaled_matrix(start, scaled))]
        starts: list[StartProposal] = [KnownStarts([*known, rest])]
        if self.mask is None:
            if order:
                # Half the order, down to none: each search starts from the one before.
                shorter = replace(self, order=order // 2, initial=None).problem(part)
                if shorter is not None:
                    starts.append(GrownStarts(shorter, order, free.coordinates))
            starts.append(ReducedStarts(scaled.plant, self.norm, order, free.coordinates))
        return PartProblem(
            scaled=scaled,
            norm=self.norm,
            order=order,
            parametrisation=free,
            starts=(
                *starts,
                StabilisingStart(loop, mask, free.coordinates),
                RegulatorStart(loop, mask, free.coordinates),
                DrawnStarts(-1.5, 1.5, relative=False, base=rest),
            ),
            what=what,
            gain_bound=self.gain_bound,
            demands=bound_in_words(self.gain_bound),
            extra=mask.tobytes() + b"".join(point.tobytes() for point in known),
        )


def resting(shape: tuple[int, int], order: int, discrete: bool) -> Matrix:
    """Return the K whose states decay and whose u is zero."""
    rest = np.zeros(shape)
    rest[:order, :order] = 0.0 if discrete else -np.eye(order)
    return rest


def free_gain(mask: NDArray[np.bool_], loop: PlantMatrices) -> AffineGain | MaskedGain:
    """Free the marked entries, as far as the feedthrough of a continuous loop stays zero.

    Raises
    ------
    InfeasibleError
        If no gain of the pattern cancels D11.
    """
    free = MaskedGain(mask)
    if loop.discrete or not loop.D11.size:
        return free
    if not (loop.D11.any() or (loop.D12.any() and loop.D21.any())):
        return free
    if loop.has_d22:
        raise invalid(
            "plant",
            described("a D22 together with D11 or with D12 and D21"),
            "D22 = 0 for the H2 norm of such a plant",
            "Absorb D22 into the controller, K = K0 (I + D22 K0)^-1, and design K0.",
        )
    restricted = free.restricted(loop.D12, loop.D21, -loop.D11)
    if restricted is None:
        raise InfeasibleError(
            "The H2 norm is infinite for every controller of this structure: none cancels the "
            "feedthrough D11 from w to z. Filter the disturbance or the output, or use 'hinf'."
        )
    return restricted


def scaled_matrix(controller: control.StateSpace, scaled: ScaledPlant) -> Matrix:
    """Return [[Ak, Bk], [Ck, Dk]] of a controller in the units of the scaled plant."""
    u, y = scaled.control[:, None], scaled.measurement
    A, B, C, D = (np.asarray(M) for M in (controller.A, controller.B, controller.C, controller.D))
    return np.block([[A * scaled.time, B * scaled.time * y], [C / u, D * y / u]])
