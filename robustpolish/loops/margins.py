"""How much gain, phase and delay a loop bears: one signal at a time, and all at once."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import control
import numpy as np
from matplotlib.axes import Axes
from scipy.optimize import minimize

from robustpolish.base.arrays import SAME, AnyMatrix, Vector
from robustpolish.base.results import Card, Displayed, Table, quantities
from robustpolish.linear.arithmetic.exact import rescaled
from robustpolish.linear.norms.hinf import cayley
from robustpolish.linear.stability import eigensystem
from robustpolish.linear.systems import Realisation, hamiltonian, realisation, resolvent_response
from robustpolish.loops.disk_margins import DelayedIntervals, DiskMargin, decibel, disk_of
from robustpolish.loops.loop import Loop, MeasuredLoop, Place
from robustpolish.loops.pictures import plot_loops
from robustpolish.loops.response import LineResponse, Ports, lag
from robustpolish.robust.scalings import balanced

# The peak of a response under diagonal uncertainty: an upper bound that holds between all points.
#
# For every frequency there are scales D of the signals for which the largest singular value of
# D M D^-1 is least (an upper bound of the structured singular value). Scales that are best at one
# frequency are good around it; how far, tell the eigenvalues of a Hamiltonian matrix. Such
# intervals are laid until they cover the axis.

_PEAK_SLACK = 1e-3
MOST_INTERVALS = 400
# Powers of the smooth stand-in of the largest singular value: rough, then sharp.
_POWERS = (4, 32)
# Where one signal does not act back on another, their scales drift apart for ever.
_LARGEST_LOG = 25.0


@dataclass(frozen=True)
class ScaledPeak:
    """Bounds of the structured peak, in the units of the continuous frequency it was sought over.

    Attributes
    ----------
    upper : float
        No frequency has a larger scaled gain.
    lower : float
        The largest scaled gain that was met.
    frequency : float
        Where it was met.
    covered : bool
        Whether intervals cover the axis; otherwise `upper` holds only where it was looked.
    """

    upper: float
    lower: float
    frequency: float
    covered: bool


def best_scales(M: AnyMatrix) -> tuple[float, Vector]:
    """Return the least largest singular value of D M D^-1 and the diagonal of D.

    Parameters
    ----------
    M : ndarray of complex, shape (k, k)

    Returns
    -------
    value : float
        An upper bound of the structured singular value for k complex numbers, equal to it up
        to k = 3 [1]_.
    scales : ndarray, shape (k,)

    References
    ----------
    .. [1] A. Packard, J. Doyle, "The complex structured singular value", Automatica 29 (1993)
       71-109, sections 8 and 9.

    Examples
    --------
    >>> import numpy as np
    >>> from robustpolish.loops.margins import best_scales
    >>> round(best_scales(np.array([[1.0, 100.0], [0.0, 1.0]]))[0], 2)
    1.0
    """
    k = M.shape[0]
    if k == 2:
        return _best_of_two(M)
    logs = np.log(balanced(np.abs(M))) if np.isfinite(M).all() else np.zeros(k)
    best = (_largest(M, logs), logs)
    size = best[0]
    if k == 1 or size == 0 or not math.isfinite(size):
        return size, np.exp(logs)
    for power in _POWERS:
        smooth = _smooth(M / size, power)
        found = minimize(
            smooth,
            np.clip(best[1], -_LARGEST_LOG, _LARGEST_LOG),
            jac=True,
            method="L-BFGS-B",
            bounds=[(-_LARGEST_LOG, _LARGEST_LOG)] * k,
            options={"maxiter": 60},
        )
        value = _largest(M, found.x)
        if value < best[0]:
            best = (value, found.x)
    return best[0], np.exp(best[1])


def scaled_peak(
    size: float,
    response: Callable[[float], AnyMatrix],
    seeds: Vector,
    around: Callable[[float, Vector, float], tuple[float, float]],
    most: int = MOST_INTERVALS,
) -> ScaledPeak:
    """Bound the structured peak of a stable continuous system over all frequencies.

    Parameters
    ----------
    size : float
        A frequency near the fastest of the system.
    response : callable
        Its value at a frequency, infinity included.
    seeds : ndarray
        Frequencies that are likely to be the worst.
    around : callable
        Takes a frequency, scales and a level, and returns the ends of an interval around the
        frequency in which the scaled response stays below the level, as :func:`interval` does.
    most : int, optional
        So many intervals are laid at most.

    Returns
    -------
    ScaledPeak
    """
    looked = {omega: best_scales(response(omega)) for omega in [0.0, math.inf, *seeds]}
    frequency = max(looked, key=lambda omega: looked[omega][0])
    lower = looked[frequency][0]
    if lower == 0:
        return ScaledPeak(0.0, 0.0, frequency, True)
    bare, covered = [(0.0, math.inf)], True
    for _ in range(most):
        if not bare:
            return ScaledPeak(lower * (1 + _PEAK_SLACK), lower, frequency, covered)
        low, high = bare.pop()
        omega = _inside(low, high, size)
        value, scales = looked.get(omega) or best_scales(response(omega))
        if value > lower:
            lower, frequency = value, omega
        first, last = around(omega, scales, lower * (1 + _PEAK_SLACK))
        if math.isinf(first):  # nothing is known of the end of the axis
            # An interval this narrow, relative to its frequency, proves nothing.
            covered, first = False, size / SAME
        elif last - first <= SAME * omega:
            covered = covered and omega in (0.0, math.inf)
            last = max(omega * (1 + SAME), SAME * size)
            first = min(omega * (1 - SAME), size / SAME)
        if first > low:
            bare.append((low, first))
        if last < high:
            bare.append((last, high))
    return ScaledPeak(lower * (1 + _PEAK_SLACK), lower, frequency, False)


def interval(model: Realisation, omega: float, scales: Vector, level: float) -> tuple[float, float]:
    """Return the frequencies around `omega` at which D M D^-1 stays below a level.

    Parameters
    ----------
    model : Realisation
    omega : float
        A frequency at which it does.
    scales : ndarray
        Diagonal of D.
    level : float

    Returns
    -------
    first, last : float
        Ends of the interval: no eigenvalue of the Hamiltonian matrix lies between them on the
        axis, nor so near to it that rounding could hide it there.
    """
    if not model.states:
        return 0.0, math.inf
    scaled = replace(
        model, B=model.B / scales, C=model.C * scales[:, None], D=model.D * scales[:, None] / scales
    )
    H = hamiltonian(scaled, level)
    if H is None or not np.isfinite(H).all():
        return omega, omega
    spectrum = eigensystem(H)
    values = spectrum.values
    near = np.abs(values.real) <= spectrum.errors
    heights = np.abs(values.imag[near])
    below, above = heights[heights <= omega], heights[heights >= omega]
    return float(below.max(initial=0.0)), float(above.min(initial=math.inf))


def _inside(low: float, high: float, size: float) -> float:
    """Return a frequency between two others: the ends of the axis first."""
    if low == 0 and high == math.inf:
        return 0.0
    if high == math.inf:
        return math.inf
    if low == 0:
        return 0.0 if high > SAME * size else high / 2
    return math.sqrt(low) * math.sqrt(high)


def _largest(M: AnyMatrix, logs: Vector) -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = M * np.exp(logs[:, None] - logs)
    return float(np.linalg.norm(scaled, 2)) if np.isfinite(scaled).all() else math.inf


def _best_of_two(M: AnyMatrix) -> tuple[float, Vector]:
    """Return the same for two signals, whose best scales even out the entries off the diagonal.

    Scales change neither the determinant nor the diagonal, so that the largest singular value is
    least where the sum of all squares is.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.log(np.abs([M[0, 1], M[1, 0]]))
        log = np.clip((off[0] - off[1]) / 2, -_LARGEST_LOG, _LARGEST_LOG)
    logs = np.array([0.0, log if math.isfinite(log) else 0.0])
    return _largest(M, logs), np.exp(logs)


