"""How a controller is stored and computed: forms, rounding, limits, imitation at samples."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, get_args

import control
import numpy as np
from scipy import linalg, signal
from scipy.sparse.csgraph import connected_components

from robustpolish.base.arrays import Array, Matrix, Vector
from robustpolish.base.checks import invalid, misfit, one_of, positive
from robustpolish.implementation.sampled.certificate import Norm, SampledCertificate, certificate_of
from robustpolish.linear.scaling import border_scale
from robustpolish.linear.stability import square_root
from robustpolish.linear.systems import as_state_space, named_like, of_roots
from robustpolish.plants.blocks import matrices_of
from robustpolish.plants.plant import GeneralizedPlant

# What single precision does to a controller: rounded coefficients, and rounding every sample.

UNIT = 2.0**-24
"""Largest relative error of one operation in single precision."""

SAMPLES = 10_000
"""Over so many samples the bound on the outputs is taken."""

_TINY = 2.0**-126


class RoundoffBound(NamedTuple):
    """Bounds for measurements of at most one unit each.

    ``per_sample`` : what rounding adds to every control in one sample; ``outputs`` : by how much
    the controls of `SAMPLES` samples from rest differ from those of the controller in doubles,
    rounding of coefficients included; ``size`` : the largest controls there can be.
    """

    per_sample: Vector
    outputs: Vector
    size: Vector


def rounded(controller: control.StateSpace) -> control.StateSpace:
    """Return a controller with its coefficients rounded to single precision."""
    parts = [np.asarray(M, dtype=np.float32).astype(float) for M in matrices_of(controller)]
    return named_like(controller, parts, controller.dt)


def roundoff_bound(controller: control.StateSpace, samples: int = SAMPLES) -> RoundoffBound:
    """Bound the error of a controller that is computed in single precision.

    Parameters
    ----------
    controller : control.StateSpace
        Discrete, in the form in which it is computed.
    samples : int, optional

    Returns
    -------
    RoundoffBound
        Infinite for a controller whose outputs are not bounded over so many samples.

    Notes
    -----
    A sum of m products is off by at most (m + 1) u / (1 - (m + 1) u) times the sum of their
    sizes (N. J. Higham, Accuracy and Stability of Numerical Algorithms, section 3.1); what a sample
    adds reaches later ones through the powers of A, whose sizes are summed.
    """
    A, B, C, D = matrices_of(controller)
    n, ny = B.shape
    unit = (n + ny + 2) * UNIT
    gamma = unit / (1 - unit)
    y = np.ones(ny)
    direct = np.abs(D) @ y
    if n == 0:
        step = (gamma + UNIT) * direct + _TINY
        return RoundoffBound(step, step, direct)
    with np.errstate(all="ignore"):
        reach, seen, passed = _sums(A, B, C, samples)
        x = reach @ y
        size = np.abs(C) @ x + direct
        # What a sample adds to the states: rounding of sums, of coefficients and of y.
        extra = np.zeros(n)
        for _ in range(20):
            inside = x + passed @ extra
            extra = (gamma + 3 * UNIT) * (np.abs(A) @ inside + np.abs(B) @ y) + _TINY
        inside = x + passed @ extra
        per_sample = (gamma + 3 * UNIT) * (np.abs(C) @ inside + direct) + _TINY
        outputs = seen @ extra + per_sample
    bad = ~np.isfinite(outputs) | (outputs > size * 1e6)
    outputs = np.where(bad, np.inf, outputs)
    return RoundoffBound(np.where(bad, np.inf, per_sample), outputs, size)


def _sums(A: Matrix, B: Matrix, C: Matrix, samples: int) -> tuple[Matrix, Matrix, Matrix]:
    """Return the sums over so many samples of |A^k B|, |C A^k| and |A^k|."""
    reach, seen, passed = np.zeros_like(B), np.zeros_like(C), np.zeros_like(A)
    power = np.eye(len(A))
    for _ in range(samples):
        size = np.abs(power)
        reach, seen, passed = reach + np.abs(power @ B), seen + np.abs(C @ power), passed + size
        power = A @ power
        if not size.max() > 1e-30 or not np.isfinite(size).all():
            break
    return reach, seen, passed


# Coordinates in which a controller is computed: balanced, modal, or sections of second order.

FORMS = ("balanced", "modal", "sections")

_TOGETHER = 1e8
"""Condition of eigenvectors beyond which modes are not split: their sum would cancel."""


def realized(controller: control.StateSpace, form: str) -> control.StateSpace:
    """Return the same controller in other coordinates.

    Parameters
    ----------
    controller : control.StateSpace
        Discrete.
    form : {"balanced", "modal", "sections"}
        "balanced": the states are as easy to reach as to see; what is unstable is left apart.
        "modal": a block of one or two states per mode, as large at its input as at its output.
        "sections": the same blocks side by side, sections of first and second order
        with A = [[a, b], [-b, a]], scaled to inputs of one unit, as fixed scales need it.
        Modes that are almost multiple stay together in a block.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    InvalidInputError
        If the form is unknown.
    """
    one_of("form", form, FORMS)
    A, B, C, D = matrices_of(controller)
    if not A.size:
        return controller
    even = border_scale(A, np.abs(B).max(axis=1), np.abs(C).max(axis=0))
    A, B, C = A * even / even[:, None], B / even[:, None], C * even
    T = _balancing(A, B, C) if form == "balanced" else _modes(A)
    A, B, C = np.linalg.solve(T, A @ T), np.linalg.solve(T, B), C @ T
    if form != "balanced":
        # What rounding left outside of the blocks is cleared.
        level = 1e-12 * max(float(np.abs(A).max()), 1e-300)
        A, B, C = _scaled(np.where(np.abs(A) > level, A, 0.0), B, C, to_input=form == "sections")
    return named_like(controller, (A, B, C, D), controller.dt)


def _balancing(A: Matrix, B: Matrix, C: Matrix) -> Matrix:
    """Return the coordinates in which both Gramians are equal and diagonal.

    An unstable controller is slowed down to a circle that holds its poles, which gives its states
    comparable sizes all the same.
    """
    slow = A / max(float(np.abs(np.linalg.eigvals(A)).max()) / 0.999, 1.0)

    def root(transition: Matrix, source: Matrix) -> Matrix:
        found: Any = linalg.solve_discrete_lyapunov(transition, source)
        found = (found + found.T) / 2
        found = found + 1e-14 * max(np.linalg.norm(found, 2), 1e-300) * np.eye(len(A))
        return square_root(found, 1e-16)

    reach, see = root(slow, B @ B.T), root(slow.T, C.T @ C)
    _, hankel, Vt = np.linalg.svd(see.T @ reach)
    return reach @ Vt.T / np.sqrt(hankel)


def _modes(A: Matrix) -> Matrix:
    """Return real coordinates that split A into its modes, as far as they can be told apart."""
    values, vectors = np.linalg.eig(A)
    columns = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag >= 0:
            columns += [vector.real, vector.imag] if value.imag else [vector.real]
    T = np.array(columns).T
    if T.shape == A.shape and np.linalg.cond(T) < _TOGETHER:
        return T
    return _groups(A)


def _groups(A: Matrix) -> Matrix:
    """Split A by its ordered Schur form only where the parts are far enough from each other."""
    n = len(A)
    found: Any = linalg.schur(A, output="real")
    form, basis = found[:2]
    T, start = basis.copy(), 0
    for cut in [i for i in range(1, n) if form[i, i - 1] == 0]:
        X = linalg.solve_sylvester(
            form[start:cut, start:cut], -form[cut:, cut:], -form[start:cut, cut:]
        )
        if np.isfinite(X).all() and np.linalg.norm(X) < _TOGETHER**0.5:
            step = np.eye(n)
            step[start:cut, cut:] = X
            form, T, start = np.linalg.solve(step, form @ step), T @ step, cut
    return T


def _scaled(A: Matrix, B: Any, C: Matrix, to_input: bool) -> tuple[Matrix, Matrix, Matrix]:
    """Scale states by powers of two: those of a block alike, so that its form is kept."""
    links = (np.abs(A) + np.abs(A.T)) > 0
    label = connected_components(links, directed=False)[1]
    T = np.ones(len(A))
    for block in np.unique(label):
        own = label == block
        size = float(np.abs(B[own]).max(initial=0.0))
        seen = float(np.abs(C[:, own]).max(initial=0.0))
        if to_input and size > 0:
            T[own] = size
        elif size > 0 and seen > 0:
            T[own] = np.sqrt(size / seen)
    T = np.exp2(np.round(np.log2(T)))
    return A * T / T[:, None], B / T[:, None], C * T


# Limits of actuators, and what a controller learns of them.

Limits = float | tuple[float, float] | Mapping[str, Any] | Sequence[Any] | None
"""None, one size for all controls, (low, high) for all, or a mapping from names to either."""

Form = Literal["auto", "conditioned", "observer", "none"]

_REMEDY = 'Pass a size, (low, high), or a mapping such as {"F": 10.0, "M": (-1.0, 2.0)}.'
_SLOWEST = 0.999
"""Largest pole of a conditioned controller whose memory of a saturation is called short enough."""


class AntiWindup(NamedTuple):
    """x+ = A x + B y + L (u - v), with v = C x + D y and u its part within the limits."""

    L: Matrix
    form: str


def control_limits(limits: Limits, names: Sequence[str]) -> tuple[Vector, Vector] | None:
    """Return the lowest and the highest value of every control.

    Parameters
    ----------
    limits : float, (float, float), mapping, sequence or None
        A size s stands for (-s, s); a mapping leaves controls that it does not name unlimited; a
        list has an entry per control.
    names : sequence of str
        Of the controls.

    Returns
    -------
    (low, high) or None
        Infinite where there is no limit; None if there is none at all.

    Raises
    ------
    InvalidInputError
        If a name is unknown, or low does not lie below high.
    """
    if limits is None:
        return None
    given: dict[str, Any] = dict.fromkeys(names, limits)
    if isinstance(limits, Mapping):
        given = dict(limits)
        for name in given:
            one_of(("limits", str(name)), name, names, _REMEDY)
    elif isinstance(limits, list):
        if len(limits) != len(names):
            raise invalid("limits", limits, f"{len(names)} entries, one per control", _REMEDY)
        given = dict(zip(names, limits, strict=True))
    pairs = [(-np.inf, np.inf) if given.get(n) is None else _pair(n, given[n]) for n in names]
    low, high = np.array(pairs, dtype=float).reshape(-1, 2).T.copy()
    return (low, high) if np.isfinite([low, high]).any() else None


def anti_windup(controller: control.StateSpace, form: str = "auto") -> AntiWindup:
    """Return how a discrete controller's states follow what the actuators really do.

    Parameters
    ----------
    controller : control.StateSpace
        Discrete.
    form : {"auto", "conditioned", "observer", "none"}, optional
        "conditioned" (Hanus): the states move as if y had asked for just what the actuators do,
        L = B inv(D); it needs an invertible D. "observer": L makes A - L C stable, by a Kalman
        filter for noise that enters as y does. "auto" takes the first if it suits, the second
        otherwise.

    Returns
    -------
    AntiWindup

    Raises
    ------
    InvalidInputError
        If "conditioned" does not suit the controller.

    Notes
    -----
    R. Hanus, M. Kinnaert, J.-L. Henrotte, "Conditioning technique, a general anti-windup and
    bumpless transfer method", Automatica 23 (1987) 729-739; K. J. Astrom, L. Rundqwist,
    "Integrator windup and how to avoid it", American Control Conference 1989. Both leave the loop
    as it is while no limit is reached. No norm is claimed for a loop at its limits: simulate it.
    """
    one_of("anti_windup", form, get_args(Form))
    A, B, C, D = matrices_of(controller)
    n, nu = A.shape[0], C.shape[0]
    if form == "none" or n == 0:
        return AntiWindup(np.zeros((n, nu)), "none")
    if form != "observer" and D.shape[0] == D.shape[1] and np.linalg.cond(D) <= 1e8:
        L: Any = np.linalg.solve(D.T, B.T).T
        if np.abs(np.linalg.eigvals(A - L @ C)).max() < _SLOWEST:
            return AntiWindup(L, "conditioned")
    if form == "conditioned":
        shown = "'conditioned' for a D without an inverse that leaves stable zeros"
        remedy = "Use anti_windup='observer'."
        raise misfit("anti_windup", shown, "an invertible D and stable zeros", remedy)
    return AntiWindup(_observer(A, B, C), "observer")


def _observer(A: Matrix, B: Matrix, C: Matrix) -> Matrix:
    """Return the gain of a Kalman filter; none where the controller is stable but unseen."""
    n, none = len(A), np.zeros((len(A), len(C)))
    drive = B @ B.T
    drive = drive / max(np.linalg.norm(drive), 1e-300) + 1e-9 * np.eye(n)
    noise = C @ C.T / max(n, 1) + 1e-12 * max(np.linalg.norm(C) ** 2, 1e-300) * np.eye(len(C))
    try:
        P = linalg.solve_discrete_are(A.T, C.T, drive, noise)
    except (np.linalg.LinAlgError, ValueError):
        return none
    L = np.linalg.solve(C @ P @ C.T + noise, C @ P @ A.T).T
    stable = np.isfinite(L).all() and np.abs(np.linalg.eigvals(A - L @ C)).max() < 1
    return L if stable else none


def _pair(name: str, value: Any) -> tuple[float, float]:
    key = ("limits", name)
    try:
        numbers = np.atleast_1d(np.asarray(value, dtype=float))
    except (TypeError, ValueError):
        raise invalid(key, value, "a size or (low, high)", _REMEDY) from None
    if numbers.shape == (1,):
        numbers = np.array([-numbers[0], numbers[0]])
    if numbers.shape != (2,) or np.isnan(numbers).any() or not numbers[0] < numbers[1]:
        raise invalid(key, value, "a positive size, or (low, high) with low < high", _REMEDY)
    return float(numbers[0]), float(numbers[1])


# What single precision costs a loop: its certificate with rounded coefficients.


@dataclass(frozen=True, eq=False)
class SinglePrecision:
    """A loop whose controller has its coefficients in single precision.

    Attributes
    ----------
    certificate : SampledCertificate
        Of the loop with rounded coefficients.
    pole_shift : float
        How far the farthest pole of the controller has moved (of the z plane's unit circle).
    norm_change : float
        Relative; infinite if the loop is unstable.
    per_sample, outputs : ndarray
        Bounds of what rounding adds to each control in one sample, and over 10,000 samples in all,
        rounding of coefficients included, for measurements of at most one unit each.
    size : ndarray
        The largest controls that such measurements bring.
    """

    certificate: SampledCertificate
    pole_shift: float
    norm_change: float
    per_sample: Vector
    outputs: Vector
    size: Vector

    @property
    def sentence(self) -> str:
        """The loss in words."""
        if not self.certificate.stable:
            return "With coefficients in single precision the loop is unstable."
        relative = float(np.max(self.per_sample / np.maximum(self.size, 1e-300), initial=0.0))
        change = 100 * self.norm_change
        told = f"by {change:+.2g} %" if abs(change) >= 1e-4 else "by less than 0.0001 %"
        return (
            f"In single precision its poles move by up to {self.pole_shift:.2g}, the norm of the "
            f"loop changes {told}, and rounding adds up to {relative:.2g} of the largest control "
            "in every sample."
        )


def single_precision(
    filtered: GeneralizedPlant,
    controller: control.StateSpace,
    delay: float,
    norm: Norm,
    before: float,
) -> SinglePrecision:
    """Certify a loop whose controller is rounded to single precision, and bound its roundoff.

    Parameters
    ----------
    filtered : GeneralizedPlant
        Continuous, with its filter.
    controller : control.StateSpace
        Discrete, in the form in which it is computed.
    delay : float
        In s.
    norm : {"hinf", "h2"}
    before : float
        The norm in double precision.

    Returns
    -------
    SinglePrecision
    """
    short = rounded(controller)
    certificate = certificate_of(filtered, short, delay, norm)
    change = certificate.achieved / before - 1 if before > 0 else 0.0
    bound = roundoff_bound(controller)
    return SinglePrecision(certificate, _shift(controller, short), float(change), *bound)


def _shift(first: Any, second: Any) -> float:
    """Return the largest distance between poles that belong together."""
    one, other = (np.linalg.eigvals(matrices_of(each)[0]) for each in (first, second))
    most = 0.0
    for pole in one:
        nearest = int(np.argmin(np.abs(other - pole)))
        most = max(most, float(np.abs(other[nearest] - pole)))
        other = np.delete(other, nearest)
    return most


# A discrete controller stepped in doubles, with the limits of its actuators.


def controller_outputs(
    controller: control.StateSpace,
    y: Array,
    limits: tuple[Vector, Vector] | None = None,
    feedback: Matrix | None = None,
) -> Array:
    """Return what a controller makes of measurements, from rest.

    Parameters
    ----------
    controller : control.StateSpace
        Discrete.
    y : ndarray, shape (samples, ny)
    limits : (low, high), optional
        Of the controls.
    feedback : ndarray, shape (nk, nu), optional
        L of the anti-windup; see `anti_windup`.

    Returns
    -------
    ndarray, shape (samples, nu)
    """
    A, B, C, D = matrices_of(controller)
    low, high = limits if limits is not None else (-np.inf, np.inf)
    L = np.zeros((len(A), len(C))) if feedback is None else feedback
    x, out = np.zeros(len(A)), np.zeros((len(y), len(C)))
    for k, measured in enumerate(y):
        wanted = C @ x + D @ measured
        out[k] = np.clip(wanted, low, high)
        x = A @ x + B @ measured + L @ (out[k] - wanted)
    return out


# A continuous controller imitated at the samples.

Method = Literal["tustin", "zoh", "foh", "matched", "impulse", "forward", "backward"]
METHODS: tuple[str, ...] = get_args(Method)
_SAME = {"bilinear": "tustin", "euler": "forward", "backward_diff": "backward"}


def emulated(
    controller: control.StateSpace,
    period: float,
    method: str = "tustin",
    prewarp_hz: float | None = None,
) -> control.StateSpace:
    """Imitate a continuous controller at samples.

    Parameters
    ----------
    controller : control.StateSpace
        Continuous, or a static gain.
    period : float
        In s.
    method : str, optional
        "tustin" (trapezoidal rule; "bilinear" is the same), "zoh" and "foh" (exact for
        measurements that are held, or joined by straight lines, between samples), "matched"
        (poles and zeros; one measurement and one control), "impulse" (same impulse response),
        "forward" and "backward" (Euler's rules).
    prewarp_hz : float, optional
        Where "tustin" is exact, in Hz.

    Returns
    -------
    control.StateSpace
        Discrete, with the names of `controller`; as many states.

    Raises
    ------
    InvalidInputError
        If the method does not exist or does not fit the controller.

    Examples
    --------
    >>> import control
    >>> from robustpolish.implementation import emulated
    >>> lag = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    >>> discrete = emulated(lag, 0.1, "zoh")
    >>> round(float(discrete.A[0, 0]), 6), float(discrete.dt)
    (0.904837, 0.1)
    """
    period = positive("period", period, "s")
    kind = one_of("method", _SAME.get(method, method), METHODS)
    if prewarp_hz is not None:
        if kind != "tustin":
            raise invalid("prewarp_hz", prewarp_hz, "None for this method", "Use method='tustin'.")
        if positive("prewarp_hz", prewarp_hz, "Hz") * 2 * period >= 1:
            want = f"less than half the sample rate, {0.5 / period:.6g} Hz"
            raise invalid("prewarp_hz", prewarp_hz, want, "Sample faster or warp elsewhere.")
    controller = as_state_space("controller", controller)
    A, B, C, D = matrices_of(controller)
    found: Any = (A, B, C, D)
    if not A.size:
        pass
    elif kind in ("tustin", "forward", "backward"):
        found = integration_rule(A, B, C, D, period, kind, prewarp_hz)
    elif kind == "matched":
        found = _matched(controller, period)
    else:
        try:
            with np.errstate(all="ignore"):
                sampled: Any = signal.cont2discrete(found, period, method=kind)
            found = sampled[:4]
        except ValueError as error:
            remedy = "Use method='tustin'."
            raise invalid("method", method, f"one that suits it ({error})", remedy) from None
    if not all(np.isfinite(M).all() for M in found):
        shown = f"{kind} with a period of {period:.6g} s, which overflows"
        raise misfit("period", shown, "a shorter one", "Use method='tustin'.")
    return named_like(controller, found, period)


def integration_rule(
    A: Matrix, B: Matrix, C: Matrix, D: Matrix, period: float, kind: str,
    prewarp_hz: float | None = None,
) -> tuple[Any, Any, Any, Any]:  # fmt: skip
    """Replace s by a rule of integration that weighs the new sample with `alpha`."""
    if kind == "forward":
        return np.eye(len(A)) + period * A, period * B, C, D
    step = period
    if prewarp_hz is not None:
        half = math.pi * prewarp_hz * period
        step = period * math.tan(half) / half
    alpha = 1.0 if kind == "backward" else 0.5
    left = np.eye(len(A)) - alpha * step * A
    if A.size and np.linalg.cond(left) > 1e13:
        pole = 1 / (alpha * step)
        shown = f"a controller with a pole at {pole:.6g} rad/s and a period {period:.6g} s"
        remedy = "Change the period a little, or use method='zoh'."
        raise misfit("period", shown, "no pole where the rule of integration has one", remedy)
    Ad = np.linalg.solve(left, np.eye(len(A)) + (1 - alpha) * step * A)
    Bd = np.linalg.solve(left, step * B)
    Cd = np.linalg.solve(left.T, C.T).T
    return Ad, Bd, Cd, D + alpha * C @ Bd


def _matched(controller: control.StateSpace, period: float) -> tuple[Any, Any, Any, Any]:
    if (controller.ninputs, controller.noutputs) != (1, 1):
        shown = f"{controller.ninputs} measurements and {controller.noutputs} controls"
        remedy = "Use method='tustin', with prewarp_hz for one frequency."
        raise misfit("method", shown, "one of each for 'matched'", remedy)
    A, B, C, D = matrices_of(controller)
    poles, zeros, gain = np.linalg.eigvals(A), *_zeros_and_gain(A, B, C, float(D[0, 0]))
    with np.errstate(all="ignore"):
        # Near s = 0 a factor z - exp(r T) is (s - r) (exp(r T) - 1)/r, and T s for r = 0.
        slope = [
            np.where(r == 0, period, np.expm1(period * r) / np.where(r == 0, 1, r))
            for r in (poles, zeros)
        ]
        gain *= float(np.real(np.prod(slope[0]) / np.prod(slope[1])))
        # Polynomials in z - 1: in z those of slow roots would lose their digits.
        moved = np.expm1(period * zeros), np.expm1(period * poles)
        found = of_roots(*moved, gain, period, about=1.0)
    if not all(np.isfinite(M).all() for M in matrices_of(found)):
        return matrices_of(found)
    return matrices_of(realized(found, "modal"))


def _zeros_and_gain(A: Matrix, B: Matrix, C: Matrix, D: float) -> tuple[Any, float]:
    """Return the finite zeros of one channel, and D or its first Markov parameter C A^k B."""
    row, bound, rows, first = C, np.abs(C), np.zeros((0, len(A))), D
    while first == 0 and len(rows) < len(A):
        rows = np.vstack([rows, row / max(float(np.abs(row).max()), 1e-300)])
        first = float((row @ B)[0, 0])
        if abs(first) <= 1e-14 * float((bound @ np.abs(B))[0, 0]):  # nothing but rounding
            first = 0.0
        row, bound = row @ A, bound @ np.abs(A)
    if first == 0:
        return np.zeros(0), 0.0
    # y and its first derivatives stay zero on Z, with u = -(C A^k / first) x.
    Z = linalg.null_space(rows) if len(rows) else np.eye(len(A))
    return np.linalg.eigvals(Z.T @ (A - B @ row / first) @ Z), first
