"""The certificate of a controller: everything about its loop, computed afresh.

No solver is believed. The loop is connected in ball arithmetic, its poles and its norm are
computed from it, and a matrix proves both stability and the bound on the norm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import control
import flint
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray

from robustpolish.base.arrays import Matrix
from robustpolish.base.budget import check_deadline, single_threaded_blas
from robustpolish.base.checks import described, instance_of, invalid, one_of, positive
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.errors import InfeasibleError
from robustpolish.linear.arithmetic import balls
from robustpolish.linear.arithmetic.balls import BallSystem
from robustpolish.linear.arithmetic.exact import refuse_extreme
from robustpolish.linear.delay_stability import DelayStability, delay_stability
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import HinfNorm, hinf_norm, singular_values
from robustpolish.linear.stability import stability
from robustpolish.linear.systems import named_system
from robustpolish.plants.blocks import GivenController, controller_system
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plots.poles import plot_poles
from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.proofs import bounded_real
from robustpolish.synthesis.proofs.bounded_real import LARGE

# The norm that a loop achieves, computed, confirmed on a frequency grid, and rounded.


# Up to so many states a norm that doubles cannot settle is computed in higher precision; up to
# fewer, where that takes no time, every norm is.
_PRECISE_STATES = 24
_ALWAYS_PRECISE = 12
# How much, relative, the norm may change when the loop's matrices are rounded to doubles.
_ROUNDING = 1e-2


def achieved_hinf(
    system: control.StateSpace, rounded: control.StateSpace, level: float, reasons: list[str]
) -> tuple[float, float | None]:
    """Compute the norm, confirm it on a grid that is dense around its peak, and round the loop.

    Parameters
    ----------
    system : control.StateSpace
        The stable loop, connected in ball arithmetic.
    rounded : control.StateSpace
        The same, connected in doubles.
    level : float
        Norms below it cannot be told from zero in doubles.
    reasons : list of str
        What speaks against the loop is appended.

    Returns
    -------
    norm : float
    frequency : float or None
        Where it peaks, rad/s.
    """
    precise = system.nstates <= _ALWAYS_PRECISE
    result, gains, grid = _norm_and_grid(system, precise)
    narrow = result.upper <= result.value * (1 + 1e-3)
    doubtful = not (narrow and _grid_confirms(result.value, gains, level))
    if not precise and system.nstates <= _PRECISE_STATES and doubtful:
        precise = True
        result, gains, grid = _norm_and_grid(system, precise)
    value = float(result.value)
    if not np.isfinite(value):
        reasons.append(f"the H-infinity norm could not be computed: {result.reason}")
        return np.inf, None
    largest = float(gains.max(initial=0.0))
    if not _grid_confirms(value, gains, level):
        reasons.append(f"the frequency response reaches {largest:.6g}, the norm was {value:.6g}")
    other = _largest_singular_values(rounded, grid, precise)
    rough = float(other.max(initial=0.0))
    if not abs(rough - largest) <= _ROUNDING * largest + level:
        reasons.append(
            "the loop does not bear rounding: with its matrices in doubles its norm is "
            f"{rough:.6g} instead of {largest:.6g}"
        )
    # What rounding adds counts as well: no machine keeps the matrices exactly.
    for seen in (gains, other):
        if seen.max(initial=0.0) > value * (1 + 1e-9):
            value = float(seen.max())
            result = replace(result, frequency=float(grid[int(np.argmax(seen))]))
    beside = _norm(rounded, precise=False)
    if value * (1 + 1e-9) < beside.value <= value * (1 + _ROUNDING) + level:
        value, result = float(beside.value), beside
    return value, float(result.frequency)


def _norm_and_grid(
    system: control.StateSpace, precise: bool
) -> tuple[HinfNorm, NDArray[np.float64], NDArray[np.float64]]:
    """Return the norm, the largest singular values on a grid, and the grid."""
    result = _norm(system, precise)
    if not np.isfinite(result.value):
        return result, np.zeros(0), np.zeros(0)
    grid = _confirmation_grid(system, float(result.frequency))
    return result, _largest_singular_values(system, grid, precise), grid


def _norm(system: control.StateSpace, precise: bool) -> HinfNorm:
    """Return the norm; a proof in balls follows, so that none is needed for large loops."""
    if system.nstates > LARGE and not system.dt:
        A, B, C, D = (np.asarray(M) for M in (system.A, system.B, system.C, system.D))
        value, where, settled = bounded_real.estimate_norm(A, B, C, D)
        upper = value * (1 + 1e-6) if settled else np.inf
        return HinfNorm(value, where, value, upper, True, "estimated in doubles")
    return hinf_norm(system, exact=precise)


def _grid_confirms(value: float, gains: NDArray[np.float64], level: float) -> bool:
    """Tell whether the largest gain on the grid is the norm."""
    return bool(abs(gains.max(initial=0.0) - value) <= 5e-4 * value + level)


def _confirmation_grid(system: control.StateSpace, peak: float) -> NDArray[np.float64]:
    """Return frequencies in rad/s: zero, infinity, near `peak`, and at the poles.

    Parameters
    ----------
    system : control.StateSpace
    peak : float
        Where the peak is supposed to be, rad/s; may be zero or infinite.

    Returns
    -------
    ndarray
        For a discrete-time system from 0 to the Nyquist frequency.
    """
    nyquist = _nyquist_frequency(system)
    poles: Any = np.linalg.eigvals(system.A) if system.nstates else np.zeros(0, complex)
    # A resonance peaks near the imaginary part, a corner lies at the absolute value.
    own = np.concatenate([np.abs(poles.imag), np.abs(poles)])
    if np.isfinite(nyquist):
        own = np.abs(np.angle(poles)) / (np.pi / nyquist)
    points = [np.array([0.0, nyquist]), np.unique(own)]
    if np.isfinite(peak):
        away = np.concatenate([[0.0], np.logspace(-7, -0.5, 14)])
        points += [peak * (1 + away), peak * (1 - away)]
    grid = np.unique(np.concatenate(points))
    return grid[grid <= nyquist]


def _largest_singular_values(
    system: control.StateSpace, frequencies: NDArray[np.float64], precise: bool = False
) -> NDArray[np.float64]:
    """Return the largest singular value of the response at each frequency.

    Parameters
    ----------
    system : control.StateSpace
    frequencies : ndarray
        In rad/s; infinity is allowed in continuous time.
    precise : bool
        Whether to solve for the response with 160 bits, which high gains need.

    Returns
    -------
    ndarray
        Infinite at a pole on the boundary.
    """
    A, B, C, D = (np.asarray(M) for M in (system.A, system.B, system.C, system.D))
    values = np.zeros(frequencies.size)
    nyquist = _nyquist_frequency(system)
    exact = [balls.ball(M) for M in (A, B, C, D)]
    for i, frequency in enumerate(frequencies if D.size else ()):
        check_deadline()
        s, response = None, D
        if np.isfinite(frequency):
            angle = np.pi * frequency / nyquist
            s = complex(np.exp(1j * angle) if np.isfinite(nyquist) else 1j * frequency)
        try:
            if precise:
                with balls.precision(160):
                    point = None if s is None else flint.acb(s)
                    response = balls.midpoint(balls.transfer_matrix(*exact, point))  # pyright: ignore[reportCallIssue]
            elif s is not None:
                response = D + C @ np.linalg.solve(s * np.eye(len(A)) - A, B.astype(complex))
            values[i] = np.linalg.svd(response, compute_uv=False)[0]
        except (np.linalg.LinAlgError, ZeroDivisionError):
            values[i] = np.inf
    return values


def _nyquist_frequency(system: control.StateSpace) -> float:
    """Return the highest frequency in rad/s; pi if the sampling time has no unit."""
    if not system.dt:
        return np.inf
    return np.pi / (1.0 if system.dt is True else float(system.dt))


# What a loop certified with Pade models is with its delays as they are.


@dataclass(frozen=True, eq=False)
class ExactDelays:
    """A loop with its delays as they are.

    Attributes
    ----------
    stability : DelayStability
        Whether it is stable, and how that was decided.
    gain : float or None
        The largest singular value from w to z that was found over frequency, a lower bound of the
        norm; None if the loop was not found stable, or where it is not asked for.
    orders : mapping of str to int
        Order of the Pade approximation of each delayed signal, on which the proof rests.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> lag = control.tf([1], [1, 1], inputs="u", outputs="y")
    >>> plant = rp.GeneralizedPlant.from_loop(lag).with_delay("u", 0.5)
    >>> print(rp.certify(plant, [[-1.0]]).exact_delays)
    proven for Pade models of the delays (u of order 3);
    with the exact delays the loop is stable and its gain reaches 2.0...
    """

    stability: DelayStability
    gain: float | None
    orders: dict[str, int]

    def __str__(self) -> str:
        models = ", ".join(f"{name} of order {order}" for name, order in self.orders.items())
        found = {
            "stable": "the loop is stable",
            "unstable": "the loop is UNSTABLE",
            "undecided": f"it was not decided whether the loop is stable: {self.stability.reason}",
        }[self.stability.verdict]
        reached = "" if self.gain is None else f" and its gain reaches {self.gain:.6g}"
        proven = f"proven for Pade models of the delays ({models})"
        return f"{proven}; with the exact delays {found}{reached}"


def exact_delays(
    plant: GeneralizedPlant, controller: control.StateSpace, norm: str
) -> ExactDelays | None:
    """Check a loop with its delays as they are; None for a plant whose model is exact.

    Parameters
    ----------
    plant : GeneralizedPlant
    controller : control.StateSpace
    norm : {"hinf", "h2"}
        The gain is looked for with the first only.

    Returns
    -------
    ExactDelays or None
    """
    lines = plant.wiring.lines
    if not lines:
        return None
    loop, best = plant.delayed_loop(controller), None
    stability = delay_stability(loop)
    if stability and norm == "hinf" and plant.nw and plant.nz:
        # The largest gain over the frequencies that matter to the Pade model, and near it.
        best = 0.0
        omega = 2 * np.pi * singular_values(loop.pade_model())["frequency"].to_numpy()
        omega = np.concatenate([[0.0], omega])
        for _ in range(3):
            gains = np.linalg.norm(loop.response(omega), 2, axis=(1, 2))
            gains[~np.isfinite(gains)] = 0.0
            at = int(gains.argmax())
            best = max(best, float(gains[at]))
            omega = np.linspace(omega[max(at - 1, 0)], omega[min(at + 1, omega.size - 1)], 41)
    orders: dict[str, int] = {}
    for line in lines:  # the least of a signal that is delayed twice
        orders[line.name] = min(line.order, orders.get(line.name, line.order))
    return ExactDelays(stability, best, orders)


Norm = Literal["hinf", "h2"]


@dataclass(frozen=True, eq=False, repr=False)
class Certificate(Displayed):
    """What is known about a closed loop, whoever designed it.

    Attributes
    ----------
    norm : {"hinf", "h2"}
        The norm that is certified.
    valid : bool
        True only if the loop is proven stable, the norm proven to lie below `bound` and
        confirmed on a frequency grid, if rounding the loop's matrices to doubles changes it
        by less than 1 %, if the claim, if any, is kept, and if exact delays make it not unstable.
    reasons : tuple of str
        Why it is not valid; empty if it is.
    stable : bool
        Whether all closed-loop poles are stable.
    achieved : float
        The norm from w to z, computed from the loop, exact or with matrices rounded to
        doubles, whichever is larger; infinite if unstable. Of a norm so small that rounding in
        doubles feigns as much, the proven bound: that is all that can be said.
    claimed : float or None
        The bound that a solver claimed.
    gap : float or None
        claimed / achieved - 1: positive where the claim is a true upper bound.
    bound : float
        Proven upper bound on the norm, within 0.1 % of `achieved` or of a larger claim;
        infinite if nothing could be proven.
    peak_frequency : float or None
        Where the largest singular value peaks, rad/s; None for the H2 norm.
    largest_gain : float
        Largest absolute entry of the controller's matrices, in the plant's units.
    poles : ndarray of complex, shape (nx + nk,)
        Closed-loop poles, rad/s (discrete time: eigenvalues of the state matrix).
    damping : ndarray, shape (nx + nk,)
        Damping ratio of each pole.
    frequencies_hz : ndarray, shape (nx + nk,)
        Natural frequency of each pole, Hz (cycles per sample if dt is True).
    proof : NormProof or None
        The matrix behind `bound`.
    discrete : bool
        Whether it is a discrete-time loop.
    exact_delays : ExactDelays or None
        For a plant with delays: all of the above is about their Pade models; this says whether
        the loop with the delays as they are is stable. None for all other plants.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> rp.certify(plant, [[-3.0]], "hinf", claimed=0.5)
    Certificate: valid
      H-infinity norm achieved         0.5
      proven to be at most        0.500005
      claimed                          0.5
      peak at [Hz]                       0
      largest entry of K                 3
      slowest pole [Hz]            0.31831
      least damping ratio                1
    """

    norm: Norm
    valid: bool
    reasons: tuple[str, ...]
    stable: bool
    achieved: float
    claimed: float | None
    gap: float | None
    bound: float
    peak_frequency: float | None
    largest_gain: float
    poles: NDArray[np.complex128]
    damping: NDArray[np.float64]
    frequencies_hz: NDArray[np.float64]
    proof: bounded_real.NormProof | None = field(repr=False)
    discrete: bool = False
    exact_delays: ExactDelays | None = None

    def plot(
        self, ax: Axes | None = None, *, regions: PoleRegion | Sequence[PoleRegion] = ()
    ) -> Axes:
        """Draw the closed-loop poles, and the regions that they were to lie in.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        regions : HalfPlane, Disk, Sector or a sequence of them, optional
            What lies outside of them is hatched.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> rp.certify(plant, [[-3.0]]).plot(regions=rp.HalfPlane(-1.0)).get_xlabel()
        'real part [1/s]'
        """
        return plot_poles(
            {"closed-loop poles": self.poles}, boundaries(regions), ax, discrete=self.discrete
        )

    def _card(self) -> Card:
        peak = None if self.peak_frequency is None else self.peak_frequency / (2 * np.pi)
        rows = (
            (f"{norm_in_words(self.norm)} norm achieved", self.achieved),
            ("proven to be at most", self.bound),
            ("claimed", self.claimed),
            *([("peak at [Hz]", peak)] if self.norm == "hinf" else []),
            ("largest entry of K", self.largest_gain),
            ("slowest pole [Hz]", float(self.frequencies_hz.min(initial=np.inf))),
            ("least damping ratio", float(self.damping.min(initial=1.0))),
        )
        verdict = "valid" if self.valid else "NOT valid"
        delays = () if self.exact_delays is None else (f"{self.exact_delays}",)
        return Card(f"Certificate: {verdict}", (quantities(*rows),), (*self.reasons, *delays))

    def with_claim(self, claimed: float) -> Certificate:
        """Return the certificate with a claim that is kept, for a loop certified without one.

        Parameters
        ----------
        claimed : float
            A bound that the loop keeps.

        Returns
        -------
        Certificate

        Examples
        --------
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> round(rp.certify(plant, [[-3.0]]).with_claim(0.6).gap, 6)
        0.2
        """
        return replace(self, claimed=claimed, gap=_gap(claimed, self.achieved))


@single_threaded_blas
def certify(
    plant: GeneralizedPlant,
    controller: GivenController,
    norm: Norm = "hinf",
    claimed: float | None = None,
    tolerance: float = 1e-3,
) -> Certificate:
    r"""Check a controller against its plant, trusting nobody.

    Parameters
    ----------
    plant : GeneralizedPlant
        With nw disturbances and nz performance outputs, continuous or discrete.
    controller : control.StateSpace, control.TransferFunction or array_like, shape (nu, ny)
        K in u = K y (positive sign): a system or a gain.
    norm : {"hinf", "h2"}
        The norm from w to z to be certified.
    claimed : float, optional
        The bound that a solver claims, in the plant's units.
    tolerance : float
        How far the achieved norm may lie above the claim (relative) before the claim
        is called false.

    Returns
    -------
    Certificate

    Raises
    ------
    InvalidInputError
        If shapes, sampling times or options do not fit, or the loop is not well posed.

    Notes
    -----
    For the H-infinity norm a P > 0 satisfies the strict bounded-real inequality

    .. math:: \begin{bmatrix} A^T P + P A + C^T C & P B + C^T D \\
              B^T P + D^T C & D^T D - \gamma^2 I \end{bmatrix} < 0

    for the H2 norm a Gramian bounds trace(C X C'). Both are checked in ball arithmetic, so
    that a valid certificate is a proof for the controller's entries exactly as they are stored.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> certificate = rp.certify(plant, [[-3.0]], "hinf", claimed=0.5)
    >>> certificate.valid, round(certificate.achieved, 6)
    (True, 0.5)
    >>> rp.certify(plant, [[-3.0]], "hinf", claimed=0.4).reasons
    ('the claimed bound 0.4 is false: the loop has 0.5',)
    """
    one_of("norm", norm, ("hinf", "h2"))
    if claimed is not None:
        claimed = positive("claimed", claimed, zero=True)
    positive("tolerance", tolerance, zero=True)
    remedy = "Build one with GeneralizedPlant(control.ss(...), measurements=..., controls=...)."
    instance_of("plant", plant, GeneralizedPlant, "a GeneralizedPlant", remedy)
    K = controller_system(plant, controller)
    rounded = plant.closed_loop(K)  # checks shapes, times and that the loop is well posed
    refuse_extreme("plant", {name: getattr(rounded, name) for name in "ABCD"})
    reasons: list[str] = []
    try:
        loop = bounded_real.enclose_loop(plant, K)
    except ZeroDivisionError:
        raise invalid(
            "controller",
            described("a loop matrix I - Dk D22 that is singular to working accuracy"),
            "a well-posed loop",
            "Change the controller's feedthrough.",
        ) from None
    names = (rounded.input_labels, rounded.output_labels, rounded.state_labels)
    system = named_system(loop.doubles, plant.dt, *names)
    poles, damping, hertz = _poles(system, plant.dt)
    step = (1.0 if plant.dt is True else float(plant.dt)) if plant.is_discrete else None
    through = [float(np.linalg.norm(M)) for M in (plant.D12, K.D, plant.C2)]
    level = bounded_real.rounding_level(loop, float(np.prod(through)))
    achieved, peak, bound, proven = np.inf, None, np.inf, None
    size = np.abs(poles) if plant.is_discrete else poles.real
    # Whether all poles, as doubles see them, are stable.
    stable = bool((size < (1 if plant.is_discrete else 0)).all())
    if norm == "hinf" and stable:
        proven = bounded_real.prove_computed_norm(loop, BallSystem.of(rounded), level, step)
    if proven is None:
        # Doubles and a first proof leave doubt: everything is computed once more, with care.
        stable = bool(stability(system))
        if not stable:
            reasons.append(f"the loop is unstable: a pole at {poles[np.argmax(size)]:.6g}")
        elif norm == "hinf":
            achieved, peak = achieved_hinf(system, rounded, level, reasons)
        else:
            found = h2_norm(system, tolerance=1e-4)  # the proof bounds it closer
            achieved = float(found.value)
            if not np.isfinite(achieved):
                reasons.append(f"the H2 norm is not finite: {found.reason}")
        if np.isfinite(achieved):
            proven = bounded_real.tightest_proof(
                lambda bits: (
                    loop if bits == bounded_real.BITS else bounded_real.enclose_loop(plant, K, bits)
                ),
                norm,
                achieved,
                peak,
                claimed,
                step,
            )
    proof = None
    if proven is not None:
        proof, achieved, peak = proven
        if proof is None:
            reasons.append("stability and norm could not be proven in ball arithmetic")
        else:
            bound = proof.bound
            if np.isfinite(bound) and achieved <= level:
                # All that double precision can say of such a norm is that it is below a bound.
                achieved = bound
            if bound > (1 + bounded_real.TIGHT) * max(achieved, claimed or 0.0):
                reasons.append(f"only the bound {bound:.6g} could be proven, not {achieved:.6g}")
    if claimed is not None and np.isfinite(achieved) and achieved > claimed * (1 + tolerance):
        reasons.append(f"the claimed bound {claimed:.6g} is false: the loop has {achieved:.6g}")
    exact = exact_delays(plant, K, norm) if stable and plant.delays else None
    if exact is not None and exact.stability.verdict == "unstable":
        reasons.append(
            "the loop is unstable with its delays as they are: the Pade models are too rough; "
            "raise order= of with_delay"
        )
    return Certificate(
        norm=norm,
        valid=not reasons,
        reasons=tuple(reasons),
        stable=stable,
        achieved=float(achieved),
        claimed=claimed,
        gap=_gap(claimed, achieved),
        bound=float(bound),
        peak_frequency=peak,
        largest_gain=max(float(np.abs(M).max(initial=0)) for M in (K.A, K.B, K.C, K.D)),
        poles=poles,
        damping=damping,
        frequencies_hz=hertz,
        proof=proof,
        discrete=plant.is_discrete,
        exact_delays=exact,
    )


def _poles(
    system: control.StateSpace, dt: float | bool
) -> tuple[NDArray[np.complex128], NDArray[np.float64], NDArray[np.float64]]:
    """Return poles with damping ratio and natural frequency, slowest first."""
    A = np.asarray(system.A)
    poles: Any = np.linalg.eigvals(A).astype(complex) if A.size else np.zeros(0, complex)
    rate = poles
    if dt:
        with np.errstate(divide="ignore", invalid="ignore"):  # a pole at zero: infinitely fast
            rate = np.log(poles) / (1.0 if dt is True else float(dt))
    size = np.abs(rate)
    with np.errstate(invalid="ignore"):
        damping = np.where(size > 0, -rate.real / np.where(size > 0, size, 1), -1.0)
    damping = np.where(np.isinf(size), 1.0, damping)
    order = np.argsort(size, kind="stable")
    return poles[order], damping[order], size[order] / (2 * np.pi)


def _gap(claimed: float | None, achieved: float) -> float | None:
    if claimed is None:
        return None
    if achieved == 0:
        return 0.0 if claimed == 0 else np.inf
    return claimed / achieved - 1 if np.isfinite(achieved) else -1.0


# Which norm was asked for: any below a number, or the smallest within a range.

Gamma = float | Sequence[float]
"""A norm to stay below, or the range of a search."""

_EXPECTED = "a positive number, or (low, high) with 0 <= low <= high and high > 0"
_REMEDY = (
    "Pass gamma=2.0 for any controller with a norm below 2, or gamma=(1.0, 2.0) to search the "
    "smallest norm between these."
)
# Proven bounds lie a little above the norm: what is aimed at lies by this share below.
_ROOM = 2e-4


@dataclass(frozen=True)
class NormTarget:
    """Which norms will do.

    Attributes
    ----------
    enough : float
        The search need not go below.
    below : float
        The norm must not lie above; infinite if nothing was asked.
    """

    enough: float = 0.0
    below: float = np.inf

    @classmethod
    def checked(cls, gamma: Any) -> NormTarget:
        """Read the argument ``gamma`` of a method.

        Raises
        ------
        InvalidInputError
            If it is neither a positive number nor a range.

        Examples
        --------
        >>> NormTarget.checked(2.0)
        NormTarget(enough=2.0, below=2.0)
        >>> NormTarget.checked((0.5, 2.0))
        NormTarget(enough=0.5, below=2.0)
        """
        if gamma is None:
            return ANY_NORM
        numbers = np.asarray(gamma, dtype=object).ravel().tolist()
        wrong = any(isinstance(n, bool | np.bool_ | str | bytes | complex) for n in numbers)
        try:
            ends = [] if wrong else [float(number) for number in numbers]
        except (TypeError, ValueError):
            ends = []
        if len(ends) == 1 and np.isfinite(ends[0]) and ends[0] > 0:
            return cls(ends[0], ends[0])
        if len(ends) != 2 or not 0 <= ends[0] <= ends[1] or np.isinf(ends[0]) or ends[1] == 0:
            raise invalid("gamma", gamma, _EXPECTED, _REMEDY)
        return cls(*ends)

    @property
    def is_requested(self) -> bool:
        """Whether anything was asked for."""
        return self.enough > 0 or np.isfinite(self.below)

    def in_unit(self, unit: float) -> NormTarget:
        """Return it for norms that are counted in units of `unit`."""
        return NormTarget(self.enough / unit, self.below / unit)

    def limited(self, goal: float) -> float:
        """Return the norm that a search aims at that would aim at `goal` by itself."""
        if not self.is_requested:
            return goal
        return min(max(goal, self.enough), self.below) * (1 - _ROOM)

    def in_words(self) -> str:
        """Return what was asked for, as it is told in messages; empty if nothing was."""
        if not self.is_requested:
            return ""
        if self.enough == self.below:
            return f"a norm below gamma = {self.below:.6g}"
        above = f"{self.below:.6g}" if np.isfinite(self.below) else "infinity"
        return f"a norm within gamma = {self.enough:.6g} to {above}"


ANY_NORM = NormTarget()
"""Nothing was asked for."""


def norm_in_words(norm: Norm) -> str:
    """Return the name of a norm as messages have it."""
    return "H-infinity" if norm == "hinf" else "H2"


def unreachable_norm_error(
    wanted: NormTarget, bound: float, norm: Norm, how: str
) -> InfeasibleError:
    """Return the error for a norm that no controller reaches."""
    return InfeasibleError(
        f"gamma: no controller has {wanted.in_words()}. The {norm_in_words(norm)} norm of every "
        f"stabilising controller's loop is at least {bound:.6g}, {how}. Ask for more than that."
    )


def checked_regions(
    argument: str, given: PoleRegion | Sequence[PoleRegion] | None
) -> tuple[PoleRegion, ...]:
    """Return one region, several or none as a tuple.

    Raises
    ------
    InvalidInputError
        If one of them is no region.
    """
    several = given if isinstance(given, Sequence) else () if given is None else (given,)
    for region in several:
        if not isinstance(region, PoleRegion):
            shown = described(type(region).__name__)
            raise invalid(argument, shown, "HalfPlane, Disk or Sector", "Build one of these.")
    return tuple(several)


def violated_regions(regions: Sequence[PoleRegion], poles: ArrayLike) -> list[str]:
    """Say of each region that some of the poles miss that they do."""
    return [f"a pole lies outside {region}" for region in regions if not region.contains(poles)]


def boundaries(regions: PoleRegion | Sequence[PoleRegion]) -> dict[str, tuple[Matrix, Matrix]]:
    """Return L and M of each region by a name that tells its numbers, to be drawn."""
    several = checked_regions("regions", regions)
    return {f"outside {region}": (region.L, region.M) for region in several}