def _smooth(M: AnyMatrix, power: int) -> Callable[[Vector], tuple[float, Vector]]:
    """Return the logarithm of the sum of powers of the singular values, and its slope."""

    def value(logs: Vector) -> tuple[float, Vector]:
        U, sizes, V = np.linalg.svd(M * np.exp(logs[:, None] - logs))
        largest = sizes[0]
        shares = (sizes / largest) ** (2 * power)
        total = shares.sum()
        slope = (np.abs(U) ** 2 - np.abs(V.conj().T) ** 2) @ (shares / total)
        return math.log(largest) + math.log(total) / (2 * power), slope

    return value


# The margins of several loops at once: every signal of a place changed in any combination.

Where = Literal["inputs", "outputs", "inputs and outputs"]
_MOST_STEPS = 300
# With delays an interval is as wide as a slope allows, where states alone have eigenvalues for it.
_MOST_DELAYED = 1000
_SHARES_OF_SCALES = (1.0, 0.6, 0.2)
# What the bound of delays may lose: intervals of constant scales get long enough.
_SLACK = 1e-2
# A loop that is not small this far above its poles counts as large for ever.
_FARTHEST = 1e15


@dataclass(frozen=True)
class MarginsAtOnce:
    """What several loops bear together, each changed by a factor or delay of its own.

    Attributes
    ----------
    where : {"inputs", "outputs", "inputs and outputs"}
        Of the plant.
    signals : tuple of str
        The signals that change.
    disk : DiskMargin
        A factor from the disk at every signal, in any combination.
    common_delay_s : float
        Smallest delay in s that makes the loop unstable if all signals of the place have it; nan
        for inputs and outputs together.
    any_delay_s : float
        Delays up to this, in s, in any combination leave the loop stable: a lower bound, which
        takes the worst complex change in place of a delay.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> A, C = [[0, 10], [-10, 0]], [[1, 10], [-10, 1]]
    >>> satellite = control.ss(A, [[1, 0], [0, 1]], C, 0)
    >>> at_once = rp.loop_analysis(satellite, [[-1, 0], [0, -1]]).at_once["inputs"]
    >>> round(at_once.disk.alpha, 3), at_once.disk.proven
    (0.1, True)
    """

    where: Where
    signals: tuple[str, ...]
    disk: DiskMargin
    common_delay_s: float
    any_delay_s: float


