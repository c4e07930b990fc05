"""What a loop with a measured plant is like, as far as its lines tell."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import control
import numpy as np
from matplotlib.axes import Axes

from robustpolish.analysis import HinfNorm
from robustpolish.arrays import AnyArray, Vector
from robustpolish.display import Card, Displayed, Table
from robustpolish.loops.figures import LoopFigures
from robustpolish.loops.loop import PLACES, Place
from robustpolish.loops.margins.all_loops import Where
from robustpolish.loops.measured.loop import MeasuredLoop
from robustpolish.loops.measured.margins import (
    largest,
    measured_at_once,
    measured_bandwidths,
    measured_margins,
)
from robustpolish.loops.pictures import over_frequency
from robustpolish.loops.requirements import LoopRequirements
from robustpolish.loops.sensitivities import Sensitivities
from robustpolish.loops.tables import tables_of
from robustpolish.loops.words import (
    at_once_in_words,
    margins_in_words,
    problems,
    quantity,
    verdict,
)
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.given_controller import GivenController
from robustpolish.plotting import plot_bode, plot_gains, plot_nichols, plot_nyquist_disks
from robustpolish.validation import described, invalid, one_of

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

    Its fields are those of :class:`robustpolish.LoopAnalysis`. Stability is counted by Nyquist's
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
        As in :class:`robustpolish.LoopAnalysis`.
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
        at_once={where: measured_at_once(loop, where) for where in get_args(Where)}
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
