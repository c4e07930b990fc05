"""What a loop is like: margins, bandwidths, noise, effort, sampling; shown, drawn and told."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache, cached_property, partial
from operator import attrgetter
from typing import Any, Literal, get_args

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from scipy import linalg

from robustpolish.base import results
from robustpolish.base.arrays import AnyVector
from robustpolish.base.budget import single_threaded_blas
from robustpolish.base.checks import instance_of, misfit, one_of
from robustpolish.linear.stability import Stability
from robustpolish.loops import loop as loops
from robustpolish.loops import performance
from robustpolish.loops.disk_margins import DiskMargin, decibel
from robustpolish.loops.loop import PLACES, Loop, Place, sample_step
from robustpolish.loops.margins import (
    LoopMargins,
    MarginsAtOnce,
    Where,
    margins_of,
    simultaneous_margins,
)
from robustpolish.loops.pictures import plot_loops, plot_sigma, plot_steps
from robustpolish.loops.ranges import proven_range
from robustpolish.loops.requirements import LoopRequirements
from robustpolish.plants.blocks import GivenController
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.robust.questions import RobustStability
from robustpolish.synthesis.design import Design

# Can this loop be built, and what limits it: the figures in a paragraph.


# What was found out about a loop, and what follows from it, without words and pictures.

_MOST_SHOWN = 5
"""So many single loops are drawn in one picture."""


@dataclass(frozen=True, eq=False, repr=False)
class LoopFigures(results.Displayed):
    """The fields of :class:`robustpolish.results.LoopAnalysis`, whose docstring explains them."""

    loop: Loop
    stability: Stability
    input: performance.Sensitivities
    output: performance.Sensitivities
    margins: tuple[LoopMargins, ...]
    at_once: Mapping[Where, MarginsAtOnce]
    bandwidths: tuple[performance.LoopBandwidth, ...]
    noise: tuple[performance.Effort, ...]
    effort: tuple[performance.Effort, ...]
    given: tuple[performance.GivenEffort, ...]
    sample_rate: performance.SampleRate | None
    requirements: LoopRequirements

    @property
    def stable(self) -> bool:
        """Whether the closed loop is strictly stable; there are no margins otherwise."""
        return bool(self.stability)

    @property
    def problems(self) -> tuple[str, ...]:
        """What speaks against building the loop, the worst first, as far as is known."""
        return tuple(problems(self))

    @property
    def buildable(self) -> bool:
        """Whether the loop meets its requirements."""
        return not self.problems

    @property
    def S(self) -> control.StateSpace:
        """Sensitivity at the plant's output."""
        return self.output.S

    @property
    def T(self) -> control.StateSpace:
        """Complementary sensitivity at the plant's output."""
        return self.output.T

    @property
    def KS(self) -> control.StateSpace:
        """From noise on the measurements to the controls."""
        return self.output.KS

    @property
    def GS(self) -> control.StateSpace:
        """From disturbances at the controls to the measurements."""
        return self.output.GS

    @property
    def gain_margin(self) -> tuple[float, float]:
        """Factors to which the gain of any one loop may fall and rise; nan if unstable."""
        if not self.margins:
            return math.nan, math.nan
        return max(m.gain_down for m in self.margins), min(m.gain_up for m in self.margins)

    @property
    def phase_margin(self) -> float:
        """Degrees by which the phase of any one loop may turn; nan if unstable."""
        return self._least(lambda margins: margins.phase_deg)

    @property
    def delay_margin(self) -> float:
        """Smallest delay in s, in one loop or in all of a place alike, that makes it unstable."""
        common = [found.common_delay_s for found in self.at_once.values()]
        known = [delay for delay in common if not math.isnan(delay)]
        return min([self._least(lambda margins: margins.delay_s), *known])

    @property
    def disk_margin(self) -> DiskMargin:
        """The smallest disk margin of one loop at a time; nan if unstable."""
        if not self.margins:
            return DiskMargin(math.nan, math.nan, False)
        return min((margins.disk for margins in self.margins), key=lambda disk: disk.alpha)

    @property
    def modulus_margin(self) -> float:
        """The smallest distance of any one Nyquist curve from -1; nan if unstable."""
        return self._least(lambda margins: margins.modulus)

    @property
    def largest_rate(self) -> dict[str, float]:
        """Largest rate of each control, in units per second, after a unit step of a disturbance."""
        names: dict[str, float] = {}
        for row in self.effort:
            names[row.control] = max(names.get(row.control, 0.0), row.step_rate)
        return names

    def _drawn(
        self, ax: Axes | None, kind: str, signal: str | None, place: Place, rates: AnyVector | None
    ) -> Axes:
        """Draw the loops at chosen signals, or the singular values of S, T, KS and GS."""
        chosen = self._chosen(place, signal)
        if kind == "sigma":
            at = getattr(self, chosen[0][0])
            return plot_sigma({name: getattr(at, name) for name in performance.SHOWN}, ax, rates)
        loops = {self.loop.names(where)[i]: self.loop.opened(where, [i]) for where, i in chosen}
        return plot_loops(loops, {m.name: m.disk.alpha for m in self.margins}, kind, ax, rates)

    def _chosen(self, place: Place, signal: str | None) -> list[tuple[Place, int]]:
        """Return where loops are broken to be shown: at one signal, or at those of a place."""
        one_of("place", place, PLACES)
        known: dict[str, tuple[Place, int]] = {
            name: (where, i)
            for where in PLACES[::-1]
            for i, name in enumerate(self.loop.names(where))
        }
        if signal is None:
            return [(place, i) for i in range(min(len(self.loop.names(place)), _MOST_SHOWN))]
        one_of("signal", signal, self.loop.signals, "Check its spelling.")
        return [known[signal]]

    def _least(self, of: Callable[[LoopMargins], float]) -> float:
        return min((of(margins) for margins in self.margins), default=math.nan)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain numbers, without systems.

        Returns
        -------
        dict
            Its keys are the names of the attributes.
        """
        rows = ("margins", "at_once", "bandwidths", "noise", "effort", "given")
        return {
            "stable": self.stable,
            "stability": self.stability.reason,
            "gain_margin": list(self.gain_margin),
            "phase_margin_deg": self.phase_margin,
            "delay_margin_s": self.delay_margin,
            "modulus_margin": self.modulus_margin,
            "disk_margin": _numbers(self.disk_margin),
            **{name: _numbers(getattr(self, name)) for name in rows},
            "largest_rate": self.largest_rate,
            "sample_rate": _numbers(self.sample_rate),
            "requirements": _numbers(self.requirements),
        }


def _numbers(found: Any) -> Any:
    """Return dataclasses as dictionaries and tuples as lists, without systems."""
    if isinstance(found, tuple):
        return [_numbers(item) for item in found]
    if isinstance(found, Mapping):
        return {name: _numbers(item) for name, item in found.items()}
    if not is_dataclass(found):
        return found
    names = [item.name for item in fields(found) if item.name not in ("loop", "where")]
    if isinstance(found, DiskMargin):
        names = ["alpha", "gain_db", "phase_deg", "frequency_hz", "proven"]
    return {name: _numbers(getattr(found, name)) for name in names}


# The figures of a loop as tables.

# More rows than this are shortened to the worst source of each control.
_MOST_ROWS = 12


def tables_of(found: LoopFigures) -> tuple[results.Table, ...]:
    """Return what is known of a loop as tables; none for an unstable one."""
    if not found.stable:
        return ()
    (noisy, noise), (driven, effort) = _strongest(found.noise), _strongest(found.effort)
    told = [
        _table("Margins, one loop at a time", "margins", found.margins),
        _table("Margins, all at once", "at_once", tuple(found.at_once.values())),
        _table("Bandwidths", "bandwidths", found.bandwidths),
        _table(f"Noise on the measurements: what the controls do{noisy}", "effort", noise),
        _table(f"Disturbances: what the controls do{driven}", "effort", effort),
    ]
    if found.given:
        told.append(_table("Under the given disturbance", "given", found.given))
    if rate := found.sample_rate:
        last = ("needed", rate.needed_hz), ("lowest stable", rate.lowest_stable_hz)
        told.append(results.Table("Sampling", ("rule", "rate [Hz]"), (*rate.rules.items(), *last)))
    return tuple(told)


def _table(caption: str, kind: str, rows: Sequence[Any]) -> results.Table:
    """Return a table of attributes, by the heads of their columns."""
    columns = _COLUMNS[kind]
    cells = attrgetter(*columns.values())
    return results.Table(caption, tuple(columns), tuple(cells(row) for row in rows))


_COLUMNS = results.tables(__file__)["columns"]


def _strongest(rows: Sequence[performance.Effort]) -> tuple[str, list[performance.Effort]]:
    """Return the rows with an effect; of many the worst source of each control, which is told."""
    kept = [row for row in rows if row.peak_gain > 0]
    if len(kept) <= _MOST_ROWS:
        return "", kept
    worst: dict[str, performance.Effort] = {}
    for row in kept:
        worst[row.control] = max(worst.get(row.control, row), row, key=lambda row: row.peak_gain)
    return ", the strongest source of each", list(worst.values())


def problems(found: LoopFigures) -> list[str]:
    """Return what speaks against building the loop, the worst first; nothing if it can be built."""
    loop, asked = found.loop, found.requirements
    if not found.stable:
        text = f"the closed loop is not stable ({found.stability.reason})"
        if loop.opposite_stability:
            text += "; with the opposite sign it would be, so pass -K: here u = K y"
        return [text]
    told, bought = _delays(found), quantity(asked.sample_rate_hz, "Hz")
    rate, dt = found.sample_rate, loop.dt
    if rate is not None and rate.lowest_stable_hz > asked.sample_rate_hz:
        wanted = "no sampling was found at which it is stable"
        if math.isfinite(rate.lowest_stable_hz):
            lowest = quantity(rate.lowest_stable_hz, "Hz")
            wanted = f"sampled below {lowest} it is unstable"
        told.append(f"{wanted}, where {bought} can be bought")
    known = told_range(found)
    if known is not None and not (known.proven and known.lower >= 1):
        told.append(f"it is proven only for {known.lower:.2g} times {_range_text(asked)}")
    if loop.is_discrete and dt is not True and 1 / float(dt) > asked.sample_rate_hz:
        own = quantity(1 / float(dt), "Hz")
        told.append(f"it is sampled at {own}, where {bought} can be bought")
    weak = [m for m in found.margins if m.disk.alpha < asked.disk]
    if weak:
        worst = min(weak, key=lambda m: m.disk.alpha)
        told.append(
            f"its disk margin at {worst.place} {worst.name} is {_disk_text(worst.disk)}, below "
            f"{asked.disk_gain_db:g} dB and {asked.disk_phase_deg:g} deg"
        )
    together = [m for m in _several(found) if m.disk.alpha < asked.disk_at_once]
    if together:
        least = min(together, key=lambda m: m.disk.alpha)
        told.append(
            f"its disk margin at all {least.where} at once is {_disk_text(least.disk)}, below "
            f"{asked.at_once_gain_db:g} dB"
        )
    near = [m for m in found.margins if m.modulus < asked.modulus and m not in weak]
    if near:
        worst = min(near, key=lambda m: m.modulus)
        told.append(
            f"its Nyquist curve at {worst.place} {worst.name} comes within {worst.modulus:.3g} "
            f"of -1, where {asked.modulus:g} is asked"
        )
    return told


# Loops of more states take longer to prove than their figures take.
_TOLD_STATES = 12


def told_range(found: LoopFigures) -> RobustStability | None:
    """Return the proven range of a small loop of a model."""
    loop = found.loop
    if isinstance(loop, Loop) and loop.plant.nx + loop.controller.nstates <= _TOLD_STATES:
        return getattr(found, "proven_range", None)
    return None


def _range_text(asked: LoopRequirements) -> str:
    return (
        f"±{asked.stiffness_percent:g} % of each mode's stiffness, ±{asked.damping_percent:g} % of "
        f"its damping and ±{asked.actuator_percent:g} % of each actuator's gain"
    )


def _several(found: LoopFigures) -> list[MarginsAtOnce]:
    """Return the margins of all inputs, and of all outputs, where there is more than one."""
    return [m for m in found.at_once.values() if len(m.signals) > 1 and " " not in m.where]


@cache
def _template() -> Any:
    filters = {"si": quantity, "amount": _amount, "listed": _listed, "disk": _disk_text}
    filters["db"] = decibel
    return results.templates("robustpolish.loops", filters).get_template("texts.jinja")


def _said(found: LoopFigures, block: str, **values: Any) -> tuple[str, ...]:
    """Return the sentences of a block of ``texts.jinja``."""
    names = {"frequency": _frequency, "delay": _delay, "speed": _rate}
    words = {name: partial(say, found) for name, say in names.items()}
    return results.paragraphs(_template(), block, found=found, inf=math.inf, **words, **values)


def explain(found: LoopFigures, more: Sequence[str]) -> str:
    """Say in a paragraph whether a loop can be built, and what limits it; `more` ends it."""
    known, asked = told_range(found), _range_text(found.requirements)
    blame = {} if known is None or not known.witness else known.sensitivity
    worst = [name for name, share in blame.items() if share > 0.1]
    words = {"range": known, "range_text": asked, "worst": worst, "small": _TOLD_STATES}
    verdict = _said(found, "verdict", several=_several(found), **words)
    return " ".join((*verdict, *more) if found.stable else verdict)


def details(found: LoopFigures) -> tuple[str, ...]:
    """Return the sentences that need a model."""
    if not found.stable:
        return ()
    loop, plant = found.loop, found.loop.plant
    full = plant.nx > 1 and not plant.D22.any() and np.array_equal(plant.C2, np.eye(plant.nx))
    crossovers = [c.frequency_hz for m in found.margins for c in m.gain_crossovers]
    noise = [row for row in found.noise if row.peak_gain > 0]
    noisiest = max(noise, key=lambda row: row.rms, default=None)
    unit, power = noisiest.source_unit if noisiest else "", 0
    if noisiest and results.bears_prefix(unit):  # a metre of noise says little, a micrometre much
        power = max(0, results.prefix_power(noisiest.rms))
        unit = results.prefixed(unit, -power)
    steps = [row for row in found.effort if row.step_peak > 0]
    given = [
        f"{row.control} reaches {_amount(row.peak, row.unit)} and moves at up to "
        f"{_rate(found, row.peak_rate, row.unit)}"
        for row in found.given
    ]
    delays = {} if loop.is_discrete else loop.approximated_delays
    kept = cancelled(loop, 2 * math.pi * max(crossovers, default=0.0))
    return _said(
        found,
        "details",
        cancelled=[f"{p.real:.3g}{f' ± {p.imag:.3g}j' if p.imag else ''} rad/s" for p, _ in kept],
        stays=max((1 / -q.real for _, q in kept), default=0.0),
        crossover=max(crossovers, default=None),
        own=_fastest_own(loop),
        extra=min((m.delay_samples for m in found.margins), default=math.inf),
        states=plant.nx if full else 0,
        endless=sorted({row.control for row in noise if not math.isfinite(row.rms)}),
        noisiest=noisiest,
        noise_unit=unit or "unit",
        noise_scale=10.0**power,
        given=given,
        hardest=max(steps, key=lambda row: row.step_rate, default=None),
        conditional=[f"{m.place} {m.name}" for m in found.margins if m.conditionally_stable],
        delays=[f"{quantity(delay, 's')} at {name}" for name, delay in delays.items()],
    )


def _fastest_own(loop: Loop) -> float:
    """Return the highest natural frequency in Hz of the plant's states inside the loop."""
    poles = np.linalg.eigvals(loop.plant_matrices[0]).astype(complex)
    if loop.is_discrete:
        poles = np.log(poles[poles != 0]) / sample_step(loop.dt)
    return float(np.abs(poles).max(initial=0.0)) / (2 * math.pi)


