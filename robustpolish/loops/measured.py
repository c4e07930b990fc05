"""Loops with a plant that is known at measured frequencies only."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, get_args

import control
import numpy as np
from matplotlib.axes import Axes

from robustpolish.base.arrays import AnyArray, Vector
from robustpolish.base.checks import described, invalid, one_of
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.linear.delays.systems import resolvent_response
from robustpolish.linear.norms.hinf import HinfNorm
from robustpolish.linear.stability import Stability
from robustpolish.loops.disk_margins import DiskMargin
from robustpolish.loops.loop import PLACES, Place
from robustpolish.loops.margins import Crossing, LoopMargins, MarginsAtOnce, Where
from robustpolish.loops.performance import LoopBandwidth, Sensitivities
from robustpolish.loops.pictures import over_frequency
from robustpolish.loops.report import (
    LoopFigures,
    at_once_in_words,
    margins_in_words,
    problems,
    quantity,
    tables_of,
    verdict,
)
from robustpolish.loops.requirements import LoopRequirements
from robustpolish.loops.response import closed_values, opened_values
from robustpolish.loops.scaled_peak import best_scales
from robustpolish.plants.blocks import matrices_of
from robustpolish.plants.controllers import GivenController, controller_system
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plots.frequency import plot_bode, plot_gains, plot_nichols, plot_nyquist_disks

# A measured plant and a controller as a loop, at the measured frequencies.

_AT_REST = 1e-9
"""Poles of a controller this near to the boundary, over the first measured frequency, are on it."""


@dataclass(frozen=True, eq=False)
class MeasuredLoop:
    """A plant known at some frequencies, and u = K y.

    Attributes
    ----------
    plant : GeneralizedPlant
        Its system is a frequency response.
    controller : control.StateSpace
    omega : ndarray
        The lines in rad/s, rising, above 0 and below half the sample rate.
    G, K : ndarray of complex, shapes (k, ny, nu) and (k, nu, ny)
    unstable_poles : int
        Of the plant, which its response does not tell.
    """

    plant: GeneralizedPlant
    controller: control.StateSpace
    omega: Vector
    G: AnyArray
    K: AnyArray
    unstable_poles: int

    @classmethod
    def of(
        cls, plant: GeneralizedPlant, controller: GivenController, unstable_poles: Any
    ) -> MeasuredLoop:
        """Put a measured plant and a controller together.

        Raises
        ------
        InvalidInputError
            If the controller does not fit, or there are fewer than two lines.
        """
        whole = isinstance(unstable_poles, int | np.integer) and not isinstance(
            unstable_poles, bool
        )
        if not whole or unstable_poles < 0:
            remedy = "Count the plant's poles in the right half plane; none is 0."
            raise invalid("unstable_poles", unstable_poles, "a whole number from 0 on", remedy)
        system = controller_system(plant, controller)
        if (system.noutputs, system.ninputs) != (plant.nu, plant.ny):
            shown = described(f"{system.ninputs} inputs and {system.noutputs} outputs")
            want = f"{plant.ny} inputs (y) and {plant.nu} outputs (u)"
            raise invalid("controller", shown, want, "It leads from y to u.")
        lines: Any = plant.system
        order = np.argsort(lines.omega)
        omega = np.asarray(lines.omega, dtype=float)[order]
        dt = 0 if system.dt is None else system.dt
        kept = (omega > 0) & (omega < (math.pi / float(dt) if dt else math.inf))
        if kept.sum() < 2:
            shown = described(f"{int(kept.sum())} lines above 0 and below half the sample rate")
            raise invalid("plant", shown, "two or more", "Measure more of the response.")
        omega = omega[kept]
        G = np.moveaxis(np.asarray(lines.frdata), 2, 0)[order][kept]
        G = G[:, -plant.ny :, G.shape[2] - plant.nu :]
        points = np.exp(1j * omega * float(dt)) if dt else 1j * omega
        K = resolvent_response(*matrices_of(system), points)
        return cls(plant, system, omega, G, K, int(unstable_poles))

    @property
    def dt(self) -> float | bool:
        """Sampling time of the controller in s; 0 for a continuous one."""
        return 0 if self.controller.dt is None else self.controller.dt

    @property
    def is_discrete(self) -> bool:
        """Whether the controller is discrete."""
        return bool(self.dt)

    def names(self, place: Place) -> tuple[str, ...]:
        """Return the controls, or the measurements."""
        own = self.plant
        return own.control_names if place == "input" else own.measurement_names

    @cached_property
    def closed(self) -> AnyArray:
        """From (disturbance at u, noise at y) to (u, y), line by line."""
        return closed_values(self.G, self.K)

    @property
    def side_by_side(self) -> AnyArray:
        """Everything opened: from (u, y) to (-K y, -G u), line by line."""
        nu, ny = self.plant.nu, self.plant.ny
        values = np.zeros((len(self.omega), nu + ny, nu + ny), dtype=complex)
        values[:, :nu, nu:], values[:, nu:, :nu] = -self.K, -self.G
        return values

    def opened(self, place: Place, signals: Sequence[int] | None = None) -> AnyArray:
        """Return L where the loop is broken, line by line, the rest being closed."""
        broken = list(range(len(self.names(place))) if signals is None else signals)
        return opened_values(self.G, self.K, place == "input", broken)

    def at(self, place: Place, signals: Sequence[int] | None = None) -> list[int]:
        """Return where signals of a place stand in :attr:`closed`."""
        first = 0 if place == "input" else self.plant.nu
        return [first + i for i in (range(len(self.names(place))) if signals is None else signals)]

    def response(
        self, values: AnyArray, inputs: Any, outputs: Any
    ) -> control.FrequencyResponseData:
        """Return values over the lines as a named frequency response."""
        return control.FrequencyResponseData(
            np.moveaxis(values, 0, 2), self.omega, inputs=list(inputs), outputs=list(outputs)
        )

    @cached_property
    def stability(self) -> Stability:
        r"""What Nyquist's criterion says of the lines.

        The phase of det(I - K G) is followed from line to line by the shorter way. Below the first
        line it is closed as that of as many poles at rest as the slope of the first lines shows, or
        the controller has; beyond the last by the shorter way, as where the loop is small.
        """
        poles: Any = np.linalg.eigvals(self.controller.A).astype(complex)
        dt = self.dt
        rates = np.abs(poles) - 1 if dt else poles.real
        edge = _AT_REST * (1.0 if dt else float(self.omega[0]))
        beyond = int((rates > edge).sum()) + self.unstable_poles
        resting = int((np.abs(poles - (1 if dt else 0)) <= edge).sum())
        one = np.eye(self.K.shape[1])
        determinant = np.linalg.det(one - self.K @ self.G)
        if (determinant == 0).any():
            return Stability("marginal", None, 0.0, False, "a line lies on -1", discrete=bool(dt))
        phases = np.unwrap(np.angle(determinant))
        first = np.log(np.abs(determinant[:2]))
        slope = (first[1] - first[0]) / math.log(self.omega[1] / self.omega[0])
        resting = max(resting, round(-slope))
        low = _nearest(2 * phases[0], -resting * math.pi)
        high = _nearest(-2 * phases[-1], 0.0)
        turns = round((2 * (phases[-1] - phases[0]) + low + high) / (2 * math.pi))
        closed = beyond - turns
        step = float(np.abs(np.diff(phases)).max())
        rest = f", closed below the first line as for {resting} poles at rest" if resting else ""
        reason = (
            f"Nyquist's criterion on {len(self.omega)} lines{rest}: {turns} turns of "
            f"det(I - K G) against the clock, {beyond} unstable poles of the open loop "
            f"({self.unstable_poles} of the plant, as told), {closed} of the closed one"
        )
        if step > math.pi / 2:
            reason += f"; the phase jumps by {math.degrees(step):.0f} deg between lines"
        if closed < 0:
            reason += ": that cannot be, so lines are missing or unstable_poles is wrong"
        verdict = "stable" if closed == 0 else "unstable"
        return Stability(verdict, None, math.nan, False, reason, discrete=bool(dt))

    @property
    def opposite_stability(self) -> Stability:
        """The same with the opposite sign, u = -K y."""
        return replace(self, controller=-self.controller, K=-self.K).stability


def _nearest(angle: float, wanted: float) -> float:
    """Return an angle, turns added, nearest to another."""
    return angle + 2 * math.pi * round((wanted - angle) / (2 * math.pi))


# Margins and bandwidths of a measured loop, from its lines.

_HALF_POWER = 1 / math.sqrt(2)
_NEAR_AXIS = math.radians(10)
"""At the first and last line a phase this near to -180 degrees counts as a crossing: to be safe."""
_FAR = 1e3
"""Unless that lies 60 dB from any margin."""


def measured_margins(loop: MeasuredLoop, place: Place, signal: int) -> LoopMargins:
    """Return the margins at one signal; crossings lie between lines, drawn straight."""
    values = loop.opened(place, [signal])
    L = values[:, 0, 0]
    at_gain, at_phase = _gain_crossings(loop.omega, L), _phase_crossings(loop.omega, L)
    at = loop.at(place, [signal])
    name = loop.names(place)[signal]
    return LoopMargins(
        name=name,
        place=place,
        gain_up=min((c.gain for c in at_phase if c.gain > 1), default=math.inf),
        gain_down=max((c.gain for c in at_phase if c.gain < 1), default=0.0),
        phase_deg=min((min(c.phase_deg, 360 - c.phase_deg) for c in at_gain), default=math.inf),
        delay_s=min((c.delay_s for c in at_gain), default=math.inf),
        modulus=float(1 / np.abs(loop.closed[:, at[0], at[0]]).max()),
        disk=_disk(loop, at),
        gain_crossovers=at_gain,
        phase_crossovers=at_phase,
        loop=loop.response(values, [name], [name]),  # type: ignore[arg-type]
        unstable_poles=loop.unstable_poles,
    )


def measured_simultaneous_margins(loop: MeasuredLoop, where: Where) -> MarginsAtOnce:
    """Return what the loop bears at several signals at once, as far as the lines tell."""
    place: Place | None = {"inputs": "input", "outputs": "output"}.get(where)  # type: ignore
    if place is None:
        at, common = [*loop.at("input"), *loop.at("output")], math.nan
    else:
        at, common = loop.at(place), _common_delay(loop.omega, loop.opened(place))
    labels = [*loop.names("input"), *loop.names("output")]
    opened = loop.side_by_side if place is None else loop.opened(place)
    large = np.flatnonzero(_scaled_sizes(opened) >= 1)
    last = int(large[-1]) + 1 if large.size else 0
    # Each line speaks for the stretch up to the next, where the same delay turns further.
    ends = np.append(loop.omega[1:], loop.omega[-1])[:last]
    delays = 2 * np.arctan2(1.0, _scaled_sizes(_balanced(loop, at)[:last])) / ends
    least = float(np.nanmin([*delays, common, math.inf]))
    return MarginsAtOnce(where, tuple(labels[i] for i in at), _disk(loop, at), common, least)


def measured_bandwidths(
    loop: MeasuredLoop, margins: tuple[LoopMargins, ...]
) -> tuple[LoopBandwidth, ...]:
    """Return bandwidths and peaks, those of all signals of a place too."""
    found = []
    for place in PLACES:
        own = [m for m in margins if m.place == place]
        groups = [(m.name, [i]) for i, m in enumerate(own)]
        if len(own) > 1:
            groups.append(("all", list(range(len(own)))))
        found += [_bandwidth(loop, place, name, signals) for name, signals in groups]
    return tuple(found)


def largest(values: AnyArray) -> Vector:
    """Return the largest singular value, line by line."""
    return np.linalg.svd(values, compute_uv=False)[:, 0]


def _balanced(loop: MeasuredLoop, at: list[int]) -> AnyArray:
    """Return S - T = 2 S - 1 at some signals."""
    return 2 * loop.closed[:, at][:, :, at] - np.eye(len(at))


def _scaled_sizes(values: AnyArray) -> Vector:
    return np.array([best_scales(value)[0] for value in values])


def _disk(loop: MeasuredLoop, at: list[int]) -> DiskMargin:
    sizes = _scaled_sizes(_balanced(loop, at))
    worst = int(np.argmax(sizes))
    alpha = 2 / float(sizes[worst]) if sizes[worst] else math.inf
    return DiskMargin(alpha, float(loop.omega[worst] / (2 * math.pi)), False)


def _gain_crossings(omega: Vector, L: Any) -> tuple[Crossing, ...]:
    found = []
    for share, i in _sign_changes(np.log(np.abs(L))):
        at = float(omega[i] * (omega[i + 1] / omega[i]) ** share)
        turn = float(np.angle(L[i + 1] / L[i]))
        lag = (float(np.angle(L[i])) + share * turn + math.pi) % (2 * math.pi)
        found.append(Crossing(at / (2 * math.pi), 1.0, math.degrees(lag), lag / at))
    return tuple(found)


def _phase_crossings(omega: Vector, L: Any) -> tuple[Crossing, ...]:
    """Return where the phase passes -180 degrees, followed by the shorter way."""
    found = []
    away = np.angle(-L)
    near = np.abs(np.diff(away)) < math.pi
    for share, i in _sign_changes(away):
        if near[i]:
            at = float(omega[i] * (omega[i + 1] / omega[i]) ** share)
            size = float(np.abs(L[i]) * np.abs(L[i + 1] / L[i]) ** share)
            found.append(Crossing(at / (2 * math.pi), 1 / size, 0.0, 0.0))
    for i in (0, -1):
        # At rest, or for ever above, L may be on the axis, where no line can lie.
        if abs(away[i]) < _NEAR_AXIS and 1 / _FAR < abs(L[i]) < _FAR:
            found.append(Crossing(float(omega[i] / (2 * math.pi)), float(1 / abs(L[i])), 0.0, 0.0))
    return tuple(sorted(found, key=lambda crossing: crossing.frequency_hz))


def _sign_changes(values: Vector) -> list[tuple[float, int]]:
    """Return where a value changes its sign: the share of the step, and the line before."""
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = values[:-1] / (values[:-1] - values[1:])
    changes = (values[:-1] > 0) != (values[1:] > 0)
    return [(float(shares[i]), int(i)) for i in np.flatnonzero(changes & np.isfinite(shares))]


def _common_delay(omega: Vector, L: AnyArray) -> float:
    """Return the smallest delay at all signals that turns an eigenvalue of L to -1."""
    values = np.linalg.eigvals(L)
    values = np.take_along_axis(values, np.argsort(-np.abs(values), axis=1), axis=1)
    delays = [c.delay_s for one in values.T for c in _gain_crossings(omega, one)]
    return min(delays, default=math.inf)


def _bandwidth(loop: MeasuredLoop, place: Place, name: str, signals: list[int]) -> LoopBandwidth:
    at = loop.at(place, signals)
    S = loop.closed[:, at][:, :, at]
    s, t = largest(S), largest(np.eye(len(at)) - S)
    crossings = _gain_crossings(loop.omega, largest(loop.opened(place, signals)))
    rising = [w for w, up in _half_power(loop.omega, s) if up]
    falling = [w for w, up in _half_power(loop.omega, t) if not up]
    above = bool(t[-1] > _HALF_POWER)
    hertz = loop.omega / (2 * math.pi)
    return LoopBandwidth(
        name,
        place,
        max((c.frequency_hz for c in crossings), default=math.nan),
        min(rising, default=math.nan),
        math.nan if above else max(falling, default=math.nan),
        float(s.max()),
        float(t.max()),
        float(hertz[np.argmax(s)]),
        float(hertz[np.argmax(t)]),
    )


def _half_power(omega: Vector, sizes: Vector) -> list[tuple[float, bool]]:
    """Return the frequencies in Hz at which a gain passes -3 dB, and whether upwards."""
    levels = np.log(sizes / _HALF_POWER)
    return [
        (float(omega[i] * (omega[i + 1] / omega[i]) ** share / (2 * math.pi)), levels[i] < 0)
        for share, i in _sign_changes(levels)
    ]


# What a loop with a measured plant is like, as far as its lines tell.

MeasuredKind = Literal["bode", "sigma", "nyquist", "nichols"]
_PEAKS = ("S", "T", "KS", "GS")
_ONLY_LINES = "the largest of the measured lines: no proof between them"


@dataclass(frozen=True, eq=False)
class MeasuredSensitivities(Sensitivities):
    """L, S, T, KS and GS at the measured frequencies, each a `control.FrequencyResponseData`.

    Attributes
    ----------
    place : {"input", "output"}
    L, S, T, KS, GS : control.FrequencyResponseData
    """

    @cached_property
    def peaks(self) -> dict[str, HinfNorm]:
        """Largest singular values of the lines; what lies between them is not known."""
        return {name: _peak(getattr(self, name)) for name in _PEAKS}


class MeasuredLoopAnalysis(LoopFigures, Displayed):
    """What :func:`robustpolish.loop_analysis` says of a measured plant.

    Its fields are those of :class:`robustpolish.results.LoopAnalysis`. Stability is counted by
    Nyquist's
    criterion, margins lie on the lines or straight between them, and nothing is proven. What
    needs a model is empty: ``noise``, ``effort`` and ``given`` are ``()``, ``sample_rate`` is None.

    Attributes
    ----------
    loop : MeasuredLoop
        Plant, controller and their lines.
    stability : Stability
        As Nyquist's criterion counts it.
    input, output : MeasuredSensitivities
        L, S, T, KS and GS at the plant's input and output, as frequency responses.
    margins, at_once, bandwidths, requirements
        As in :class:`robustpolish.results.LoopAnalysis`.
    noise, effort, given, sample_rate
        Empty, and None.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> s = control.tf("s")
    >>> measured = control.frd(1 / (s * (s + 1) * (0.5 * s + 1)), np.logspace(-2, 2, 400))
    >>> analysis = rp.loop_analysis(measured, -1)
    >>> analysis.stable, round(analysis.gain_margin[1], 2), round(analysis.phase_margin, 1)
    (True, 3.0, 32.6)
    >>> analysis.plot(kind="nyquist").get_xlabel()
    'real part of L'
    """

    loop: Any

    @property
    def problems(self) -> tuple[str, ...]:
        """What speaks against building the loop, the worst first, as far as the lines tell."""
        return tuple(problems(self))

    @property
    def buildable(self) -> bool:
        """Whether the loop meets its requirements at the lines."""
        return not problems(self)

    def explain(self) -> str:
        """Say in a paragraph whether the loop can be built, and what that rests on.

        Returns
        -------
        str

        Examples
        --------
        >>> import control
        >>> import numpy as np
        >>> import robustpolish as rp
        >>> lines = control.frd(control.tf([2], [1, 1]), np.logspace(-2, 2, 50))
        >>> "50 measured lines" in rp.loop_analysis(lines, -1).explain()
        True
        """
        against = problems(self)
        if not self.stable:
            return f"This loop cannot be built: {against[0]}. There are no margins."
        told = [verdict(against), margins_in_words(self), at_once_in_words(self), self._basis()]
        return " ".join(filter(None, told))

    def tables(self) -> tuple[Table, ...]:
        """Return the figures as tables: margins and bandwidths.

        Returns
        -------
        tuple of Table

        Examples
        --------
        >>> import control
        >>> import numpy as np
        >>> import robustpolish as rp
        >>> lines = control.frd(control.tf([2], [1, 1]), np.logspace(-2, 2, 50))
        >>> [table.caption for table in rp.loop_analysis(lines, -1).tables()][-1]
        'Bandwidths'
        """
        return tuple(table for table in tables_of(self) if table.rows)

    def plot(
        self,
        ax: Axes | str | None = None,
        *,
        kind: MeasuredKind = "bode",
        signal: str | None = None,
        place: Place = "input",
    ) -> Axes:
        """Draw the loops at the measured lines, joined by straight strokes.

        Parameters
        ----------
        ax : matplotlib.axes.Axes or str, optional
            Where to draw; a new figure by default. A text is taken as `kind`.
        kind : {"bode", "sigma", "nyquist", "nichols"}, optional
            "bode", "nyquist" and "nichols" show L of single loops, the latter two with the disk
            around -1 that each stays out of at the lines; "sigma" the largest singular values of
            S, T, KS and GS.
        signal : str, optional
            The control or measurement at which the loop is broken; by default all of `place`, at
            most five.
        place : {"input", "output"}, optional
            Of the plant.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        InvalidInputError
            If there is no such kind, place or signal; steps need a model.
        """
        if isinstance(ax, str):
            ax, kind = None, ax  # type: ignore[assignment]
        if kind == "step":
            shown = described("the steps of a measured plant")
            raise invalid("kind", shown, "a model to run", "Fit one, or draw kind='bode'.")
        one_of("kind", kind, get_args(MeasuredKind))
        one_of("place", place, PLACES)
        chosen = self._chosen(place, signal)
        lines: MeasuredLoop = self.loop
        if kind == "sigma":
            at = getattr(self, chosen[0][0])
            sizes = {
                name: over_frequency(lines.omega, _sizes(getattr(at, name))) for name in _PEAKS
            }
            several = max(len(self.loop.names(where)) for where in PLACES) > 1
            return plot_gains(sizes, None, ax, name="largest singular value" if several else "gain")
        curves = {lines.names(where)[i]: lines.opened(where, [i])[:, 0, 0] for where, i in chosen}
        loops = {name: over_frequency(lines.omega, curve) for name, curve in curves.items()}
        if kind == "bode":
            return plot_bode(loops, ax, name="gain of L")
        draw = plot_nyquist_disks if kind == "nyquist" else plot_nichols
        return draw(loops, {m.name: m.disk.alpha for m in self.margins}, ax)

    def _basis(self) -> str:
        loop: MeasuredLoop = self.loop
        low, high = (float(loop.omega[i] / (2 * np.pi)) for i in (0, -1))
        text = (
            f"All this rests on {len(loop.omega)} measured lines from {quantity(low, 'Hz')} to "
            f"{quantity(high, 'Hz')}: between and beyond them nothing is proven. "
            f"{self.stability.reason[0].upper()}{self.stability.reason[1:]}."
        )
        last = float(largest(loop.opened("output"))[-1])
        if last > 0.5:
            text += (
                f" At the last line the loop still has a gain of {last:.3g}: crossings beyond it "
                "are not seen, so measure further."
            )
        return text + " Efforts, noise and sampling rates need a model."

    def _card(self) -> Card:
        state = "stable as counted" if self.stable else "NOT stable as counted"
        return Card(f"Loop analysis of a measured plant: {state}", self.tables(), (self.explain(),))


def measured_analysis(
    plant: GeneralizedPlant,
    controller: GivenController,
    unstable_poles: int,
    requirements: LoopRequirements,
) -> MeasuredLoopAnalysis:
    """Analyse a loop whose plant is a frequency response; see `loop_analysis`."""
    loop = MeasuredLoop.of(plant, controller, unstable_poles)
    at = {place: _sensitivities(loop, place) for place in PLACES}
    stable = bool(loop.stability)
    singles = tuple(
        measured_margins(loop, place, i)
        for place in PLACES
        for i in range(len(loop.names(place)))
        if stable
    )
    return MeasuredLoopAnalysis(
        loop=loop,  # type: ignore[arg-type]
        stability=loop.stability,
        input=at["input"],
        output=at["output"],
        margins=singles,
        at_once={where: measured_simultaneous_margins(loop, where) for where in get_args(Where)}
        if stable
        else {},
        bandwidths=measured_bandwidths(loop, singles) if stable else (),
        noise=(),
        effort=(),
        given=(),
        sample_rate=None,
        requirements=requirements,
    )


def _sensitivities(loop: MeasuredLoop, place: Place) -> MeasuredSensitivities:
    closed, own = loop.closed, loop.at(place)
    u, y = loop.at("input"), loop.at("output")
    names, controls, measurements = loop.names(place), loop.names("input"), loop.names("output")
    S = closed[:, own][:, :, own]

    def named(values: AnyArray, inputs: Any, outputs: Any) -> Any:
        return loop.response(values, inputs, outputs)

    return MeasuredSensitivities(
        place=place,
        L=named(loop.opened(place), names, names),
        S=named(S, names, names),
        T=named(np.eye(len(own)) - S, names, names),
        KS=named(closed[:, u][:, :, y], measurements, controls),
        GS=named(closed[:, y][:, :, u], controls, measurements),
    )


def _peak(system: control.FrequencyResponseData) -> HinfNorm:
    sizes = _sizes(system)
    i = int(np.argmax(sizes))
    value = float(sizes[i])
    return HinfNorm(value, float(system.omega[i]), value, np.inf, True, _ONLY_LINES)


def _sizes(system: control.FrequencyResponseData) -> Vector:
    """Return the largest singular value, line by line."""
    return largest(np.moveaxis(np.asarray(system.frdata), 2, 0))
