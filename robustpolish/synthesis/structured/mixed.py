"""Output and state feedback under H-infinity, H2, pole-region and gain specifications."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Literal

from numpy.typing import ArrayLike

from robustpolish.base.budget import single_threaded_blas
from robustpolish.base.checks import invalid, one_of, positive
from robustpolish.errors import SolverError
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import Norm, certify, checked_regions, violated_regions
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.lmi.program import BACKENDS
from robustpolish.synthesis.problem.matrices import Channel, channel
from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.problem.preflight import (
    decoupled_parts,
    whole_plant,
    with_control_penalty,
    with_measurement_noise,
)
from robustpolish.synthesis.structured import methods
from robustpolish.synthesis.structured.search import TIME_LIMIT
from robustpolish.synthesis.structured.structures import MixedStructure


def _design_mixed(
    plant: GeneralizedPlant,
    whole: GeneralizedPlant,
    minimise: Norm,
    given: Mapping[Norm, tuple[Channel | None, float | None]],
    pole_region: PoleRegion | Sequence[PoleRegion] | None,
    gain_bound: float | None,
    solver: tuple[str, str | None],
    options: tuple[float, int],
    static: bool = False,
) -> Design:
    """Check the specifications, search part by part and certify every one of them.

    `whole` is the plant with prices and noise, `given` has the channel and the bound of each norm,
    `options` are seconds and seed; `static` asks for u = F y instead of a controller of full order.
    """
    one_of("minimise", minimise, ("hinf", "h2"))
    one_of("backend", solver[0], BACKENDS)
    checked = methods.StructuredOptions.checked(minimise, *options)
    other: Norm = "h2" if minimise == "hinf" else "hinf"
    (own_channel, own_bound), (other_channel, bound) = given[minimise], given[other]
    if own_bound is not None:
        raise invalid(
            f"{minimise}_bound",
            own_bound,
            "no bound for the norm that is minimised",
            "Minimise the other norm, or leave the bound out.",
        )
    if bound is not None:
        bound = positive(f"{other}_bound", bound)
    gain_bound = methods.checked_bound(gain_bound)
    regions = checked_regions("pole_region", pole_region)
    goal = _channel(plant, whole, own_channel, f"{minimise}_channel")
    side = None if bound is None else _channel(plant, whole, other_channel, f"{other}_channel")

    # A bound on the H2 norm joins the parts: it is their root mean square that counts.
    parts = (whole_plant(whole),) if side is not None else decoupled_parts(whole)
    structure = MixedStructure(minimise, goal, static, side, bound, regions, gain_bound, solver)
    design = methods.design_structured(goal, goal, parts, structure, checked)
    certificates = {minimise: design.certificate}
    broken = []
    if side is not None and bound is not None:
        proof = certificates[other] = certify(side, design.controller, other)
        if not proof.valid or proof.achieved > bound * (1 + 1e-6):
            broken.append(f"the {other} norm is {proof.achieved:g}, not {bound:g}")
    broken += violated_regions(regions, design.certificate.poles)
    if broken:
        raise SolverError(
            f"The best controller found breaks a specification: {'; '.join(broken)}. "
            "Relax it or try another seed."
        )
    details = {
        **design.details,
        "certificates": MappingProxyType(certificates),
        "whole_loop": whole.closed_loop(design.controller),
        "pole_regions": regions,
    }
    return replace(design, details=MappingProxyType(details), elapsed=checked.budget.elapsed)


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


@single_threaded_blas
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
    time_limit: float = TIME_LIMIT,
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
        Safety net in s for search and certificate; the work of the search is limited otherwise. The
        status says if it was reached, an error if no certificate was complete in time.
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
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[0.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
    ...     D12=[[0.0], [1.0]], D21=[[0.0, 1.0]],
    ... )
    >>> design = rp.mixed_output_feedback(
    ...     plant, "h2", pole_region=rp.HalfPlane(-2.0), time_limit=5.0
    ... )
    >>> bool(design.certificate.poles.real.max() < -2)
    True
    """
    given: Any = {"hinf": (hinf_channel, hinf_bound), "h2": (h2_channel, h2_bound)}
    whole = with_measurement_noise(with_control_penalty(plant, control_weight), measurement_noise)
    settings = pole_region, gain_bound, (backend, solver), (time_limit, seed)
    return _design_mixed(plant, whole, minimise, given, *settings)


@single_threaded_blas
def mixed_state_feedback(
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
    backend: Literal["cvxpy", "picos"] = "cvxpy",
    solver: str | None = None,
    time_limit: float = TIME_LIMIT,
    seed: int = 0,
) -> Design:
    r"""Design u = F x for one norm while others are bounded.

    Linear matrix inequalities in Y and F Y with one Y for all specifications give a first
    gain. Sharing Y is conservative; descents on the true norms and poles then lower
    the goal while the specifications hold. What is returned is checked against every one of them.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous or discrete; all its states are taken as measured, whatever y is. In discrete
        time only descents are used.
    minimise : {"hinf", "h2"}
        The norm to be minimised, on its channel; the other norm may be bounded on its own.
    hinf_channel, h2_channel : (names, names), optional
        Names of the disturbances and of the performance outputs of each norm; all by default.
        Prices belong to both channels.
    hinf_bound, h2_bound : float, optional
        Bound of the norm that is not minimised, in the plant's units.
    pole_region : PoleRegion or sequence of PoleRegion, optional
        Where all closed-loop poles have to be: ``HalfPlane``, ``Disk``, ``Sector``, in rad/s.
    gain_bound : float, optional
        Largest singular value of F, in the plant's units.
    control_weight : float or array_like, shape (nu,), optional
        Price on u: ``control_weight`` times u joins z. In units of z per unit of u.
    backend, solver : str, optional
        Who solves the linear matrix inequalities; "cvxpy" (with Clarabel) or "picos".
    time_limit : float
        Safety net in s for search and certificate; the work of the search is limited otherwise. The
        status says if it was reached, an error if no certificate was complete in time.
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
        If no gain that meets all specifications was found.

    References
    ----------
    Chilali and Gahinet, "H-infinity design with pole placement constraints: an LMI approach", IEEE
    TAC 41 (1996). M.L. Postma, Polishing robot: vibrations due to impact, (10.18) to (10.28).

    Examples
    --------
    A mass whose motion decays at least like exp(-2 t):

    >>> import robustpolish as rp
    >>> mass = rp.GeneralizedPlant.from_matrices(
    ...     [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[0.0], [1.0]],
    ...     [[1.0, 0.0], [0.0, 0.0]], [[1.0, 0.0]], D12=[[0.0], [1.0]],
    ... )
    >>> design = rp.mixed_state_feedback(
    ...     mass, "h2", pole_region=rp.HalfPlane(-2.0), time_limit=5.0
    ... )
    >>> bool(design.certificate.poles.real.max() < -2)
    True
    """
    given: Any = {"hinf": (hinf_channel, hinf_bound), "h2": (h2_channel, h2_bound)}
    plant = plant.with_full_state()
    whole = with_control_penalty(plant, control_weight)
    settings = pole_region, gain_bound, (backend, solver), (time_limit, seed)
    return _design_mixed(plant, whole, minimise, given, *settings, static=True)