# Shares of the crossover frequency: how far a pole and a zero that cancel may lie apart, and below
# which a decay outlasts the loop's own.
_CANCELLED, _SLOW = 1e-2, 0.1


def cancelled(loop: Loop, crossover: float) -> list[tuple[complex, complex]]:
    """Return slow or lightly damped poles of the plant at zeros of K, with where the loop has them.

    None of a sampled loop, or where K has no zeros of its own: it is not square.
    """
    A, B, C, D = loop.controller_matrices
    if loop.is_discrete or len(D) != len(D.T) or not len(A):
        return []
    whole, sides = np.block([[A, B], [C, D]]), np.zeros((len(A) + len(D),) * 2)
    sides[: len(A), : len(A)] = np.eye(len(A))
    found: Any = linalg.eigvals(whole, sides, homogeneous_eigvals=True)
    top, below = found
    zeros = top[below != 0] / below[below != 0]
    near = _CANCELLED * crossover
    return [
        (complex(p), complex(q))
        for p in np.linalg.eigvals(loop.plant_matrices[0]).astype(complex)
        for q in loop.rates[np.abs(loop.rates - p).argmin(keepdims=True)]
        if p.imag >= 0 and abs(p - q) < near and 0 < -q.real < _SLOW * crossover
        if np.abs(zeros - p).min(initial=math.inf) < near
    ]


