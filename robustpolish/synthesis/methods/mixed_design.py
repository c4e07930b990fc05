"""One design under several specifications, static or dynamic, from its checked arguments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

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
from robustpolish.synthesis.problem.pole_regions import PoleRegion, checked_regions, outside
from robustpolish.synthesis.problem.preflight import noisy, priced
from robustpolish.synthesis.structured_search.mixed_structure import MixedStructure
from robustpolish.validation import invalid, one_of, positive


def design_mixed(
    plant: GeneralizedPlant,
    *,
    static: bool,
    minimise: Norm,
    hinf_channel: Channel | None,
    h2_channel: Channel | None,
    hinf_bound: float | None,
    h2_bound: float | None,
    pole_region: PoleRegion | Sequence[PoleRegion] | None,
    gain_bound: float | None,
    control_weight: ArrayLike | None,
    measurement_noise: ArrayLike | None = None,
    backend: str,
    solver: str | None,
    time_limit: float,
    seed: int,
) -> Design:
    """Check the specifications, search part by part and certify every one of them.

    Parameters
    ----------
    plant : GeneralizedPlant
    static : bool
        u = F y instead of a controller of full order.
    minimise, hinf_channel, h2_channel, hinf_bound, h2_bound, pole_region, gain_bound, \
    control_weight, measurement_noise, backend, solver, time_limit, seed
        As in :func:`mixed_output_feedback`.
    """
    one_of("minimise", minimise, ("hinf", "h2"))
    one_of("backend", backend, BACKENDS)
    orders = Orders.checked(minimise, time_limit, seed)
    bounds = {"hinf": hinf_bound, "h2": h2_bound}
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
    gain_bound = checked_bound(gain_bound)
    regions = checked_regions("pole_region", pole_region)
    whole = noisy(priced(plant, control_weight), measurement_noise)
    given = {"hinf": hinf_channel, "h2": h2_channel}
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
    broken += outside(regions, design.certificate.poles)
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
