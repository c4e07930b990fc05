"""The frequency response of a system, and the exact frequencies at which its gain has a level."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import control
import numpy as np
import scipy.linalg as sla
from scipy.optimize import brentq, minimize_scalar

from robustpolish.base.arrays import ROUNDING, AnyArray, AnyVector, Array, Matrix, Vector
from robustpolish.linear.arithmetic.exact import rescaled
from robustpolish.linear.norms.hinf import HinfNorm, cayley, frequency_grid, hinf_norm
from robustpolish.linear.stability import eigensystem
from robustpolish.linear.systems import (
    DelayedSystem,
    Realisation,
    hamiltonian,
    realisation,
    resolvent_response,
)

_BATCH = 1024
# Up to so many states an elimination at every frequency is quick.
_ELIMINATED_STATES = 24
# A crossing of the negative axis below 160 dB or above them is rounding of the response.
_SMALLEST_GAIN = 1e-8
_HALF_POWER = 1 / math.sqrt(2)
_PROVEN_STATES = 16
"""Largest number of states of a loop for which peaks are proven in exact arithmetic."""


@dataclass(frozen=True, eq=False)
class SystemResponse:
    """A system over frequency: its values, and points that show all of it.

    Frequencies are in rad/s; without a sampling time in rad per sample.

    Attributes
    ----------
    system : control.StateSpace
    others : ndarray of complex
        Further rates in rad/s that the points have to show, such as poles of the closed loop.
    """

    system: control.StateSpace
    others: AnyVector = field(default_factory=lambda: np.zeros(0, complex))

    @cached_property
    def complete_to(self) -> float:
        """Frequency in rad/s up to which all crossings are found: without delays everywhere."""
        return math.inf

    @cached_property
    def model(self) -> Realisation:
        """The system in scaled units."""
        model = realisation("system", self.system)
        return rescaled(model) if model.states else model

    @property
    def highest(self) -> float:
        """The Nyquist frequency in rad/s; infinite in continuous time."""
        return math.pi / self.model.step if self.model.discrete else math.inf

    def at(self, frequencies: Vector | float) -> AnyArray:
        """Return the response at frequencies, shape (frequencies, outputs, inputs).

        At a pole on the boundary of stability it is infinite; at infinity it is D.
        """
        omega, model = np.atleast_1d(np.asarray(frequencies, dtype=float)), self.model
        values = np.broadcast_to(model.D, (omega.size, *model.D.shape)).astype(complex)
        finite = np.flatnonzero(np.isfinite(omega)) if model.states else np.zeros(0, int)
        respond = self._eliminated if model.states <= _ELIMINATED_STATES else self._substituted
        for start in range(0, finite.size, _BATCH):
            part = finite[start : start + _BATCH]
            w: Any = omega[part]
            points = np.exp(1j * w * model.step) if model.discrete else 1j * w / model.time
            values[part] = respond(points)
        with np.errstate(invalid="ignore"):
            return values * model.gain

    def scalar(self, frequencies: Vector | float) -> AnyVector:
        """Return the response of a system of one input and one output."""
        return self.at(frequencies)[:, 0, 0]

    @cached_property
    def _triangular(self) -> tuple[AnyArray, AnyArray, AnyArray]:
        """A, B and C with a triangular A, for which a frequency costs no elimination."""
        model = self.model
        found: Any = sla.schur(model.A, output="complex")
        T, Q = found
        return np.asarray(T), np.asarray(Q.conj().T @ model.B), np.asarray(model.C @ Q)

    def _eliminated(self, s: AnyVector) -> AnyArray:
        """Return the response at every point by elimination, which respects small entries."""
        model = self.model
        return resolvent_response(model.A, model.B, model.C, model.D, s)

    def _substituted(self, s: AnyVector) -> AnyArray:
        """Return the same for many states, whose triangular form costs no elimination."""
        T, B, C = self._triangular
        n, m = B.shape
        inner = np.zeros((n, m * s.size), complex)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for i in reversed(range(n)):
                entry = (T[i, i + 1 :] @ inner[i + 1 :]).reshape(m, s.size) + B[i][:, None]
                inner[i] = (entry / (s - T[i, i])).ravel()
            values = np.moveaxis((C @ inner).reshape(-1, m, s.size), 2, 0)
        values[~np.isfinite(values).all(axis=(1, 2))] = np.inf
        return self.model.D + values

    def sizes(self, frequencies: Vector | float) -> Array:
        """Return the singular values at frequencies, largest first."""
        values = self.at(frequencies)
        if values.shape[1:] == (1, 1):
            return np.nan_to_num(np.abs(values[:, :, 0]), nan=np.inf, posinf=np.inf)
        known = np.isfinite(values).all(axis=(1, 2))
        found = np.full((len(values), min(self.model.D.shape)), np.inf)
        found[known] = np.linalg.svd(values[known], compute_uv=False)
        return found

    @cached_property
    def rates(self) -> AnyVector:
        """Poles and, with one input and output, zeros as complex rates in rad/s."""
        model = self.model
        if not model.states:
            return self.others
        found: Any = np.linalg.eigvals(model.A).astype(complex)
        if model.D.shape == (1, 1):
            found = np.concatenate([found, _zeros(model.A, model.B, model.C, model.D)])
        own = np.log(found[found != 0]) / model.step if model.discrete else found * model.time
        return np.concatenate([own, self.others])

    @cached_property
    def grid(self) -> Vector:
        """Frequencies from far below the slowest to far above the fastest rate."""
        grid = frequency_grid(self.rates, self.highest)
        return grid[np.isfinite(grid)]

    def level_crossings(self, level: float) -> list[float]:
        """Return all frequencies at which the largest singular value has a level.

        Those of the Hamiltonian matrix's eigenvalues that lie near the axis join the grid, so
        that a crossing cannot hide between its points; each is then solved for by bracketing.
        """

        def excess(omega: Vector | float) -> Vector:
            with np.errstate(divide="ignore"):
                return np.log(self.sizes(omega)[:, 0] / level)

        return roots(excess, [self.grid, self.level_hints(level)], self.highest)

    def gain_crossovers(self) -> list[tuple[float, float]]:
        """Return where the gain of a scalar response is 1, and its phase in rad there."""
        return [(w, float(np.angle(self.scalar(w)[0]))) for w in self.level_crossings(1.0)]

    def phase_crossovers(self) -> list[tuple[float, float]]:
        """Return where a scalar response is negative, both ends included, and -1 over its value."""
        found = [0.0, *self.phase_crossings()]
        if self.highest not in found:
            found.append(self.highest)
        crossings = []
        for omega in found:
            value: Any = self.scalar(omega)[0]
            real = float(value.real)
            beyond = not np.isfinite(value) or not _SMALLEST_GAIN < -real < 1 / _SMALLEST_GAIN
            if not beyond and abs(value.imag) <= 1e-6 * abs(real):
                crossings.append((omega, -1 / real))
        return crossings

    @property
    def stays_large(self) -> bool:
        """Whether the gain of a response stays at or above 1 for ever: no delay is bearable."""
        if self.model.discrete:
            return False
        return bool(np.abs(self._eigenvalues(math.inf)).max() >= 1 - 1e-12)

    def half_power(self) -> tuple[float, float]:
        """Return the frequency where the gain first rises through -3 dB, and where it falls last.

        Not a number if there is none; infinite if it stays above.
        """
        found = self.level_crossings(_HALF_POWER)
        last = max(found, default=1.0)
        ends = [0.0, *found, self.highest if math.isfinite(self.highest) else 3 * last]
        middles = np.array([(low + high) / 2 for low, high in itertools.pairwise(ends)])
        above = self.sizes(middles)[:, 0] > _HALF_POWER
        rising = [found[i] for i in np.flatnonzero(above[1:] & ~above[:-1])]
        falling = math.inf if above[-1] else max(found, default=math.nan)
        return min(rising, default=math.nan), falling

    @property
    def unstable_poles(self) -> int:
        """Number of poles beyond the boundary of stability, but for rounding."""
        spectrum = eigensystem(self.model.A)
        poles = spectrum.values
        beyond = np.abs(poles) - 1 if self.model.discrete else poles.real
        return int((beyond > spectrum.errors).sum())

    def peak(self) -> HinfNorm:
        """Return the H-infinity norm, proven in exact arithmetic if that is affordable."""
        return norm_of(self.system)

    def _eigenvalues(self, omega: Vector | float) -> AnyArray:
        """Return the eigenvalues of a square response, largest first."""
        values = self.at(omega)
        values[~np.isfinite(values).all(axis=(1, 2))] = 1e300
        return _eigenvalues(values)

    def common_delay(self) -> float:
        """Return the smallest delay in s at all signals of a loop that makes it unstable.

        A pole is on the boundary if an eigenvalue of L, turned by the delay, is -1: the frequencies
        at which one has size 1 are found by bracketing among points that are dense at resonances.
        """
        if self.stays_large:
            return 0.0
        points = [self.grid, self.level_hints(1.0)]
        least = math.inf
        for rank in range(self.system.ninputs or 0):

            def excess(omega: Vector | float, rank: int = rank) -> Vector:
                with np.errstate(divide="ignore"):
                    return np.log(np.abs(self._eigenvalues(omega)[:, rank]))

            for omega in roots(excess, points, self.highest):
                found = self._eigenvalues(omega)[0]
                crossing = found[np.abs(np.abs(found) - 1) < 1e-6]
                least = min(least, float(lag(np.angle(crossing)).min(initial=math.inf)) / omega)
        return least

    def phase_crossings(self) -> list[float]:
        """Return all frequencies above 0 at which a scalar response is real and negative."""

        def sine(omega: Vector | float) -> Vector:
            values: Any = self.scalar(omega)
            with np.errstate(invalid="ignore"):
                return np.nan_to_num(np.where(np.isfinite(values), values.imag / abs(values), 0))

        found = roots(sine, [self.grid, self._phase_hints()], self.highest)
        # The sign also changes where a pole or zero on the axis turns the phase.
        return [w for w in found if abs(sine(w)[0]) < 1e-6 and self.scalar(w)[0].real < 0]

    @cached_property
    def _continuous(self) -> Realisation | None:
        """The system by z = (1 + s)/(1 - s); None without states or with a pole at z = -1."""
        try:
            model = cayley(self.model)
        except (np.linalg.LinAlgError, ValueError, RuntimeWarning):
            return None
        return model if model.states and np.isfinite(model.A).all() else None

    def _back(self, values: Any) -> Vector:
        """Return the rad/s of eigenvalues in scaled units, by height and by size."""
        heights: Any = np.concatenate([np.abs(values.imag), np.abs(values)])
        heights = heights[np.isfinite(heights) & (heights > 0)]
        if self.model.discrete:
            return 2 * np.arctan(heights) / self.model.step
        return heights * self.model.time

    def level_hints(self, level: float) -> Vector:
        """Return the frequencies at which a singular value may have a level."""
        model = self._continuous
        # Where the level is that of D, it is moved a little: crossings are looked for beside it.
        for shift in (1.0, 1 + 1e-7):
            H = None if model is None else hamiltonian(model, level / self.model.gain * shift)
            if H is not None and np.isfinite(H).all():
                return self._back(np.linalg.eigvals(H).astype(complex))
        return np.zeros(0)

    def _phase_hints(self) -> Vector:
        """Return where L(s) - L(-s), which is twice the imaginary part, has its zeros."""
        model = self._continuous
        if model is None:
            return np.zeros(0)
        A: Any = sla.block_diag(model.A, -model.A)
        B, C = np.vstack([model.B, model.B]), np.hstack([model.C, model.C])
        return self._back(_zeros(A, B, C, np.zeros((1, 1))))


def norm_of(system: control.StateSpace) -> HinfNorm:
    """Return the H-infinity norm, proven in exact arithmetic if that is affordable."""
    return hinf_norm(system, exact=(system.nstates or 0) <= _PROVEN_STATES)


def lag(angle: Any) -> Any:
    """Return the turn in rad, from 0 to 2 pi, that brings a phase to -180 degrees."""
    return (angle + math.pi) % (2 * math.pi)


def _eigenvalues(values: AnyArray) -> AnyArray:
    """Return the eigenvalues of square matrices, largest first."""
    found = np.linalg.eigvals(values)
    return np.take_along_axis(found, np.argsort(-np.abs(found), axis=1), axis=1)


def roots(
    function: Callable[[Any], Vector], points: list[Vector], highest: float = math.inf
) -> list[float]:
    """Return where a function of frequency changes its sign, or just touches zero.

    Parameters
    ----------
    function : callable
        Takes frequencies in rad/s; what is below 1e-12 in size counts as zero.
    points : list of ndarray
        Where to look; the middles between them are looked at besides.
    highest : float, optional
        No point lies above it.

    Returns
    -------
    list of float
        Rising.
    """
    looked = np.concatenate(points)
    looked = looked[(looked > 0) & (looked <= highest)]
    if not looked.size:
        looked = np.ones(1)
    # A root at the outermost point needs a neighbour on either side.
    outer = [looked.min() / 10, min(10 * looked.max(), highest)]
    looked = np.unique(np.concatenate([looked, outer]))
    looked = looked[looked <= highest]
    omega = np.unique(np.concatenate([looked, np.sqrt(looked[1:]) * np.sqrt(looked[:-1])]))
    values = function(omega)
    # A logarithm of a gain, or a sine of a phase, that is rounding.
    flat = np.abs(values) <= ROUNDING
    if flat.all():  # zero everywhere
        return [float(omega[0]), float(omega[-1])]

    def one(w: float) -> float:
        return float(np.clip(function(w)[0], -1e300, 1e300))

    found: list[float] = []
    for i, j in itertools.pairwise(np.flatnonzero(~flat & ~np.isnan(values))):
        low, high = float(omega[i]), float(omega[j])
        if (values[i] > 0) != (values[j] > 0):
            ends = one(low), one(high)
            if (ends[0] > 0) == (ends[1] > 0):  # rounding decides the sign at one end: it is there
                found.append(low if abs(ends[0]) < abs(ends[1]) else high)
                continue
            root: Any = brentq(one, low, high, xtol=1e-15 * high, rtol=np.float64(1e-14))
            found.append(float(root))
        elif j > i + 1:  # it only touches, or stays at, zero
            found += sorted({float(omega[i + 1]), float(omega[j - 1])})
    return found


def _zeros(A: Array, B: Array, C: Array, D: Array) -> AnyVector:
    """Return the finite zeros of a system of one input and one output."""
    M = np.block([[A, B], [C, D]])
    N = np.diag(np.arange(len(M)) < len(A)).astype(float)
    with np.errstate(divide="ignore", invalid="ignore"):
        zeros = np.asarray(sla.eigvals(M, N))
    size = max(float(np.linalg.norm(A)), 1e-300)
    return zeros[np.isfinite(zeros) & (np.abs(zeros) < 1e6 * size)]


Matrices = tuple[Matrix, Matrix, Matrix, Matrix]
"""A, B, C and D."""

# A loop opened or closed anywhere, and with the delays of its plant as they are over frequency.

_POINTS_PER_TURN = 8
"""So many points show every turn of the delays' phase."""
_MOST_POINTS, _LEAST_POINTS = 4000, 64
_FAINT = 1e-3
"""Above the last frequency with this gain no turn is followed: it is 60 dB from any margin."""
_CANDIDATES = 5
"""Highest points of a grid that are climbed to their tops."""