def lines_in_words(found: LoopFigures) -> tuple[str, ...]:
    """Say on what the figures of a measured loop rest."""
    loop: Any = found.loop
    last = float(loop.response("output").sizes()[-1, 0])
    return _said(found, "lines", hertz=loop.omega / (2 * np.pi), last=last)


def _delays(found: LoopFigures) -> list[str]:
    asked, margin = found.requirements, found.delay_margin
    if found.loop.dt is True:  # without a sampling time, seconds mean nothing
        return []
    late, what = asked.sampling_delay_samples, "a chain of measurement and drive takes"
    total = asked.delay_s
    if not found.loop.is_discrete:
        total += late / asked.sample_rate_hz
        rate = quantity(asked.sample_rate_hz, "Hz")
        what = f"{late:g} samples at {rate} and the chain of measurement and drive take"
    what = f"{what} {quantity(total, 's')}"
    if margin == 0:
        return [f"any delay makes it unstable, and {what}"]
    if margin <= total:
        return [f"a delay of {quantity(margin, 's')} makes it unstable, and {what}"]
    if asked.delay_share * margin < total:
        share = f"{100 * total / margin:.0f} %"
        return [f"of its delay margin of {quantity(margin, 's')}, {share} are used up: {what}"]
    return []


def _disk_text(disk: Any) -> str:
    if math.isinf(disk.gain_db):
        return f"any gain or ±{disk.phase_deg:.3g} deg"
    return f"±{disk.gain_db:.3g} dB and ±{disk.phase_deg:.3g} deg"