def simultaneous_margins(loop: Loop | MeasuredLoop, where: Where) -> MarginsAtOnce:
    """Return what a stable loop bears at all inputs, all outputs, or all of both."""
    place: Place | None = {"inputs": "input", "outputs": "output"}.get(where)  # type: ignore
    if place is None:
        at, common = [*loop.at("input"), *loop.at("output")], math.nan
    else:
        at, common = loop.at(place), loop.response(place).common_delay()
    names = tuple(loop.signals[i] for i in at)
    if isinstance(loop, MeasuredLoop):
        disk, delay = _bounds_of_lines(loop, at, place, common)
    else:
        disk, delay = _bounds(loop, at, place)
    return MarginsAtOnce(where, names, disk, common, delay)


def _bounds(loop: Loop, at: list[int], place: Place | None) -> tuple[DiskMargin, float]:
    """Return the disk of several signals, and a delay in any combination, both proven."""
    size = len(loop.signals)
    balanced = _axis(loop, loop.around(at, 2.0, 1.0), Ports.closed(size, at, at, 2.0, 1.0))
    if len(at) == 1:  # no scales to choose
        disk = disk_of(loop.balanced_peak(at))
    else:
        peak = scaled_peak(
            balanced.size, balanced.response, balanced.seeds(), balanced.around, balanced.most
        )
        alpha = 2 / peak.upper if peak.upper else math.inf
        hertz = float(balanced.omega(peak.frequency) / (2 * math.pi))
        disk = DiskMargin(alpha, hertz, peak.covered)
    opened = _axis(loop, loop.opened(place), Ports.opened(size, loop.broken(place)))
    return disk, any_delay(balanced, opened, disk.alpha)


