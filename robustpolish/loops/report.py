"""Can this loop be built, and what limits it: the figures in a paragraph."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import cache, partial
from operator import attrgetter
from typing import Any

import control
import numpy as np
from matplotlib.axes import Axes
from scipy import linalg

from robustpolish.base.arrays import AnyVector
from robustpolish.base.checks import one_of
from robustpolish.base.results import Displayed, Table, bears_prefix, prefix_power, prefixed
from robustpolish.base.texts import paragraphs, tables, templates
from robustpolish.linear.stability import Stability
from robustpolish.loops import performance
from robustpolish.loops.disk_margins import DiskMargin, decibel
from robustpolish.loops.loop import PLACES, Loop, Place, sample_step
from robustpolish.loops.margins import LoopMargins, MarginsAtOnce, Where
from robustpolish.loops.pictures import plot_loops, plot_sigma
from robustpolish.loops.requirements import LoopRequirements
from robustpolish.robust.questions import RobustStability

# What was found out about a loop, and what follows from it, without words and pictures.

_MOST_SHOWN = 5
"""So many single loops are drawn in one picture."""


@dataclass(frozen=True, eq=False, repr=False)
class LoopFigures(Displayed):
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


def tables_of(found: LoopFigures) -> tuple[Table, ...]:
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
        told.append(Table("Sampling", ("rule", "rate [Hz]"), (*rate.rules.items(), *last)))
    return tuple(told)


def _table(caption: str, kind: str, rows: Sequence[Any]) -> Table:
    """Return a table of attributes, by the heads of their columns."""
    columns = _COLUMNS[kind]
    cells = attrgetter(*columns.values())
    return Table(caption, tuple(columns), tuple(cells(row) for row in rows))


_COLUMNS = tables(__file__)["columns"]


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
    return templates("robustpolish.loops", filters).get_template("texts.jinja")


def _said(found: LoopFigures, block: str, **values: Any) -> tuple[str, ...]:
    """Return the sentences of a block of ``texts.jinja``."""
    names = {"frequency": _frequency, "delay": _delay, "speed": _rate}
    words = {name: partial(say, found) for name, say in names.items()}
    return paragraphs(_template(), block, found=found, inf=math.inf, **words, **values)


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
    if noisiest and bears_prefix(unit):  # a metre of noise says little, a micrometre much
        power = max(0, prefix_power(noisiest.rms))
        unit = prefixed(unit, -power)
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
    power = prefix_power(abs(float(digits)))
    return f"{float(digits) / 10**power:.3g} {prefixed(unit, power)}"


def _amount(value: float, unit: str) -> str:
    return f"{value:.3g} {unit}".rstrip()


def _rate(found: LoopFigures, value: float, unit: str) -> str:
    if found.loop.dt is True:
        return f"{_amount(value, unit)} per sample"
    return f"{value:.3g} {unit}/s" if unit else f"{value:.3g} per second"