def _frequency(found: LoopFigures, hertz: float) -> str:
    """Return a frequency; without a sampling time it is counted per sample."""
    return f"{hertz:.3g} per sample" if found.loop.dt is True else quantity(hertz, "Hz")


def _delay(found: LoopFigures, delay: float) -> str:
    return f"{delay:.3g} samples" if found.loop.dt is True else quantity(delay, "s")


def _listed(names: list[str], most: int = 3) -> str:
    shown, more = names[:most], len(names) - most
    if more > 0:
        return f"{', '.join(shown)} and {more} more"
    return shown[0] if len(shown) == 1 else f"{', '.join(shown[:-1])} and {shown[-1]}"


def quantity(value: float, unit: str) -> str:
    """Return a number with its unit and SI prefix, three digits."""
    if not math.isfinite(value) or value == 0:
        return f"{value:g} {unit}"
    digits = f"{value:.3g}"
    power = results.prefix_power(abs(float(digits)))
    return f"{float(digits) / 10**power:.3g} {results.prefixed(unit, power)}"


def _amount(value: float, unit: str) -> str:
    return f"{value:.3g} {unit}".rstrip()


def _rate(found: LoopFigures, value: float, unit: str) -> str:
    if found.loop.dt is True:
        return f"{_amount(value, unit)} per sample"
    return f"{value:.3g} {unit}/s" if unit else f"{value:.3g} per second"