def _bounds_of_lines(
    loop: MeasuredLoop, at: list[int], place: Place | None, common: float
) -> tuple[DiskMargin, float]:
    """Return the same as far as the lines of a measured loop tell."""

    def scaled_sizes(response: control.FrequencyResponseData) -> Vector:
        return np.array([best_scales(value)[0] for value in LineResponse(response).values])

    omega = loop.omega
    sizes = scaled_sizes(loop.around(at, 2.0, 1.0))
    worst = int(np.argmax(sizes))
    alpha = 2 / float(sizes[worst]) if sizes[worst] else math.inf
    disk = DiskMargin(alpha, float(omega[worst] / (2 * math.pi)), False)
    large = np.flatnonzero(scaled_sizes(loop.opened(place)) >= 1)
    last = int(large[-1]) + 1 if large.size else 0
    # Each line speaks for the stretch up to the next, where the same delay turns further.
    ends = np.append(omega[1:], omega[-1])[:last]
    delays = 2 * np.arctan2(1.0, sizes[:last]) / ends
    return disk, float(np.nanmin([*delays, common, math.inf]))


@dataclass(frozen=True, eq=False)
class _Axis:
    """A system over the continuous frequency x, of which rad/s is a function."""

    model: Realisation
    discrete: bool
    step: float
    most = MOST_INTERVALS

    @classmethod
    def of(cls, system: control.StateSpace) -> _Axis:
        model = realisation("system", system)
        model = rescaled(model) if model.states else model
        image, gain = cayley(model), model.gain
        image = Realisation(
            image.A, image.B * gain, image.C, image.D * gain, False, 1.0, model.time, 1.0
        )
        return cls(image, model.discrete, model.step)

    def omega(self, x: float) -> float:
        """Return the frequency in rad/s."""
        return 2 * math.atan(x) / self.step if self.discrete else x * self.model.time

    def x(self, omega: float) -> float:
        """Return the frequency of the model."""
        if not self.discrete:
            return omega / self.model.time
        angle = omega * self.step / 2
        return math.tan(angle) if angle < math.pi / 2 * (1 - 1e-15) else math.inf

    def response(self, x: float) -> AnyMatrix:
        own = self.model
        if not math.isfinite(x):
            return own.D.astype(complex)
        return resolvent_response(own.A, own.B, own.C, own.D, np.array([1j * x]))[0]

    @property
    def size(self) -> float:
        """A frequency near the fastest of the model."""
        return float(np.linalg.norm(self.model.A)) or 1.0

    def around(self, x: float, scales: Vector, level: float) -> tuple[float, float]:
        """Return the frequencies around one at which the scaled response is below a level."""
        return interval(self.model, x, scales, level)

    def seeds(self) -> Vector:
        """Return the frequencies of the poles."""
        poles: Any = np.linalg.eigvals(self.model.A) if self.model.states else np.zeros(0)
        return np.unique(np.round(np.abs(poles), 12))


@dataclass(frozen=True, eq=False)
class _DelayedAxis(_Axis):
    """The same with exact delays; the model shows where to look."""

    exact: DelayedIntervals
    most = _MOST_DELAYED

    def response(self, x: float) -> AnyMatrix:
        if not math.isfinite(x):
            return super().response(x)
        return self.exact.response(self.omega(x))

    def around(self, x: float, scales: Vector, level: float) -> tuple[float, float]:
        # Scales that are best by a hair may be far apart, and the slope then large: less will do.
        found = [
            self.exact.around(self.omega(x), scales**share, level)
            for share in _SHARES_OF_SCALES[: 1 if len(scales) == 1 else None]
        ]
        return self.x(min(one[0] for one in found)), self.x(max(one[1] for one in found))


def _axis(loop: Loop, system: control.StateSpace, ports: Ports) -> _Axis:
    own = _Axis.of(system)
    if loop.delayed is None:
        return own
    exact = DelayedIntervals.of_loop(loop.delayed, ports)
    return _DelayedAxis(own.model, own.discrete, own.step, exact)