class Ports(NamedTuple):
    """Where signals enter and leave a loop: q = back o + entry w, z = out o + through q.

    q = (u, y) are the inputs of plant and controller, o = (K y, G u) their outputs.
    """

    back: Matrix
    entry: Matrix
    out: Matrix
    through: Matrix

    @classmethod
    def closed(
        cls, size: int, inputs: Sequence[int], outputs: Sequence[int], weight: float = 1.0,
        less: float = 0.0,
    ) -> Ports:  # fmt: skip
        """Return those of weight * S - less * 1 with everything closed, where q - o = w."""
        one = np.eye(size)
        return cls(one, one[:, inputs], less * one[outputs], (weight - less) * one[outputs])

    @classmethod
    def opened(cls, size: int, broken: Sequence[int]) -> Ports:
        """Return those of L at some signals, the rest closed."""
        one = np.eye(size)
        back = one.copy()
        back[broken] = 0.0
        return cls(back, one[:, broken], -one[broken], np.zeros((len(broken), size)))


def connected(plant: Matrices, controller: Matrices, ports: Ports, delayed: int = 0) -> Matrices:
    """Return A, B, C, D from (w, d) to (z, v), the states of the plant first.

    Parameters
    ----------
    plant : tuple of ndarray
        A, B, C, D from (u, d) to (y, v).
    controller : tuple of ndarray
        A, B, C, D of K.
    ports : Ports
    delayed : int, optional
        Number of signals d and v.
    """
    (A, B, C, D), (Ak, Bk, Ck, Dk), k = plant, controller, delayed
    nu, ny, n, m = len(Ck), Bk.shape[1], len(A), len(Ak)
    # Inputs (u, y, d), outputs (K y, G u, v).
    into = np.zeros((n + m, nu + ny + k))
    into[:n, :nu], into[:n, nu + ny :], into[n:, nu : nu + ny] = B[:, :nu], B[:, nu:], Bk
    seen, through = np.zeros((nu + ny + k, n + m)), np.zeros((nu + ny + k, nu + ny + k))
    seen[:nu, n:], seen[nu:, :n], through[:nu, nu : nu + ny] = Ck, C, Dk
    through[nu:, :nu], through[nu:, nu + ny :] = D[:, :nu], D[:, nu:]
    one, none = np.eye(k), np.zeros((k, k))
    F, E, P, R = (
        np.asarray(sla.block_diag(own, beside)) if k else np.ascontiguousarray(own)
        for own, beside in zip(ports, (none, one, one, none), strict=True)
    )
    both = np.linalg.solve(np.eye(len(F)) - F @ through, np.hstack([F @ seen, E]))
    on_x, on_w = both[:, : n + m], both[:, n + m :]
    inner = P @ through + R
    whole = np.zeros((n + m, n + m))
    whole[:n, :n], whole[n:, n:] = A, Ak
    return whole + into @ on_x, into @ on_w, P @ seen + inner @ on_x, inner @ on_w


