"""State feedback u = F x for the H-infinity or the H2 norm."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import Any, Literal

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.analysis import h2_norm, hinf_norm
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.certificate import certify
from robustpolish.synthesis.decoupling import PlantPart, decoupled_parts
from robustpolish.synthesis.design import Design, Status
from robustpolish.synthesis.fixed_modes import refuse_fixed_modes
from robustpolish.synthesis.full_state.engines import Engine
from robustpolish.synthesis.full_state.parts import (
    Part,
    PartAnswer,
    reference_norm,
    solve_part,
)
from robustpolish.synthesis.nonsmooth import Loop
from robustpolish.synthesis.pole_regions import PoleRegion
from robustpolish.synthesis.pricing import priced
from robustpolish.synthesis.scaling import scale_plant
from robustpolish.synthesis.semidefinite import BACKENDS
from robustpolish.validation import described, invalid, one_of, positive

Matrix = NDArray[np.float64]


def state_feedback(
    plant: GeneralizedPlant,
    norm: Literal["hinf", "h2"] = "hinf",
    method: Literal["lmi", "riccati"] = "lmi",
    backend: Literal["cvxpy", "picos"] = "cvxpy",
    control_weight: ArrayLike | None = None,
    gain_bound: float | None = None,
    pole_region: PoleRegion | Sequence[PoleRegion] | None = None,
    *,
    solver: str | None = None,
    split: bool = True,
    tolerance: float = 1e-4,
    time_limit: float = 60.0,
) -> Design:
    start = time.perf_counter()
    one_of("norm", norm, ("hinf", "h2"))
    one_of("method", method, ("lmi", "riccati"))
    one_of("backend", backend, BACKENDS)
    tolerance, time_limit = positive("tolerance", tolerance), positive("time_limit", time_limit)
    regions = _regions(pole_region, method)
    whole = priced(plant, control_weight) if control_weight is not None else plant
    whole = whole.with_full_state()
    _refuse_hopeless(whole, norm)
    engine = Engine(
        norm,
        method,
        backend,
        solver,
        tolerance,
        lambda: time_limit - (time.perf_counter() - start),
    )
    pieces = decoupled_parts(whole) if split else (_whole(whole),)
    parts = [Part.of(piece.plant, regions) for piece in pieces]
    reference = max((reference_norm(part, engine) for part in parts), default=0.0)
    answers = [solve_part(part, engine, reference) for part in parts]
    F = np.zeros((whole.nu, whole.nx))
    for piece, answer in zip(pieces, answers, strict=True):
        F[np.ix_(piece.controls, piece.states)] = answer.F
    controller = control.StateSpace(
        [],
        [],
        [],
        F,
        plant.dt,
        inputs=list(whole.measurement_names),
        outputs=list(plant.control_names),
    )
    claims = [answer.claimed for answer in answers]
    claimed = max(claims) if norm == "hinf" else math.sqrt(sum(c**2 for c in claims))
    certificate = certify(whole, controller, norm, claimed)
    if not certificate.valid:
        raise SolverError("not certified: " + "; ".join(certificate.reasons))
    statuses = [a.status for a in answers]
    status = next(
        (s for s in ("time_limit", "infimum_not_attained", "suboptimal") if s in statuses),
        "optimal",
    )
    history = tuple({"part": i, **e} for i, a in enumerate(answers) for e in a.history)
    return Design(
        plant=whole,
        controller=controller,
        closed_loop=whole.closed_loop(controller),
        norm=norm,
        status=status,
        message="",
        certificate=certificate,
        method=method,
        backend=backend if method == "lmi" else "scipy",
        elapsed=time.perf_counter() - start,
        history=history,
    )


def _regions(pole_region, method):
    if pole_region is None:
        return ()
    return tuple(pole_region) if isinstance(pole_region, Sequence) else (pole_region,)


def _refuse_hopeless(plant, norm):
    scaled = scale_plant(plant)
    loop = Loop.of(scaled.plant)
    refuse_fixed_modes(
        loop, np.ones((plant.nu, plant.nx), bool), plant.states, scaled.time, "state feedback"
    )


def _whole(plant):
    r = lambda n: tuple(range(n))
    return PlantPart(plant, r(plant.nx), r(plant.nw), r(plant.nu), r(plant.nz), r(plant.ny))