def any_delay(balanced: _Axis, opened: _Axis, alpha: float) -> float:
    """Return a delay in s up to which delays in any combination leave the loop stable.

    A delay turns the phase by omega tau, and the balanced disk of size alpha holds all turns up
    to 2 atan(alpha / 2). Above the frequency from which on L is small, any turn will do.
    """
    top = _highest_large_gain_frequency(opened)
    if top in (0.0, math.inf):
        return math.inf if top == 0.0 else 0.0
    least, end = math.inf, top
    for _ in range(_MOST_STEPS):
        if 2 * math.atan(alpha / 2) / end >= least:
            return least
        x = balanced.x(end)
        value, scales = best_scales(balanced.response(x))
        level = value * (1 + _SLACK)
        least = min(least, 2 * math.atan(1 / level) / end)
        first = balanced.omega(balanced.around(x, scales, level)[0])
        end = min(first, end * (1 - 1e-6))
        if end <= 0:
            return least
    return min(least, 2 * math.atan(alpha / 2) / top)


def _highest_large_gain_frequency(opened: _Axis) -> float:
    """Return the frequency in rad/s above which no change of phases matters, L being small."""
    fastest = float(opened.seeds().max(initial=0.0))
    end = fastest or 1.0
    while True:  # out to where the loop is small and stays so
        value, scales = best_scales(opened.response(end))
        if value < 1 and opened.around(end, scales, 1.0)[1] == math.inf:
            break
        if end > _FARTHEST * (fastest or 1.0):
            return opened.omega(math.inf)
        end *= 10
    for _ in range(_MOST_STEPS):
        value, scales = best_scales(opened.response(end * (1 - 1e-4)))
        if value >= 1:
            return opened.omega(end)
        end = min(end * (1 - 1e-4), opened.around(end * (1 - 1e-4), scales, 1.0)[0])
        if end == 0:
            return 0.0
    return opened.omega(end)


# The margins of one loop, broken at one signal while all others stay closed.


@dataclass(frozen=True)
class Crossing:
    """A frequency at which the loop's gain is 1, or its phase -180 degrees.

    Attributes
    ----------
    frequency_hz : float
    gain : float
        Factor of the gain that makes the loop marginal here; 1 at a gain crossover.
    phase_deg : float
        Lag, from 0 to 360 degrees, that makes it marginal here; 0 at a phase crossover.
    delay_s : float
        The same lag as a delay in s; infinite at frequency 0.

    Examples
    --------
    >>> from robustpolish.loops import Crossing
    >>> Crossing(10.0, 1.0, 36.0, 0.01).delay_s
    0.01
    """

    frequency_hz: float
    gain: float
    phase_deg: float
    delay_s: float


_SHOWN = 20  # crossings in a table