Kind = Literal["bode", "sigma", "nyquist", "nichols", "step"]


class LoopAnalysis(LoopFigures):
    """What :func:`loop_analysis` found out.

    Attributes
    ----------
    loop : Loop
        Plant and controller, to be opened anywhere.
    stability : Stability
        Of the closed loop; if it is not stable, everything below `output` is empty.
    input, output : Sensitivities
        L, S, T, KS and GS at the plant's input and output, with their peaks.
    margins : tuple of LoopMargins
        One loop at a time, the others closed: at every control, then at every measurement.
    at_once : mapping of str to MarginsAtOnce
        All at once: at the "inputs", the "outputs", and the "inputs and outputs".
    bandwidths : tuple of LoopBandwidth
        Of every single loop, and of the largest singular value ("all").
    noise : tuple of Effort
        What noise on each measurement makes each control do.
    effort : tuple of Effort
        What each disturbance of the plant makes each control do.
    given : tuple of GivenEffort
        What each control does under the disturbance that was given.
    sample_rate : SampleRate or None
        Sampling that a continuous loop needs; None in discrete time.
    requirements : LoopRequirements
        What the words judge by.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> s = control.tf("s")
    >>> analysis = rp.loop_analysis(1 / (s * (s + 1) * (0.5 * s + 1)), -1)
    >>> analysis.stable, round(analysis.gain_margin[1], 3), round(analysis.phase_margin, 2)
    (True, 3.0, 32.61)
    >>> round(analysis.delay_margin, 4), round(analysis.disk_margin.alpha, 4)
    (0.7596, 0.5053)
    >>> print(analysis.explain().split(":")[1].split(",")[0].strip())
    its disk margin at input u[0] is ±4.49 dB and ±28.4 deg
    >>> analysis.plot(kind="nyquist").get_xlabel(), sorted(analysis.to_dict())[:2]
    ('real part of L', ['at_once', 'bandwidths'])
    >>> [table.caption for table in analysis.tables()][:2]
    ['Margins, one loop at a time', 'Margins, all at once']
    """

    @cached_property
    def proven_range(self) -> RobustStability | None:
        """How far modes and actuators may differ, in shares of what the requirements ask.

        Proven by :func:`robustpolish.robust_stability` for stiffness and damping of every mode of
        the plant (of sampled ones to first order) and every actuator's gain, all at once; delays
        are Padé's. None for an unstable loop, beyond 60 states, and where more than 24 numbers
        would be uncertain. Large loops take minutes, so that `explain` tells it of those up to 12
        states only.
        """
        return proven_range(self.loop, self.requirements) if self.stable else None

    def explain(self) -> str:
        """Say in a paragraph whether the loop can be built, and what limits it.

        Returns
        -------
        str
        """
        return explain(self, details(self))

    def tables(self) -> tuple[results.Table, ...]:
        """Return the figures as tables: margins, bandwidths, noise, effort, sampling.

        Returns
        -------
        tuple of Table
        """
        return tables_of(self)

    def plot(
        self,
        ax: Axes | str | None = None,
        *,
        kind: Kind = "bode",
        signal: str | None = None,
        place: loops.Place = "input",
        of: Literal["S", "T", "KS", "GS"] = "T",
        duration: float | None = None,
    ) -> Axes:
        """Draw the loops.

        Parameters
        ----------
        ax : matplotlib.axes.Axes or str, optional
            Where to draw; a new figure by default. A text is taken as `kind`.
        kind : {"bode", "sigma", "nyquist", "nichols", "step"}, optional
            "bode", "nyquist" and "nichols" show L of single loops, the latter two with the disk
            around -1 that each stays out of; "sigma" the largest singular values of S, T, KS
            and GS; "step" the response of `of` to a unit step.
        signal : str, optional
            The control or measurement at which the loop is broken; by default all of `place`, at
            most five.
        place : {"input", "output"}, optional
            Of the plant.
        of : {"S", "T", "KS", "GS"}, optional
            What "step" shows; of S and T the single loops.
        duration : float, optional
            Of "step", in s; by default four time constants of the slowest pole.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        InvalidInputError
            If there is no such kind, place or signal, or for the steps of an unstable loop.
        """
        if isinstance(ax, str):
            ax, kind = None, ax  # type: ignore[assignment]
        one_of("kind", kind, get_args(Kind))
        if kind == "step":
            return self._plot_steps(self._chosen(place, signal), of, duration, ax)
        return self._drawn(ax, kind, signal, place, self.loop.rates)

    def _plot_steps(
        self,
        chosen: list[tuple[loops.Place, int]],
        of: str,
        duration: float | None,
        ax: Axes | None,
    ) -> Axes:
        one_of("of", of, performance.SHOWN)
        if not self.stable:
            shown = "the steps of an unstable loop"
            raise misfit("kind", shown, "a stable loop", "Draw kind='nyquist' to see why.")
        at = getattr(self, chosen[0][0])
        systems = {of: getattr(at, of)}
        if of in ("S", "T"):
            names = self.loop.names(chosen[0][0])
            systems = {names[i]: loops.from_to(getattr(at, of), [i], [i]) for _, i in chosen}
        slowest = float(np.abs(np.real(self.loop.rates)).min(initial=math.inf))
        length = 4 / slowest if 0 < slowest < math.inf else 1.0
        return plot_steps(systems, length if duration is None else duration, ax)

    def _card(self) -> results.Card:
        verdict = "can be built" if self.buildable else "cannot be built as it is"
        state = f"stable, {verdict}" if self.stable else "NOT stable"
        time = "discrete time" if self.loop.is_discrete else "continuous time"
        return results.Card(f"Loop analysis, {time}: {state}", self.tables(), (self.explain(),))


