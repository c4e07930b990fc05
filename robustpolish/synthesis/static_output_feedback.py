"""Static and fixed-order output feedback on the true norm, with a prescribed sparsity."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.analysis import h2_norm, hinf_norm
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.certificate import certify
from robustpolish.synthesis.decoupling import (
    PlantPart,
    decoupled_parts,
    joined_controller,
    named_controller,
)
from robustpolish.synthesis.design import Design, Status
from robustpolish.synthesis.pricing import priced
from robustpolish.synthesis.structured_search import (
    Norm,
    PartDesign,
    StructuredTask,
    design_part,
)
from robustpolish.validation import described, invalid, one_of, positive


def static_output_feedback(
    plant: GeneralizedPlant,
    norm: Norm = "hinf",
    structure: ArrayLike | None = None,
    order: int = 0,
    *,
    time_limit: float = 60.0,
    initial: control.StateSpace | ArrayLike | None = None,
    seed: int = 0,
    gain_bound: float | None = None,
    control_weight: ArrayLike = 0.0,
    target: float = 0.0,
) -> Design:
    r"""Design u = F y, or a dynamic controller of a given order, for the true norm.

    The problem is not convex: linear matrix inequalities only find a start. From several
    starts the norm itself is then lowered, first by BFGS, then by a bundle method that
    sees all peaks of the singular values at once, until the descents agree or time is up. What
    is returned is a local minimum, certified; no method at hand can tell whether it is global.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous or discrete, with any D.
    norm : {"hinf", "h2"}
        The norm from w to z.
    structure : array_like of bool, shape (nu, ny), optional
        True where F may differ from zero. Without it F is free within each decoupled part of
        the plant and zero between them; pass ``np.ones((nu, ny))`` to join the parts.
        For ``order > 0`` the shape is (order + nu, order + ny), for [[Ak, Bk], [Ck, Dk]].
    order : int
        States of the controller for each decoupled part; 0 is static.
    time_limit : float
        In s, for the whole call.
    initial : array_like or control.StateSpace, optional
        A controller to start from, stabilising or not: F, or a system of the given order.
    seed : int
        Of the random starts; the same seed gives the same result unless time runs out.
    gain_bound : float, optional
        Largest singular value allowed for F, in the plant's units. A dynamic controller is
        held stable and bounded at all frequencies.
    control_weight : float or array_like, shape (nu,)
        Price on u: ``control_weight`` times u joins z. In units of z per unit of u.
    target : float
        Stop as soon as the norm is below, in the plant's units.

    Returns
    -------
    Design
        With status "suboptimal" (a local minimum, as the message says),
        "infimum_not_attained" (the norm keeps falling as the gain grows) or "time_limit".
        Its plant includes the price; ``details["norm_without_price"]`` is the norm of the
        loop with the plant as it was given.

    Raises
    ------
    InvalidInputError
        If an argument does not fit the plant.
    InfeasibleError
        If an unstable mode cannot be moved by any gain of the structure; it is named.
    SolverError
        If no stabilising gain was found, which proves nothing.

    References
    ----------
    Apkarian and Noll, "Nonsmooth H-infinity synthesis", IEEE TAC 51 (2006). Burke, Henrion,
    Lewis and Overton, "HIFOO", ROCOND 2006. El Ghaoui, Oustry and AitRami, IEEE TAC 42 (1997).

    Examples
    --------
    An oscillator that only a velocity feedback damps; more gain is better, up to the price:

    >>> import robustpolish as rp
    >>> from robustpolish.synthesis import static_output_feedback
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[0.0, 1.0], [-1.0, 0.0]], [[0.0], [1.0]], [[0.0], [1.0]], [[0.0, 1.0]], [[0.0, 1.0]]
    ... )
    >>> design = static_output_feedback(plant, control_weight=1.0)
    >>> design.certificate.valid
    True
    """
    began = time.monotonic()
    one_of("norm", norm, ("hinf", "h2"))
    time_limit = positive("time_limit", time_limit, "s")
    order = _order(order)
    if gain_bound is not None:
        gain_bound = positive("gain_bound", gain_bound)
    target = positive("target", target, zero=True)
    mask = _mask(structure, order, plant)
    start = _initial(initial, order, plant)
    whole = priced(plant, control_weight)

    if order > 0 and mask is not None:
        parts = (_undivided(whole),)
    else:
        parts = decoupled_parts(whole, mask)
    tasks = [
        _task(part, norm, mask, order, gain_bound, start if len(parts) == 1 else None, seed, target)
        for part in parts
    ]
    if len(parts) > 1 and start is not None and order == 0:
        tasks = [
            _started(task, part, start) for task, part in zip(tasks, parts, strict=True)
        ]
    designs = _design_parts(tasks, began + 0.97 * time_limit)
    controller = joined_controller(whole, parts, [d and d.controller for d in designs])
    return assembled(
        plant,
        whole,
        controller,
        norm,
        [d for d in designs if d is not None],
        "descent",
        began,
    )


def assembled(
    plant: GeneralizedPlant,
    whole: GeneralizedPlant,
    controller: control.StateSpace,
    norm: Norm,
    designs: Sequence[PartDesign],
    method: str,
    began: float,
    details: dict[str, Any] | None = None,
) -> Design:
    """Certify a controller that descents have found, and say what is known about it.

    Raises
    ------
    SolverError
        If its certificate fails.
    """
    certificate = certify(whole, controller, norm)
    if not certificate.valid:
        raise SolverError(
            "The controller that was found could not be certified: "
            + "; ".join(certificate.reasons)
            + ". Bound the gain (gain_bound) or put a price on u (control_weight)."
        )
    status, message = _verdict(designs)
    loop = plant.closed_loop(controller)
    measured = hinf_norm(loop) if norm == "hinf" else h2_norm(loop)
    return Design(
        plant=whole,
        controller=controller,
        closed_loop=whole.closed_loop(controller),
        norm=norm,
        status=status,
        message=message,
        certificate=certificate,
        method=method,
        backend="scipy",
        elapsed=time.monotonic() - began,
        history=tuple(
            {"part": i, **entry} for i, d in enumerate(designs) for entry in d.history
        ),
        details=MappingProxyType(
            {
                "norm_without_price": float(measured),
                "descents": sum(d.descents for d in designs),
                "part_norms": tuple(d.norm for d in designs),
                **(details or {}),
            }
        ),
    )


def _verdict(designs: Sequence[PartDesign]) -> tuple[Status, str]:
    if any(d.at_ceiling for d in designs):
        return "infimum_not_attained", (
            "The norm keeps falling as the gain grows; the search was stopped at a large gain. "
            "Bound the gain (gain_bound) or put a price on u (control_weight)."
        )
    if any(d.reason == "time" for d in designs):
        return "time_limit", (
            "The best certified controller when time ran out. Raise time_limit, or pass this "
            "controller as initial."
        )
    worst = min(designs, key=lambda d: d.agreeing / max(1, d.descents), default=None)
    if worst is None:
        return "suboptimal", "Nothing to control: the loop is the open loop."
    return "suboptimal", (
        f"A local minimum; {worst.agreeing} of {worst.descents} descents ended there. "
        "Another seed or a longer time_limit may find a lower one."
    )


def _design_parts(
    tasks: Sequence[StructuredTask | None], deadline: float
) -> list[PartDesign | None]:
    """Design part by part; identical parts once, and each with its share of the time left."""
    done: dict[tuple[bytes, ...], PartDesign] = {}
    designs: list[PartDesign | None] = []
    left = sum(task is not None for task in tasks)
    for task in tasks:
        if task is None:
            designs.append(None)
            continue
        key = _fingerprint(task)
        if key not in done:
            share = (deadline - time.monotonic()) / left
            done[key] = design_part(task, time.monotonic() + share)
        found = done[key]
        K = found.controller
        own = named_controller(task.plant, *(np.array(M) for M in (K.A, K.B, K.C, K.D)))
        designs.append(replace(found, controller=own))
        left -= 1
    return designs


def _fingerprint(task: StructuredTask) -> tuple[bytes, ...]:
    P = task.plant
    matrices = (P.A, P.B1, P.B2, P.C1, P.C2, P.D11, P.D12, P.D21, P.D22, task.mask)
    start = () if task.initial is None else (np.asarray(task.initial.D),)
    return tuple(M.tobytes() + str(M.shape).encode() for M in (*matrices, *start))


def _task(
    part: PlantPart,
    norm: Norm,
    mask: NDArray[np.bool_] | None,
    order: int,
    gain_bound: float | None,
    initial: control.StateSpace | None,
    seed: int,
    target: float,
) -> StructuredTask | None:
    """State the task of one part; None where there is nothing to control."""
    plant = part.plant
    if mask is None:
        free = np.ones((order + plant.nu, order + plant.ny), bool)
    elif order:
        free = mask
    else:
        free = mask[np.ix_(part.controls, part.measurements)]
    if plant.nx == 0 or not free.size or not free.any():
        _refuse_unstable(plant)
        return None
    return StructuredTask(plant, norm, free, order, gain_bound, initial, seed, target)


def _started(
    task: StructuredTask | None, part: PlantPart, start: control.StateSpace
) -> StructuredTask | None:
    if task is None:
        return None
    gain = np.asarray(start.D)[np.ix_(part.controls, part.measurements)]
    return replace(task, initial=control.StateSpace([], [], [], gain, task.plant.dt))


def _refuse_unstable(plant: GeneralizedPlant) -> None:
    """A part without control has to be stable by itself."""
    if not plant.nx:
        return
    poles, vectors = np.linalg.eig(plant.A)
    margin = np.abs(poles) - 1 if plant.is_discrete else poles.real
    worst = int(np.argmax(margin))
    if margin[worst] >= 0:
        state = plant.states[int(np.argmax(np.abs(vectors[:, worst])))]
        raise InfeasibleError(
            f"No controller stabilises the plant: nothing joins the mode {poles[worst]:.6g} "
            f"(state {state}) to a control and a measurement. Add an actuator and a sensor there.",
            [complex(poles[worst])],
        )


def _undivided(plant: GeneralizedPlant) -> PlantPart:
    return PlantPart(
        plant,
        tuple(range(plant.nx)),
        tuple(range(plant.nw)),
        tuple(range(plant.nu)),
        tuple(range(plant.nz)),
        tuple(range(plant.ny)),
    )


def _order(order: int) -> int:
    if isinstance(order, bool) or not isinstance(order, int | np.integer) or order < 0:
        raise invalid("order", order, "a whole number of at least 0", "0 is static feedback.")
    return int(order)


def _mask(
    structure: ArrayLike | None, order: int, plant: GeneralizedPlant
) -> NDArray[np.bool_] | None:
    if structure is None:
        return None
    shape = (order + plant.nu, order + plant.ny)
    mask = np.asarray(structure)
    known = mask.dtype == bool or (mask.dtype.kind in "iuf" and np.isin(mask, (0, 1)).all())
    if mask.shape != shape or not known:
        raise invalid(
            "structure",
            described(f"shape {mask.shape}, entries {mask.dtype}"),
            f"booleans of shape {shape}",
            "Mark the entries that may differ from zero.",
        )
    return mask.astype(bool)


def _initial(
    initial: control.StateSpace | ArrayLike | None, order: int, plant: GeneralizedPlant
) -> control.StateSpace | None:
    if initial is None:
        return None
    if not isinstance(initial, control.StateSpace):
        initial = control.StateSpace([], [], [], np.asarray(initial, dtype=float), plant.dt)
    shape = (initial.noutputs, initial.ninputs, initial.nstates)
    if shape != (plant.nu, plant.ny, order):
        raise invalid(
            "initial",
            described(f"{shape[0]} outputs, {shape[1]} inputs and {shape[2]} states"),
            f"{plant.nu} outputs, {plant.ny} inputs and {order} states",
            "Match the plant and order.",
        )
    return initial