def line_values(G: AnyArray, K: AnyArray, ports: Ports) -> AnyArray:
    """Return a loop from w to z, frequency by frequency.

    Parameters
    ----------
    G, K : ndarray of complex, shapes (k, ny, nu) and (k, nu, ny)
    ports : Ports

    Returns
    -------
    ndarray of complex, shape (k, z, w)
    """
    nu, size = K.shape[1], len(ports.back)
    loop = np.zeros((len(G), size, size), dtype=complex)
    loop[:, :nu, nu:], loop[:, nu:, :nu] = K, G
    entry = np.broadcast_to(ports.entry, (len(G), *ports.entry.shape))
    q = np.linalg.solve(np.eye(size) - ports.back @ loop, entry)
    return (ports.out @ loop + ports.through) @ q


@dataclass(frozen=True, eq=False)
class DelayedLoop:
    """Plant and controller over frequency, exp(-s tau) for every delay.

    Attributes
    ----------
    plant : DelayedSystem
        From u to y.
    controller : tuple of ndarray
        A, B, C and D of K.
    """

    plant: DelayedSystem
    controller: Matrices

    @property
    def seconds(self) -> float:
        """All delays together, which is the most that a signal can meet."""
        return float(sum(line.seconds for line in self.plant.lines))

    def values(self, ports: Ports, omega: Vector) -> AnyArray:
        """Return the loop from w to z at frequencies in rad/s."""
        omega = np.atleast_1d(omega)
        K = resolvent_response(*self.controller, 1j * omega)
        return line_values(self.plant.response(omega), K, ports)