MeasuredKind = Literal["bode", "sigma", "nyquist", "nichols"]


class MeasuredLoopAnalysis(LoopFigures):
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
        return explain(self, lines_in_words(self))

    def tables(self) -> tuple[results.Table, ...]:
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
        place: loops.Place = "input",
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
            shown = "the steps of a measured plant"
            raise misfit("kind", shown, "a model to run", "Fit one, or draw kind='bode'.")
        one_of("kind", kind, get_args(MeasuredKind))
        return self._drawn(ax, kind, signal, place, None)

    def _card(self) -> results.Card:
        state = "stable as counted" if self.stable else "NOT stable as counted"
        return results.Card(
            f"Loop analysis of a measured plant: {state}", self.tables(), (self.explain(),)
        )


@single_threaded_blas
def loop_analysis(
    plant: Design
    | GeneralizedPlant
    | control.StateSpace
    | control.TransferFunction
    | control.FrequencyResponseData,
    controller: Design | GivenController | None = None,
    *,
    disturbance: xr.Dataset | None = None,
    requirements: LoopRequirements | None = None,
    unstable_poles: int = 0,
) -> LoopAnalysis | MeasuredLoopAnalysis:
    r"""Find out what a loop is like, whether it can be built, and what limits it.

    The frequencies at which margins are decided are not those of a grid. Gain crossovers are
    eigenvalues of a Hamiltonian matrix, phase crossovers zeros of L(s) - L(-s), each then
    solved for by bracketing; peaks are proven norms; the disk margin of several loops is an upper
    bound with scales whose intervals cover the axis.

    Parameters
    ----------
    plant : Design, GeneralizedPlant, control.StateSpace, TransferFunction or FrequencyResponseData
        A design alone; or a plant, whose lower block from u to y counts (all of a plain system). Of
        a measured response, or a plant made of one, the lines alone count.
    controller : control.StateSpace, control.TransferFunction, array_like or Design, optional
        K in u = K y, shape (nu, ny), with **positive** sign: for a textbook's negative feedback
        pass -C.
    disturbance : xarray.Dataset, optional
        Disturbances of the plant over `time`, by name; those that are not given are zero.
        Their controls are told in `given`.
    requirements : LoopRequirements, optional
        What is asked of a loop that is to be built.
    unstable_poles : int, optional
        Of a measured plant, in the right half plane: its response does not tell, and Nyquist's
        criterion needs their number. A wrong one makes a wrong verdict.

    Returns
    -------
    LoopAnalysis or MeasuredLoopAnalysis
        Of an unstable loop without margins, and with words that say so. The second of a measured
        plant: the same fields; S, T, KS and GS are frequency responses, and what needs a
        model is empty. Between its lines nothing is proven.

    Raises
    ------
    InvalidInputError
        If plant and controller do not fit, if one is continuous and the other discrete, or if
        the loop is not well posed.

    Notes
    -----
    Margins: S. Skogestad, I. Postlethwaite, Multivariable Feedback Control, 2nd ed., section 2.4;
    P. Seiler, A. Packard, P. Gahinet, "An Introduction to Disk Margins", IEEE Control Systems
    Magazine 40 (2020) 78-95. Delays that are asked for are exact, exp(-s tau), in every margin; so
    are those of the plant in stability, all margins, bandwidths and peaks of S and T; efforts and
    systems have Padé models of these. The disk of several signals is covered by intervals with
    delays too, each as wide as a bound on the change of the response allows.

    Examples
    --------
    The spinning satellite: every single loop bears any gain and 90 degrees, both together 0.87 dB.

    >>> import control
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> G = control.ss([[0, 10], [-10, 0]], np.eye(2), [[1, 10], [-10, 1]], 0)
    >>> analysis = rp.loop_analysis(G, -np.eye(2))
    >>> [round(m.phase_deg, 3) for m in analysis.margins]
    [90.0, 90.0, 90.0, 90.0]
    >>> disk = analysis.at_once["inputs"].disk
    >>> round(disk.gain_db, 2), round(disk.phase_deg, 2)
    (0.87, 5.7)
    """
    asked = LoopRequirements() if requirements is None else requirements
    remedy = "Pass rp.LoopRequirements(...)."
    instance_of("requirements", asked, LoopRequirements, "a LoopRequirements", remedy)
    lines = loops.measured_plant(plant)
    if lines is None:
        if unstable_poles != 0:
            shown, want = "a count for a model", "a count for a measured plant only"
            raise misfit("unstable_poles", shown, want, "Leave it out: a model tells its poles.")
        return model_analysis(plant, controller, asked, disturbance)  # type: ignore[arg-type]
    if disturbance is not None:
        shown = "a disturbance of a measured plant"
        raise misfit("disturbance", shown, "a model to run", "Fit one, or leave it out.")
    measured = loops.MeasuredLoop.of(lines, loops.controller_of(controller), unstable_poles)
    return MeasuredLoopAnalysis(**_figures(measured, asked))


