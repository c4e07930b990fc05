"""From the controllers of the parts to one certified design."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import control
import numpy as np

from robustpolish.analysis import h2_norm, hinf_norm
from robustpolish.errors import SolverError
from robustpolish.models import GeneralizedPlant
from robustpolish.progress import working
from robustpolish.synthesis.certificate.certificate import certify
from robustpolish.synthesis.design.design import Design
from robustpolish.synthesis.design.status import Status
from robustpolish.synthesis.problem.decoupling import named_controller
from robustpolish.synthesis.structured_search.search import Norm, PartDesign, Setting, solve_setting

_BOUND_THE_GAIN = (
    "Bound the gain (gain_bound), or price u and add noise to y (control_weight, "
    "measurement_noise)."
)


@dataclass(frozen=True, eq=False)
class PartTask:
    """The search for the controller of one part.

    Attributes
    ----------
    plant : GeneralizedPlant
        The part.
    state : callable
        () -> Setting, with the scaling and all checks.
    extra : bytes
        What else makes the task differ from another on the same matrices.
    """

    plant: GeneralizedPlant
    state: Callable[[], Setting]
    extra: bytes = b""


def design_parts(
    tasks: Sequence[PartTask | None], deadline: float, seed: int = 0, target: float = 0.0
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
            with working("Searching a controller"):
                done[key] = solve_setting(task.state(), time.monotonic() + share, seed, target)
        found = done[key]
        K = found.controller
        own = named_controller(task.plant, *(np.array(M) for M in (K.A, K.B, K.C, K.D)))
        designs.append(replace(found, controller=own))
        left -= 1
    return designs


def search_deadline(plant: GeneralizedPlant, began: float, time_limit: float) -> float:
    """Return when to stop searching, so that the certificate fits into the time limit."""
    return began + (0.95 if plant.nx <= 16 else 0.7) * time_limit


def _fingerprint(task: PartTask) -> tuple[bytes, ...]:
    P = task.plant
    matrices = (P.A, P.B1, P.B2, P.C1, P.C2, P.D11, P.D12, P.D21, P.D22)
    return (task.extra, *(M.tobytes() + str(M.shape).encode() for M in matrices))


def certified_design(
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
            + ". "
            + _BOUND_THE_GAIN
        )
    status, message = _verdict(designs, certificate.achieved)
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
        history=tuple({"part": i, **entry} for i, d in enumerate(designs) for entry in d.history),
        details=MappingProxyType(
            {
                "plain_norm": float(measured),
                "descents": sum(d.descents for d in designs),
                "part_norms": tuple(d.norm for d in designs),
                **(details or {}),
            }
        ),
    )


def _verdict(designs: Sequence[PartDesign], achieved: float) -> tuple[Status, str]:
    if achieved == 0:
        return "optimal", "The disturbances do not reach the performance outputs at all."
    if any(d.at_ceiling for d in designs):
        return "infimum_not_attained", (
            "The norm keeps falling as the gain grows; the search was stopped at a large gain. "
            + _BOUND_THE_GAIN
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