@dataclass(frozen=True, eq=False)
class DelayedResponse(SystemResponse):
    """A response whose values are those of exact delays, its Pade model showing where to look.

    Attributes
    ----------
    exact : callable
        Values at frequencies above 0 in rad/s.
    seconds : float
        Delay that turns the phase.
    """

    exact: Callable[[Vector], AnyArray] = field(kw_only=True)
    seconds: float = field(kw_only=True)

    def at(self, frequencies: Vector | float) -> AnyArray:
        """Return the response; at 0 and at infinity that of the Pade model, which is right there.

        At infinity its size is meant, of which the delays are no part.
        """
        omega = np.atleast_1d(np.asarray(frequencies, dtype=float))
        inside = (omega > 0) & np.isfinite(omega)
        values = np.empty((omega.size, *self.model.D.shape), dtype=complex)
        if not inside.all():
            values[~inside] = super().at(omega[~inside])
        if inside.any():
            values[inside] = self.exact(omega[inside])
        return values

    @cached_property
    def grid(self) -> Vector:
        """The points of the Pade model, and enough to follow every turn of the phase."""
        base, step = super().grid, 2 * math.pi / _POINTS_PER_TURN / self.seconds
        turns: Vector = np.arange(step, self.complete_to + step / 2, step, dtype=float)
        return np.unique(np.concatenate([base, turns])) if base.size else base

    @cached_property
    def complete_to(self) -> float:
        """Frequency in rad/s up to which every turn of the phase is followed."""
        base, step = super().grid, 2 * math.pi / _POINTS_PER_TURN / self.seconds
        strong = base[self.sizes(base)[:, 0] > _FAINT]
        top = float(strong.max(initial=0.0))
        # The points of the model may end, or be far apart, where the gain is not yet faint.
        while 0 < top < step * _MOST_POINTS and self.sizes(top)[0, 0] > _FAINT:
            top *= 2
        return step * float(np.clip(math.ceil(top / step), _LEAST_POINTS, _MOST_POINTS))

    def phase_crossings(self) -> list[float]:
        """Return the frequencies up to `complete_to` at which a response is real and negative."""
        return [w for w in super().phase_crossings() if w <= self.complete_to]

    def peak(self) -> HinfNorm:
        """Return the largest singular value: points, and the tops beside the highest of them."""
        omega = np.concatenate([[0.0], self.grid, [math.inf]])
        sizes = self.sizes(omega)[:, 0]
        best = int(np.argmax(sizes))
        top, where = float(sizes[best]), float(omega[best])
        for i in np.argsort(-sizes[1:-1])[:_CANDIDATES] + 1:
            low, high = omega[max(i - 1, 0)], omega[min(i + 1, len(omega) - 2)]
            found: Any = minimize_scalar(
                lambda w: -self.sizes(w)[0, 0], bounds=(low, high), method="bounded",
                options={"xatol": 1e-10 * high},
            )  # fmt: skip
            if -found.fun > top:
                top, where = float(-found.fun), float(found.x)
        reason = "with exact delays, over frequency: no proof"
        return HinfNorm(top, where, top, math.inf, True, reason)


