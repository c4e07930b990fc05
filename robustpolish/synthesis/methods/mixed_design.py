"""One design under several specifications, static or dynamic, from its checked arguments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

from numpy.typing import ArrayLike

from robustpolish.errors import SolverError
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.certificate.certificate import Norm, certify
from robustpolish.synthesis.design.design import Design
from robustpolish.synthesis.lmi.semidefinite import BACKENDS
from robustpolish.synthesis.methods.structured_design import (
    Orders,
    checked_bound,
    design_structured,
)
from robustpolish.synthesis.problem.channels import Channel, channel
from robustpolish.synthesis.problem.decoupling import decoupled_parts, undivided
from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.problem.preflight import noisy, priced
from robustpolish.synthesis.structured_search.mixed_structure import MixedStructure
from robustpolish.validation import described, invalid, one_of, positive


@dataclass(frozen=True, eq=False)
class MixedSpecifications:
    """What the user asks for; the names are those of the arguments.

    Attributes
    ----------
    minimise : {"hinf", "h2"}
    hinf_channel, h2_channel : Channel or None
    hinf_bound, h2_bound : float or None
    pole_region : PoleRegion, sequence of PoleRegion or None
    gain_bound : float or None
    control_weight, measurement_noise : array_like or None
    """

    minimise: Literal["hinf", "h2"]
    hinf_channel: Channel | None
    h2_channel: Channel | None
    hinf_bound: float | None
    h2_bound: float | None
    pole_region: PoleRegion | Sequence[PoleRegion] | None
    gain_bound: float | None
    control_weight: ArrayLike | None
    measurement_noise: ArrayLike | None = None


def design_mixed(
    plant: GeneralizedPlant,
    asked: MixedSpecifications,
    *,
    static: bool,
    backend: str,
    solver: str | None,
    time_limit: float,
    seed: int,
) -> Design:
    """Check the specifications, search part by part and certify every one of them.

    Parameters
    ----------
    plant : GeneralizedPlant
    asked : MixedSpecifications
    static : bool
        u = F y instead of a controller of full order.
    backend, solver, time_limit, seed
        As in :func:`mixed_output_feedback`.
    """
    minimise: Norm = asked.minimise
    one_of("minimise", minimise, ("hinf", "h2"))
    one_of("backend", backend, BACKENDS)
    orders = Orders.checked(minimise, time_limit, seed)
    bounds = {"hinf": asked.hinf_bound, "h2": asked.h2_bound}
    if bounds[minimise] is not None:
        raise invalid(
            f"{minimise}_bound",
            bounds[minimise],
            "no bound for the norm that is minimised",
            "Minimise the other norm, or leave the bound out.",
        )
    other: Norm = "h2" if minimise == "hinf" else "hinf"
    bound = bounds[other]
    if bound is not None:
        bound = positive(f"{other}_bound", bound)
    gain_bound = checked_bound(asked.gain_bound)
    regions = _regions(asked.pole_region)
    whole = noisy(priced(plant, asked.control_weight), asked.measurement_noise)
    given = {"hinf": asked.hinf_channel, "h2": asked.h2_channel}
    goal = _channel(plant, whole, given[minimise], f"{minimise}_channel")
    side = None if bound is None else _channel(plant, whole, given[other], f"{other}_channel")

    # A bound on the H2 norm joins the parts: it is their root mean square that counts.
    parts = (undivided(whole),) if side is not None else decoupled_parts(whole)
    structure = MixedStructure(
        minimise, goal, static, side, bound, regions, gain_bound, backend, solver
    )
    design = design_structured(goal, goal, parts, structure, minimise, orders)
    controller = design.controller
    certificates = {minimise: design.certificate}
    broken = []
    if side is not None and bound is not None:
        certificates[other] = certify(side, controller, other)
        if not certificates[other].valid or certificates[other].achieved > bound * (1 + 1e-6):
            broken.append(f"the {other} norm is {certificates[other].achieved:g}, not {bound:g}")
    for region in regions:
        if not region.contains(design.certificate.poles):
            broken.append(f"a pole lies outside {region}")
    if broken:
        raise SolverError(
            f"The best controller found breaks a specification: {'; '.join(broken)}. "
            "Relax it or try another seed."
        )
    details = {
        **design.details,
        "certificates": MappingProxyType(certificates),
        "whole_loop": whole.closed_loop(controller),
        "pole_regions": regions,
    }
    return replace(design, details=MappingProxyType(details), elapsed=orders.budget.elapsed)


def _regions(given: PoleRegion | Sequence[PoleRegion] | None) -> tuple[PoleRegion, ...]:
    if given is None:
        return ()
    regions = tuple(given) if isinstance(given, Sequence) else (given,)
    for region in regions:
        if not isinstance(region, PoleRegion):
            shown = described(type(region).__name__)
            raise invalid("pole_region", shown, "HalfPlane, Disk or Sector", "Build one of them.")
    return regions


def _channel(
    plant: GeneralizedPlant, whole: GeneralizedPlant, given: Channel | None, argument: str
) -> GeneralizedPlant:
    """Cut the channel out of the plant with prices and noise, which every channel keeps."""
    if given is None:
        return whole
    if isinstance(given, str) or len(given) != 2:
        raise invalid(argument, given, "a pair (names of w, names of z)", "Write (['F_x'], ['x']).")
    w, z = ([names] if isinstance(names, str) else list(names) for names in given)
    extra_w = [n for n in whole.disturbance_names if n not in plant.disturbance_names]
    extra_z = [n for n in whole.performance_names if n not in plant.performance_names]
    return channel(whole, [*w, *extra_w], [*z, *extra_z])