def model_analysis(
    plant: Design | GeneralizedPlant | control.StateSpace | control.TransferFunction,
    controller: Design | GivenController | None,
    asked: LoopRequirements,
    disturbance: xr.Dataset | None = None,
) -> LoopAnalysis:
    """Return what :func:`loop_analysis` finds out of a model."""
    loop = loops.loop_of(plant, controller)
    found = LoopAnalysis(**_figures(loop, asked))
    if not found.stable:
        return found
    return replace(
        found,
        noise=performance.noise_effort(loop),
        effort=performance.disturbance_effort(loop),
        given=() if disturbance is None else performance.given_effort(loop, disturbance),
        sample_rate=None
        if loop.is_discrete
        else performance.sample_rate(
            loop, found.margins, found.delay_margin, found.bandwidths, asked
        ),
    )


def _figures(loop: loops.Loop | loops.MeasuredLoop, asked: LoopRequirements) -> dict[str, Any]:
    """Return the fields that a model and a measured plant have in common."""
    found: dict[str, Any] = {
        "loop": loop,
        "stability": loop.stability,
        **{place: performance.sensitivities(loop, place) for place in loops.PLACES},
        **dict.fromkeys(("margins", "bandwidths", "noise", "effort", "given"), ()),
        "at_once": {},
        "sample_rate": None,
        "requirements": asked,
    }
    if not loop.stability:
        return found
    margins = tuple(
        margins_of(loop, place, i) for place in loops.PLACES for i in range(len(loop.names(place)))
    )
    return found | {
        "margins": margins,
        "at_once": {where: simultaneous_margins(loop, where) for where in get_args(Where)},
        "bandwidths": performance.bandwidths(loop, margins),
    }