@dataclass(frozen=True, eq=False, repr=False)
class LoopMargins(Displayed):
    """Margins at one signal, all other loops being closed.

    Attributes
    ----------
    name : str
        The signal at which the loop is broken.
    place : {"input", "output"}
        Of the plant.
    gain_up, gain_down : float
        Factors to which the gain may rise and fall; infinite and 0 if it may as it likes.
    phase_deg : float
        Degrees by which the phase may lag or lead; infinite if the gain never is 1.
    delay_s : float
        Smallest delay in s that makes the loop unstable; infinite if none does, 0 if any does. In
        discrete time it is a turn of the phase by omega times the delay, exact for whole samples.
    modulus : float
        Smallest distance of the Nyquist curve from -1, one over the peak of S.
    disk : DiskMargin
        Gain and phase changed together.
    gain_crossovers, phase_crossovers : tuple of Crossing
        By frequency; all of them up to `complete_to_hz`.
    loop : control.StateSpace
        L, with S = 1/(1 + L).
    unstable_poles : int
        Poles of L beyond the boundary of stability.
    complete_to_hz : float
        Infinite without delays. With them, the frequency up to which every turn of the phase is
        followed: above it the gain stays below 1/1000, or more than 500 turns lie below it.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> s = control.tf("s")
    >>> analysis = rp.loop_analysis(1 / (s * (s + 1) * (0.5 * s + 1)), -1)
    >>> margins = analysis.margins[0]
    >>> round(margins.gain_up, 6), round(margins.phase_deg, 4), round(margins.delay_s, 5)
    (3.0, 32.6131, 0.75958)
    >>> margins.plot().get_xlabel()
    'real part of L'
    """

    name: str
    place: Place
    gain_up: float
    gain_down: float
    phase_deg: float
    delay_s: float
    modulus: float
    disk: DiskMargin
    gain_crossovers: tuple[Crossing, ...]
    phase_crossovers: tuple[Crossing, ...]
    loop: control.StateSpace = field(repr=False)
    unstable_poles: int = 0
    complete_to_hz: float = math.inf

    @property
    def gain_up_db(self) -> float:
        """The upper gain margin in dB."""
        return decibel(self.gain_up)

    @property
    def gain_down_db(self) -> float:
        """The lower gain margin in dB; negative."""
        return decibel(self.gain_down)

    @property
    def delay_samples(self) -> float:
        """The delay margin in samples of a discrete loop; nan in continuous time."""
        if not self.loop.isdtime(strict=True):
            return math.nan
        return self.delay_s / (1.0 if self.loop.dt is True else float(self.loop.dt))

    @property
    def conditionally_stable(self) -> bool:
        """Whether less gain makes a loop unstable whose own poles are all stable."""
        return self.gain_down > 0 and self.unstable_poles == 0

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the Nyquist curve of the loop with the disk that it stays out of.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        loops, disks = {self.name: self.loop}, {self.name: self.disk.alpha}
        return plot_loops(loops, disks, "nyquist", ax, None)

    def _card(self) -> Card:
        disk = self.disk
        words = f"{disk.alpha:.4g}: ±{disk.gain_db:.3g} dB with ±{disk.phase_deg:.3g} deg"
        rows = (
            ("gain margin [dB]", f"{self.gain_down_db:.4g} to {self.gain_up_db:.4g}"),
            ("phase margin [deg]", self.phase_deg),
            ("delay margin [s]", self.delay_s),
            ("disk margin", words),
            ("modulus margin", self.modulus),
        )
        columns = ("crossing", "frequency [Hz]", "gain [dB]", "lag [deg]", "delay [s]")
        crossings = tuple(
            (kind, c.frequency_hz, decibel(c.gain), c.phase_deg, c.delay_s)
            for kind, found in (("gain", self.gain_crossovers), ("phase", self.phase_crossovers))
            for c in found
        )
        tables = (
            quantities(*rows, digits=4),
            *[Table("", columns, crossings[:_SHOWN])] * bool(crossings),
        )
        notes = ["Less gain makes it unstable too."] * self.conditionally_stable
        if math.isfinite(self.complete_to_hz):
            notes.append(f"Crossings are followed up to {self.complete_to_hz:.4g} Hz.")
        if (more := len(crossings) - _SHOWN) > 0:
            notes.append(f"{more} more crossings are in gain_crossovers and phase_crossovers.")
        return Card(f"Loop broken at {self.place} {self.name}", tables, tuple(notes))


def margins_of(loop: Loop | MeasuredLoop, place: Place, signal: int) -> LoopMargins:
    """Return the margins of a stable loop at one signal of a place."""
    response, at = loop.response(place, [signal]), loop.at(place, [signal])
    turns = [(omega, lag(angle)) for omega, angle in response.gain_crossovers()]
    at_gain = tuple(
        Crossing(omega / (2 * math.pi), 1.0, math.degrees(turn), turn / omega)
        for omega, turn in turns
    )
    at_phase = tuple(
        Crossing(omega / (2 * math.pi), gain, 0.0, 0.0)
        for omega, gain in response.phase_crossovers()
    )
    # Any delay will do if the gain stays at or above 1 for ever.
    delays = [0.0] if response.stays_large else [c.delay_s for c in at_gain]
    largest = loop.peak(at).value
    return LoopMargins(
        name=loop.names(place)[signal],
        place=place,
        gain_up=min((c.gain for c in at_phase if c.gain > 1), default=math.inf),
        gain_down=max((c.gain for c in at_phase if c.gain < 1), default=0.0),
        phase_deg=min((min(c.phase_deg, 360 - c.phase_deg) for c in at_gain), default=math.inf),
        delay_s=min(delays, default=math.inf),
        modulus=1 / largest if largest > 0 else math.inf,
        disk=disk_of(loop.balanced_peak(at)),
        gain_crossovers=at_gain,
        phase_crossovers=at_phase,
        loop=response.system,
        unstable_poles=response.unstable_poles,
        complete_to_hz=response.complete_to / (2 * math.pi),
    )
