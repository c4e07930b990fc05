"""Loop shaping by normalised coprime factors, after McFarlane and Glover."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import control
import numpy as np
from scipy import linalg

from robustpolish.base.arrays import SAME
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import AnyVector as Vector
from robustpolish.base.budget import Budget, single_threaded_blas
from robustpolish.base.checks import described, invalid, is_whole, misfit, positive
from robustpolish.errors import SolverError
from robustpolish.implementation import reduction
from robustpolish.linear.systems import as_state_space, named_system, resolvent_response
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.wired import single_filter
from robustpolish.synthesis.certificate import Certificate, certify
from robustpolish.synthesis.coprime import consistent_matrices, coprime, loop_plant
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.problem.matrices import (
    Controller,
    SystemMatrices,
    balanced,
    cayley,
    cayley_back,
    in_series,
)
from robustpolish.synthesis.problem.preflight import named_controller

# Order reduction by balanced truncation of normalised coprime factors.


def reduce_in_gap_metric(K: control.StateSpace, order: int) -> SystemMatrices:
    """Return a controller near to another in the gap metric, with fewer states.

    Its right factors [N; M] are stable whatever the controller is; they are balanced and truncated,
    which moves them by at most twice the sum of the Hankel singular values that are left out.
    McFarlane, Glover, "Robust Controller Design Using Normalized Coprime Factor Plant
    Descriptions", 1990, chapter 5.

    Parameters
    ----------
    K : control.StateSpace
        Continuous or discrete.
    order : int
        At most that of the controller.

    Returns
    -------
    SystemMatrices
        What becomes of the loop has to be certified anew.

    Raises
    ------
    SolverError
        If the factors could not be computed or truncated.
    """
    factors = coprime(loop_plant("controller", K)).right()
    ways = reduction.own_gramians("right coprime", factors, False, "right")
    if not ways:
        raise SolverError("The controller's coprime factors could not be balanced; reduce less.")
    T, Ti, _ = reduction.balancing_projection(ways[0])
    if order > T.shape[1]:
        raise SolverError(f"The controller has fewer than {order} states that matter.")
    left, right = Ti[:order], T[:, :order]
    short = left @ factors.A @ right, left @ factors.B, factors.C @ right, factors.D
    found = SystemMatrices(*reduction.from_factor(short, "right", K.ninputs or 0, K.noutputs or 0))
    return cayley_back(found) if K.isdtime(strict=True) else found


# The target loop: the wanted open-loop gain, and distances from it.


# The band reaches from the first crossover over this to the last one times that, as far as a
# discrete system goes: two decades of gain that rejects disturbances, one of roll-off.
_BELOW = 100.0
_ABOVE = 10.0
# Frequencies of the band at which gains are compared, evenly in its logarithm.
_POINTS = 300
# The weight inverts the plant where its smallest gain is above this share of the least within the
# band, and becomes constant beyond, for no inverse of a strictly proper plant is proper. Within
# the band that moves the gain by its square: 0.5 %.
_ROLL_OFF = 0.1
# The least gain that is inverted, over the largest of the band: what lies below is a zero.
_FAINTEST = 1e-8
# Poles on the axis, which no stable factor can have, are moved by this share of the lower end of
# the band: 1e-4 of the gain at that end.
_SHIFT = 1e-2


@dataclass(frozen=True, eq=False)
class TargetLoop:
    """The target of loop shaping: the wanted open-loop gain.

    Attributes
    ----------
    system : SystemMatrices
        As many inputs and outputs as the plant has controls.
    dt : float or bool
    crossovers : (float, float)
        The lowest and highest frequency in rad/s at which a gain falls to 1.
    band : (float, float)
        Where the loop is compared with it, in rad/s.
    """

    system: SystemMatrices
    dt: float | bool
    crossovers: tuple[float, float]
    band: tuple[float, float]

    @classmethod
    def checked(cls, system: SystemMatrices, dt: float | bool, band_hz: Any) -> TargetLoop:
        """Check a target and the band.

        Raises
        ------
        InvalidInputError
            If it is unstable, has no crossover, or the band is no range of frequencies.
        """
        poles = np.linalg.eigvals(system.A)
        size = float(np.abs(poles).max(initial=0.0))
        outside = np.abs(poles) - 1 > 1e-7 if dt else poles.real > 1e-7 * size
        if outside.any():
            shown = described(f"an unstable system with a pole at {poles[outside][0]:.4g}")
            remedy = "Only its gain counts: mirror the pole, which keeps the gain."
            raise invalid("target", shown, "poles that are stable or on the boundary", remedy)
        crossovers = _crossovers(system, dt)
        if crossovers is None:
            shown = described("a gain that never falls from above 1 to below 1")
            remedy = "Pass a shape with a crossover, such as 2 * pi * f / s for f in Hz."
            raise invalid("target", shown, "the open-loop gain that is wanted", remedy)
        return cls(system, dt, crossovers, _band(band_hz, crossovers, dt))

    @property
    def frequencies(self) -> Vector:
        """Where gains are compared, in rad/s."""
        return np.geomspace(*self.band, _POINTS)

    def distance_of(self, loop: SystemMatrices, one_sided: bool = False) -> tuple[float, float]:
        """Return the largest factor, up or down, between the gains of a loop and the wanted ones.

        Parameters
        ----------
        loop : SystemMatrices
        one_sided : bool
            Whether gains above wanted ones above 1, and below those below 1, are as good.

        Returns
        -------
        factor, frequency : float
            At least 1, and where it is met in rad/s.
        """
        own, wanted = (gains(each, self.frequencies, self.dt) for each in (loop, self.system))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = np.log(own[:, : wanted.shape[1]]) - np.log(wanted)
        if one_sided:
            sizes = np.where(wanted > 1, -ratios, ratios).clip(min=0.0).max(axis=1)
        else:
            sizes = np.abs(ratios).max(axis=1)
        sizes = np.nan_to_num(sizes, nan=math.inf)
        return float(np.exp(sizes.max())), float(self.frequencies[np.argmax(sizes)])


def gains(system: SystemMatrices, omega: Vector, dt: float | bool) -> Matrix:
    """Return the singular values over frequencies in rad/s, shape (k, count), largest first."""
    values = resolvent_response(*system, points_of(omega, dt))
    finite = np.isfinite(values).all(axis=(1, 2))
    sizes = np.full((len(values), min(values.shape[1:])), math.inf)
    sizes[finite] = np.linalg.svd(values[finite], compute_uv=False)
    return sizes


def step_of(dt: float | bool) -> float:
    """Return the sampling time in s, 1 where it is not told."""
    return 1.0 if dt is True else float(dt)


def points_of(omega: Vector, dt: float | bool) -> Any:
    """Return the points of s or z at frequencies in rad/s."""
    return np.exp(1j * omega * step_of(dt)) if dt else 1j * omega


def _crossovers(system: SystemMatrices, dt: float | bool) -> tuple[float, float] | None:
    """Return the lowest and highest frequency at which a singular value falls to 1."""
    # As wide as any machine, for a target such as 10 / s has no rate of its own.
    first, end = (1e-9 * math.pi / step_of(dt), math.pi / step_of(dt)) if dt else (1e-9, 1e12)
    omega = np.geomspace(first, end, 2101)
    sizes = gains(system, omega, dt)
    falls = (sizes[:-1] > 1) & (sizes[1:] <= 1)
    found = []
    for i, k in zip(*np.nonzero(falls), strict=True):
        low, high = omega[i], omega[i + 1]
        for _ in range(40):
            middle = math.sqrt(low * high)
            above = gains(system, np.array([middle]), dt)[0, k] > 1
            low, high = (middle, high) if above else (low, middle)
        found.append(math.sqrt(low * high))
    return (min(found), max(found)) if found else None


def _band(given: Any, crossovers: tuple[float, float], dt: float | bool) -> tuple[float, float]:
    """Return the band in rad/s, within what a discrete system has."""
    end = math.pi / step_of(dt) if dt else math.inf
    if given is None:
        low, high = crossovers[0] / _BELOW, crossovers[1] * _ABOVE
        return low, min(high, end * (1 - 1e-6))
    try:
        low, high = (2 * math.pi * float(f) for f in given)
    except (TypeError, ValueError):
        low = high = math.nan
    if not 0 < low < high <= end * (1 + 1e-12) or math.isinf(high):
        want = "(low, high) with 0 < low < high" + (" up to half the sample rate" if dt else "")
        raise invalid("band_hz", given, want, "Leave it out for the target's own band.")
    return low, min(high, end * (1 - 1e-6))


# The weight that gives a plant the gain of a target loop, and limits of the bandwidth.


def target_weight(plant: SystemMatrices, wanted: TargetLoop) -> SystemMatrices:
    r"""Return a stable weight W1 for which G W1 has the wanted singular values.

    With G = inv(M) N, M inner, N has the singular values of G and no unstable poles; its
    spectral factor V, :math:`V^\sim V = \varepsilon^2 I + N^\sim N`, is stable with its
    inverse, and W1 = inv(V) Gd gives G W1 the singular values of Gd wherever those of G are
    above :math:`\varepsilon`. For the problem see V. X. Le, M. G. Safonov, "Rational matrix GCD's
    and the design of squaring-down compensators", IEEE Trans. Automatic Control 37 (1992) 384-392.

    Parameters
    ----------
    plant : SystemMatrices
        G. Of more controls than measurements, as many combinations are used as there are
        measurements.
    wanted : TargetLoop
    """
    T = _directions(plant, wanted)
    square = plant._replace(B=plant.B @ T, D=plant.D @ T)
    sizes = gains(square, wanted.frequencies, wanted.dt)
    sizes = sizes[np.isfinite(sizes).all(axis=1)]
    if not sizes.size or not sizes.any():
        shown = described("a plant without gain in the band of the target")
        raise invalid("plant", shown, "a plant with gain there", "Check band_hz= and target=.")
    level = _ROLL_OFF * max(sizes[:, -1].min(), _FAINTEST * sizes[:, 0].max())
    low = wanted.band[0]
    if wanted.dt:
        square = cayley(*square)
        low = math.tan(low * step_of(wanted.dt) / 2)
    poles = np.linalg.eigvals(square.A)
    size = max(low, float(np.abs(poles).max(initial=0.0)))
    # Poles this near to the axis, over the largest pole or the lower end of the band, are on it.
    if (np.abs(poles.real) <= SAME * size).any():
        square = square._replace(A=square.A - _SHIFT * low * np.eye(len(poles)))
    inverse = _inverted(_mirrored(square), level)
    back = cayley_back(inverse) if wanted.dt else inverse
    nothing = np.zeros((0, 0)), np.zeros((0, T.shape[1])), np.zeros((len(T), 0))
    return in_series(in_series(wanted.system, back), SystemMatrices(*nothing, T))


def limits_in_words(plant: SystemMatrices, wanted: TargetLoop) -> str:
    """Say which unstable poles and zeros of a plant do not permit the wanted bandwidth.

    S. Skogestad, I. Postlethwaite, "Multivariable Feedback Control", 2nd ed., sections 5.7 and
    5.9: below half of a zero in the right half plane, above twice a pole.

    Parameters
    ----------
    plant : SystemMatrices
    wanted : TargetLoop

    Returns
    -------
    str
        Empty if none does.
    """
    T = _directions(plant, wanted)
    A, B, C, D = plant._replace(B=plant.B @ T, D=plant.D @ T)
    zeros: Any = np.zeros(0, dtype=complex)
    if D.shape[0] == D.shape[1] and len(A):  # others have finite zeros by accident only
        P, N = np.block([[A, B], [C, D]]), linalg.block_diag(np.eye(len(A)), np.zeros(D.shape))
        zeros = linalg.eigvals(P, N)
        finite = np.isfinite(zeros)
        zeros = zeros[finite & (np.abs(np.where(finite, zeros, 0)) < 1e6 * np.linalg.norm(A))]
    poles: Any = np.linalg.eigvals(A).astype(complex)
    if wanted.dt:  # as continuous rates in rad/s
        poles, zeros = (np.log(v[v != 0]) / step_of(wanted.dt) for v in (poles, zeros))
    text = ""
    slow, fast = wanted.crossovers
    nearest = np.abs(zeros[zeros.real > 1e-6 * np.abs(zeros)]).min(initial=math.inf)
    if fast > nearest / 2:
        text += (
            f" The plant has a zero in the right half plane at {nearest:.4g} rad/s, which "
            f"permits bandwidths up to about half of it; the target has {fast:.4g} rad/s."
        )
    fastest = np.abs(poles[poles.real > 1e-6 * np.abs(poles)]).max(initial=0.0)
    if slow < 2 * fastest:
        text += (
            f" The plant has an unstable pole at {fastest:.4g} rad/s, which needs a bandwidth "
            f"of about twice that; the target has {slow:.4g} rad/s."
        )
    return text


def _directions(plant: SystemMatrices, wanted: TargetLoop) -> Matrix:
    """Return the combinations of controls that are used, shape (nu, channels)."""
    ny, nu = plant.D.shape
    if nu <= ny:
        return np.eye(nu)
    # Where a pole stands on the crossover its neighbourhood tells the same directions.
    point = points_of(np.array([wanted.crossovers[0] * (1 + 1e-6)]), wanted.dt)
    value = resolvent_response(*plant, point)[0]
    _, _, Vh = np.linalg.svd(np.vstack([value.real, value.imag]))
    return np.asarray(Vh[:ny].T, dtype=float)


def _inverted(stable: SystemMatrices, level: float) -> SystemMatrices:
    """Return inv(V) with V~V = level^2 I + N~N: the denominator of the factors of N / level."""
    one = stable._replace(C=stable.C / level, D=stable.D / level)
    ny, nu = one.D.shape
    sizes = (("u", nu), ("y", ny), ("x", len(one.A)))
    names = [[f"{kind}{i}" for i in range(count)] for kind, count in sizes]
    right = coprime(GeneralizedPlant.from_loop(named_system(one, 0, *names))).right()
    return SystemMatrices(right.A, right.B, right.C[ny:] / level, right.D[ny:] / level)


def _mirrored(plant: SystemMatrices) -> SystemMatrices:
    """Return the plant with its unstable poles mirrored, all singular values being kept."""
    A, B, C, D = plant
    T, Z, count = linalg.schur(A, output="real", sort="rhp")  # type: ignore[misc]
    if not count:
        return plant
    U, unstable = Z[:, :count], T[:count, :count]
    seen = C @ U
    # A Y + Y A' = Y C'C Y with Y = U inv(P) U'.
    P = linalg.solve_continuous_lyapunov(unstable.T, seen.T @ seen)
    L = -U @ np.linalg.solve(P, U.T @ C.T)
    return SystemMatrices(A + L @ C, B + L @ D, C, D)


Weight = control.StateSpace | control.TransferFunction | float
Weights = Weight | Sequence[Weight | None] | None


@single_threaded_blas
def loop_shaping(
    plant: GeneralizedPlant | control.StateSpace | control.TransferFunction,
    W1: Weights = None,
    W2: Weights = None,
    *,
    target: Weight | None = None,
    band_hz: Sequence[float] | None = None,
    factor: float = 1.1,
    order: int | None = None,
) -> Design:
    r"""Design a controller by H-infinity loop shaping.

    Weights give the loop its gain, which is then made as robust as it can be. The plant that they
    shape, Gs = W2 G W1, is stabilised by the controller Ks for which

    .. math:: \gamma = \left\| \begin{bmatrix} I \\ K_s \end{bmatrix} (I - G_s K_s)^{-1}
              \begin{bmatrix} I & G_s \end{bmatrix} \right\|_\infty

    is within `factor` of its minimum, which two Riccati equations give without a search. What
    goes onto the machine is K = W1 Ks W2. A gamma below 4 says that the gains that were asked for
    go together with good margins; 1 / gamma is :func:`robustpolish.uncertain.ncf_margin` of the
    shaped loop.

    Parameters
    ----------
    plant : GeneralizedPlant, control.StateSpace or control.TransferFunction
        G. Of a generalised plant, the part from its controls to its measurements, with delays,
        limits and units; its disturbances and performance outputs are left out.
    W1, W2 : system, number or sequence of them, optional
        Weights before and behind the plant: one of one input and one output that stands for all
        channels, one per channel, or a system of as many inputs and outputs as there are channels.
        Integrators are welcome: ``rp.weight(np.inf, crossover_hz, high)``.
    target : control.StateSpace or control.TransferFunction, optional
        The open-loop gain that is wanted, in place of W1, which is then found: a stable W1 for
        which the singular values of W2 G W1 are those of the target. One of one input and output
        stands for all loops; otherwise it has as many of both as the plant has controls or
        measurements, whichever are fewer. Only its gain counts. Integrators are welcome:
        ``2 * pi * f / s`` crosses 1 at f in Hz.
    band_hz : (float, float), optional
        Where the gain has to be that of the target, in Hz; by default from a hundredth of its
        first crossover to ten times its last. Above the band W1 no longer inverts the plant, and
        the loop falls off faster than the target.
    factor : float, optional
        How far above its minimum gamma may lie; above 1. Close to 1 the controller gets a very
        fast pole.
    order : int, optional
        Number of states of Ks, which has as many as the shaped plant by default: the normalised
        coprime factors of Ks are then balanced and truncated. What that costs is told: `gamma` is
        that of the shorter controller.

    Returns
    -------
    Design
        Its controller is K, of as many states as the plant and twice the weights. Its plant is
        ``GeneralizedPlant.from_loop(plant)``, whose norm the certificate proves in the units of the
        plant; without weights that norm is gamma. ``details`` hold the ``gamma`` achieved and
        certified for the shaped loop, the ``optimal_gamma``, the ``ncf_margin``, the
        ``shaped_plant``, the ``shaped_controller`` with its ``shaped_certificate``, and the weights
        ``W1`` and ``W2`` as systems. With a target also the ``band_hz``, the ``shape_factor``
        within which the singular values of the shaped plant W2 G W1 are those of the target, and
        the ``target_factor``: those of the loop W2 G W1 Ks are at least the target over it where
        the target is above 1, and at most the target times it below 1; both at 300 frequencies of
        the band, no proof between.

    Raises
    ------
    InfeasibleError
        If a mode that is not stable is not controllable or not observable in the shaped plant, such
        as an integrator in a weight that a zero of the plant cancels.
    SolverError
        If the controller could not be certified.
    InvalidInputError
        If an argument does not fit.

    See Also
    --------
    ncf_margin, nu_gap : how robust a loop is, and how far plants are apart.

    Notes
    -----
    The sign is that of the package, u = K y, as in MATLAB's ``ncfsyn``; its ``loopsyn`` uses
    u = -K y. The weight that a target asks for inverts the plant within the band, the mirror
    images of its unstable poles and zeros included. What those forbid (a bandwidth up to half of a
    zero in the right half plane, from twice an unstable pole on) no weight gives: gamma rises,
    and the message names the zero or pole. Resonances that W1 cancels are still seen by
    disturbances at the plant's input. Of a plant with more controls than measurements W1 drives the
    combinations of controls that have most gain at the first crossover.

    McFarlane, Glover, "A loop shaping design procedure using H-infinity synthesis",
    IEEE Trans. Automatic Control 37 (1992) 759-769; Glover, McFarlane, "Robust stabilization of
    normalized coprime factor plant descriptions with H-infinity-bounded uncertainty", IEEE Trans.
    Automatic Control 34 (1989) 821-830; Le, Safonov, "Rational matrix GCD's and the design of
    squaring-down compensators", IEEE Trans. Automatic Control 37 (1992) 384-392, for targets.

    Examples
    --------
    Skogestad and Postlethwaite, example 9.3, with 2.34 as the smallest gamma:

    >>> import control
    >>> import robustpolish as rp
    >>> s = control.tf("s")
    >>> G = 200 / ((10 * s + 1) * (0.05 * s + 1) ** 2)
    >>> design = rp.loop_shaping(G, W1=(s + 2) / s)
    >>> round(design.details["optimal_gamma"], 2), round(design.details["gamma"], 2)
    (2.34, 2.55)
    >>> design.certificate.valid
    True

    The same plant for an open loop of 10 / s, which crosses 1 at 10 rad/s:

    >>> design = rp.loop_shaping(G, target=10 / s)
    >>> round(design.details["gamma"], 2), round(design.details["target_factor"], 1)
    (1.61, 1.3)
    """
    clock = Budget()
    number = positive("factor", factor)
    if number <= 1:
        remedy = "1.1 is the usual choice; 1.001 comes close to the minimum."
        raise invalid("factor", factor, "a number above 1", remedy)
    G = loop_plant("plant", plant)
    behind = _matrix_weight("W2", W2, G.ny, G.dt)
    part = in_series(SystemMatrices(G.A, G.B2, G.C2, G.D22), behind)
    wanted = _target_loop(target, W1, band_hz, G)
    before = target_weight(part, wanted) if wanted else _matrix_weight("W1", W1, G.nu, G.dt)
    whole = in_series(before, part)
    inputs, count = list(G.control_names), whole.D.shape[1]
    inputs = inputs if count == G.nu else [f"v[{i}]" for i in range(count)]
    states = [f"x{i + 1}" for i in range(len(whole.A))]
    shaped = named_system(whole, G.dt, inputs, list(G.measurement_names), states)
    loop = GeneralizedPlant.from_loop(shaped)
    if order is not None and (not is_whole(order) or not 0 <= order <= loop.nx):
        want = f"a whole number from 0 to {loop.nx}, the states of the shaped plant"
        raise invalid("order", order, want, "Leave it out for the full order.")
    solved = coprime(loop)
    optimal = solved.optimal_gamma
    claim = optimal * number
    central = solved.controller(claim)
    central = cayley_back(central) if loop.is_discrete else central
    remedy = "Scale the plant so that a unit of u and of y mean as much, or raise factor=."
    what = f"The controller for gamma {claim:.6g}"
    inner, proof = _certified(loop, central, claim, what, remedy)
    if order is not None and order < inner.nstates:
        remedy = (
            f"That of order {inner.nstates} has gamma {proof.achieved:.4g}; ask for more states."
        )
        short = reduce_in_gap_metric(inner, int(order))
        inner, proof = _certified(loop, short, None, f"A controller of order {order}", remedy)
    K = in_series(in_series(behind, consistent_matrices(inner)), before)
    real = GeneralizedPlant.from_loop(G)
    controller = named_controller(real, *balanced(Controller(*K)))
    weighted = any(given is not None for given in (W1, W2, target))
    certificate = certify(real, controller, "hinf")
    if not certificate.valid:
        why = "; ".join(certificate.reasons)
        raise SolverError(
            "The shaped loop is certified, the loop with the weights in the controller is not: "
            f"{why}. Do not cancel slow or unstable modes of the plant by the weights."
        )
    near, told = _distance_to_target(wanted, whole, part, inner) if wanted else ({}, "")
    details = {
        "gamma": proof.achieved,
        "optimal_gamma": optimal,
        "ncf_margin": 1 / proof.achieved,
        "shaped_plant": shaped,
        "shaped_controller": inner,
        "shaped_certificate": proof,
        "W1": control.StateSpace(*before, G.dt),
        "W2": control.StateSpace(*behind, G.dt),
        **near,
    }
    return Design(
        plant=real,
        controller=controller,
        closed_loop=real.closed_loop(controller),
        norm="hinf",
        status="suboptimal",
        message=_message(proof, optimal, weighted) + told,
        certificate=certificate,
        method="loop shaping",
        backend="scipy",
        elapsed=clock.elapsed,
        details=MappingProxyType(details),
        lower_bound=None if weighted else optimal,
    )


def _target_loop(
    target: Any, W1: Weights, band_hz: Any, plant: GeneralizedPlant
) -> TargetLoop | None:
    """Return the loop that is wanted, if weights are not."""
    if target is None and band_hz is not None:
        raise misfit("band_hz", "a band without a target", "a band of target=", "Leave it out.")
    if target is None:
        return None
    if W1 is not None:
        shown = described("a target besides W1")
        raise invalid("target", shown, "one of them", "The target finds W1; W2 may be given.")
    if isinstance(target, list | tuple):
        shown, want = described(f"a {type(target).__name__}"), "one system"
        raise invalid("target", shown, want, "Pass a diagonal system for a gain per control.")
    system = _matrix_weight("target", target, min(plant.nu, plant.ny), plant.dt)
    return TargetLoop.checked(system, plant.dt, band_hz)


def _distance_to_target(
    wanted: TargetLoop, shaped: SystemMatrices, part: SystemMatrices, inner: control.StateSpace
) -> tuple[dict[str, Any], str]:
    """Return how near the shaped plant and the loop come to the target, and say it."""
    shape, _ = wanted.distance_of(shaped)
    loop = in_series(consistent_matrices(inner), shaped)
    factor, worst = wanted.distance_of(loop, one_sided=True)
    low, high, where = (omega / (2 * math.pi) for omega in (*wanted.band, worst))
    found = {"target_factor": factor, "shape_factor": shape, "band_hz": (low, high)}
    text = (
        f" From {low:.4g} to {high:.4g} Hz the loop keeps the target within a factor of "
        f"{factor:.3g}, farthest at {where:.4g} Hz: at least the target over it where that is "
        f"above 1, at most the target times it below. The shaped plant has the target's gain "
        f"within {shape:.4g} (at {len(wanted.frequencies)} frequencies, no proof between)."
    )
    return found, text + limits_in_words(part, wanted)


def _certified(
    loop: GeneralizedPlant, found: SystemMatrices, claim: float | None, what: str, remedy: str
) -> tuple[control.StateSpace, Certificate]:
    """Return a controller of the shaped plant with its certificate for gamma."""
    # What was solved for has no further units: the plant's states were scaled, its signals not.
    inner = named_controller(loop, *balanced(Controller(*found)))
    proof = certify(loop, inner, "hinf", claim)
    if not proof.valid:
        raise SolverError(f"{what} could not be certified: {'; '.join(proof.reasons)}. {remedy}")
    return inner, proof


def _matrix_weight(argument: str, given: Any, count: int, dt: float | bool) -> SystemMatrices:
    """Return a weight of as many inputs and outputs as there are channels."""
    if given is None:
        given = 1.0
    if isinstance(given, list | tuple):
        if len(given) != count:
            shown = described(f"{len(given)} weights")
            raise invalid(argument, shown, f"{count}, one per channel", "Write None for 1.")
        each = [
            consistent_matrices(single_filter(f"{argument}[{i}]", 1.0 if one is None else one, dt))
            for i, one in enumerate(given)
        ]
        return SystemMatrices(*(linalg.block_diag(*parts) for parts in zip(*each, strict=True)))  # pyright: ignore[reportArgumentType]
    system = as_state_space(argument, given, dt)
    if (system.ninputs, system.noutputs) == (1, 1):
        return _matrix_weight(argument, [given] * count, count, dt)
    if (system.ninputs, system.noutputs) != (count, count):
        shown = described(f"{system.ninputs} inputs and {system.noutputs} outputs")
        want = f"one of each, or {count}"
        raise invalid(argument, shown, want, "Pass a number, a weight, or one per channel.")
    if system.nstates and system.dt is not None and system.dt != dt:
        shown = described(f"sampling time {system.dt}")
        raise invalid(argument, shown, f"{dt} like the plant", "Discretise it.")
    return consistent_matrices(system)


def _message(proof: Certificate, optimal: float, weighted: bool) -> str:
    shaped = "of the shaped loop " if weighted else ""
    text = (
        f"Gamma {shaped}is {proof.achieved:.6g}, proven to be at most {proof.bound:.6g}; no "
        f"controller comes below {optimal:.6g}, by two Riccati equations. The margin of the "
        f"normalised coprime factors is {1 / proof.achieved:.3g}"
    )
    if optimal > 4:
        return text + ": too small. The gains that are asked for do not suit the plant."
    return text + "."
