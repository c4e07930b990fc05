"""Dynamic output feedback under H-infinity, H2, pole-region and gain specifications."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Literal

from numpy.typing import ArrayLike

from robustpolish.errors import SolverError
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.certificate import certify
from robustpolish.synthesis.channels import Channel, channel
from robustpolish.synthesis.decoupling import (
    PlantPart,
    decoupled_parts,
    joined_controller,
    undivided,
)
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.mixed_search import MixedTask, mixed_setting
from robustpolish.synthesis.pole_regions import PoleRegion
from robustpolish.synthesis.pricing import noisy, priced
from robustpolish.synthesis.semidefinite import BACKENDS
from robustpolish.synthesis.structured_design import (
    PartTask,
    certified_design,
    design_parts,
    refuse_unstable,
    search_deadline,
)
from robustpolish.validation import described, invalid, one_of, positive


def mixed_output_feedback(
    plant: GeneralizedPlant,
    minimise: Literal["hinf", "h2"] = "hinf",
    *,
    hinf_channel: Channel | None = None,
    h2_channel: Channel | None = None,
    hinf_bound: float | None = None,
    h2_bound: float | None = None,
    pole_region: PoleRegion | Sequence[PoleRegion] | None = None,
    gain_bound: float | None = None,
    control_weight: ArrayLike | None = None,
    measurement_noise: ArrayLike | None = None,
    backend: Literal["cvxpy", "picos"] = "cvxpy",
    solver: str | None = None,
    time_limit: float = 60.0,
    seed: int = 0,
) -> Design:
    r"""Design a full-order controller for one norm while others are bounded.

    Linear matrix inequalities with one Lyapunov matrix for all specifications give a first
    controller; it is conservative, because the specifications need not share a Lyapunov
    matrix. Descents on the true norms and the true poles then lower the goal while the
    specifications hold. What is returned is checked against every one of them.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous or discrete; in discrete time only descents are used.
    minimise : {"hinf", "h2"}
        The norm to be minimised, on its channel; the other norm may be bounded on its own.
    hinf_channel, h2_channel : (names, names), optional
        Names of the disturbances and of the performance outputs of each norm; all by default.
        Prices and noise belong to both channels.
    hinf_bound, h2_bound : float, optional
        Bound of the norm that is not minimised, in the plant's units.
    pole_region : PoleRegion or sequence of PoleRegion, optional
        Where all closed-loop poles have to be: ``HalfPlane``, ``Disk``, ``Sector``, in rad/s.
    gain_bound : float, optional
        Largest singular value of the controller at any frequency, in the plant's units; the
        controller is then held stable by itself.
    control_weight : float or array_like, shape (nu,), optional
        Price on u: ``control_weight`` times u joins z. In units of z per unit of u.
    measurement_noise : float or array_like, shape (ny,), optional
        Noise on y as additional disturbances, in units of y per unit of w.
    backend, solver : str, optional
        Who solves the linear matrix inequalities; "cvxpy" (with Clarabel) or "picos".
    time_limit : float
        In s, for the whole call.
    seed : int
        Of the random starts.

    Returns
    -------
    Design
        For the channel of the norm that was minimised. ``details["certificates"]`` has the
        certificate of each specified norm, ``details["whole_loop"]`` the loop with all w and z.

    Raises
    ------
    InvalidInputError
        If an argument does not fit the plant, or a bound is given for the norm that is minimised.
    InfeasibleError
        If an unstable mode cannot be moved; it is named.
    SolverError
        If no controller that meets all specifications was found.

    References
    ----------
    Scherer, Gahinet and Chilali, IEEE TAC 42 (1997). Chilali and Gahinet, IEEE TAC 41 (1996).
    M.L. Postma, Polishing robot: vibrations due to impact, (10.20) to (10.32).

    Examples
    --------
    The H2 norm of an integrator, with poles that decay at least like exp(-2 t):

    >>> import robustpolish as rp
    >>> from robustpolish.synthesis.mixed_output_feedback import mixed_output_feedback
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[0.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
    ...     D12=[[0.0], [1.0]], D21=[[0.0, 1.0]],
    ... )
    >>> design = mixed_output_feedback(
    ...     plant, "h2", pole_region=rp.HalfPlane(-2.0), time_limit=5.0
    ... )
    >>> bool(design.certificate.poles.real.max() < -2)
    True
    """
    began = time.monotonic()
    one_of("minimise", minimise, ("hinf", "h2"))
    one_of("backend", backend, BACKENDS)
    time_limit = positive("time_limit", time_limit, "s")
    bounds = {"hinf": hinf_bound, "h2": h2_bound}
    if bounds[minimise] is not None:
        raise invalid(
            f"{minimise}_bound",
            bounds[minimise],
            "no bound for the norm that is minimised",
            "Minimise the other norm, or leave the bound out.",
        )
    other = "h2" if minimise == "hinf" else "hinf"
    bound = bounds[other]
    if bound is not None:
        bound = positive(f"{other}_bound", bound)
    if gain_bound is not None:
        gain_bound = positive("gain_bound", gain_bound)
    regions = _regions(pole_region)
    whole = noisy(priced(plant, control_weight), measurement_noise)
    given = {"hinf": hinf_channel, "h2": h2_channel}
    goal = _channel(plant, whole, given[minimise], f"{minimise}_channel")
    side = None if bound is None else _channel(plant, whole, given[other], f"{other}_channel")

    # A bound on the H2 norm joins the parts: it is their root mean square that counts.
    parts = (undivided(whole),) if side is not None else decoupled_parts(whole)
    tasks = []
    for part in parts:
        if part.plant.nx == 0 or part.plant.nu == 0 or part.plant.ny == 0:
            refuse_unstable(part.plant)
            tasks.append(None)
            continue
        own_goal = _within(part, goal)
        task = MixedTask(
            part.plant, own_goal, minimise, side, bound, regions, gain_bound, backend, solver
        )
        tasks.append(PartTask(part.plant, lambda task=task: mixed_setting(task)))
    designs = design_parts(tasks, search_deadline(whole, began, time_limit), seed)
    controller = joined_controller(whole, parts, [d and d.controller for d in designs])
    found = [d for d in designs if d is not None]
    design = certified_design(goal, goal, controller, minimise, found, "lmi, descent", began)
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
            "Relax it or raise time_limit."
        )
    details = {
        **design.details,
        "certificates": MappingProxyType(certificates),
        "whole_loop": whole.closed_loop(controller),
        "pole_regions": regions,
    }
    return replace(design, details=MappingProxyType(details), elapsed=time.monotonic() - began)


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


def _within(part: PlantPart, goal: GeneralizedPlant) -> GeneralizedPlant:
    """Return the goal's channel of one part."""
    w = [n for n in part.plant.disturbance_names if n in goal.disturbance_names]
    z = [n for n in part.plant.performance_names if n in goal.performance_names]
    if not w or not z:
        return part.plant
    return channel(part.plant, w, z)