# A measured response: known at lines, with straight strokes between them.

_NEAR_AXIS = math.radians(10)
"""At the first and last line a phase this near to -180 degrees counts as a crossing: to be safe."""
_FAR = 1e3
"""Unless that lies 60 dB from any margin."""
_ONLY_LINES = "the largest of the measured lines: no proof between them"


@dataclass(frozen=True, eq=False)
class LineResponse:
    """A frequency response at measured lines, asked as :class:`SystemResponse` is.

    Attributes
    ----------
    system : control.FrequencyResponseData
    unstable_poles : int
        As they were told.
    """

    system: control.FrequencyResponseData
    unstable_poles: int = 0
    stays_large = False
    complete_to = math.inf

    @property
    def omega(self) -> Vector:
        """The lines in rad/s."""
        return np.asarray(self.system.omega)

    @property
    def values(self) -> AnyArray:
        """The response, line by line."""
        return np.moveaxis(np.asarray(self.system.frdata), 2, 0)

    def at(self, _: Vector) -> AnyArray:
        """Return the response at its lines: elsewhere it is not known."""
        return self.values

    def sizes(self, _: Vector | None = None) -> Array:
        """Return the singular values at the lines, largest first."""
        return np.linalg.svd(self.values, compute_uv=False)

    def peak(self) -> HinfNorm:
        """Return the largest singular value of all lines."""
        sizes = self.sizes()[:, 0]
        i = int(np.argmax(sizes))
        value = float(sizes[i])
        return HinfNorm(value, float(self.omega[i]), value, math.inf, True, _ONLY_LINES)

    def level_crossings(self, level: float) -> list[float]:
        """Return where the largest singular value passes a level."""
        return [omega for omega, _, _ in self._sign_changes(np.log(self.sizes()[:, 0] / level))]

    def half_power(self) -> tuple[float, float]:
        """Return where the gain first rises through -3 dB, and where it falls last; or nan."""
        sizes = self.sizes()[:, 0]
        found = self._sign_changes(np.log(sizes / _HALF_POWER))
        rising = [omega for omega, _, i in found if sizes[i] < _HALF_POWER]
        falling = [omega for omega, _, i in found if sizes[i] >= _HALF_POWER]
        if sizes[-1] > _HALF_POWER:
            falling = []
        return min(rising, default=math.nan), max(falling, default=math.nan)

    def gain_crossovers(self, values: AnyVector | None = None) -> list[tuple[float, float]]:
        """Return where a scalar response has size 1, and its phase in rad there."""
        L: Any = self.values[:, 0, 0] if values is None else values
        return [
            (omega, float(np.angle(L[i])) + share * float(np.angle(L[i + 1] / L[i])))
            for omega, share, i in self._sign_changes(np.log(np.abs(L)))
        ]

    def phase_crossovers(self) -> list[tuple[float, float]]:
        """Return where the phase passes -180 degrees by the shorter way, and one over the size."""
        L: Any = self.values[:, 0, 0]
        away = np.angle(-L)
        near = np.abs(np.diff(away)) < math.pi
        found = [
            (omega, 1 / float(np.abs(L[i]) * np.abs(L[i + 1] / L[i]) ** share))
            for omega, share, i in self._sign_changes(away)
            if near[i]
        ]
        # At rest, or for ever above, L may be on the axis, where no line can lie.
        found += [
            (float(self.omega[i]), float(1 / abs(L[i])))
            for i in (0, -1)
            if abs(away[i]) < _NEAR_AXIS and 1 / _FAR < abs(L[i]) < _FAR
        ]
        return sorted(found)

    def common_delay(self) -> float:
        """Return the smallest delay at all signals that turns an eigenvalue of L to -1."""
        found = [c for one in _eigenvalues(self.values).T for c in self.gain_crossovers(one)]
        return min((lag(angle) / omega for omega, angle in found), default=math.inf)

    def _sign_changes(self, values: Vector) -> list[tuple[float, float, int]]:
        """Return where a value changes its sign: frequency, share of the step, the line before.

        Between two lines it is a straight line over octaves.
        """
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            shares = values[:-1] / (values[:-1] - values[1:])
            between = self.omega[:-1] * (self.omega[1:] / self.omega[:-1]) ** shares
        changes = ((values[:-1] > 0) != (values[1:] > 0)) & np.isfinite(shares)
        return [(float(between[i]), float(shares[i]), int(i)) for i in np.flatnonzero(changes)]
