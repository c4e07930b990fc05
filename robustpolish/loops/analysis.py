"""What a loop is like: margins, bandwidths, noise, effort, sampling; shown, drawn and told."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import Any, Literal, get_args

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.base.budget import single_threaded_blas
from robustpolish.base.checks import instance_of, misfit, one_of
from robustpolish.base.results import Card, Table
from robustpolish.loops import loop as loops
from robustpolish.loops import performance
from robustpolish.loops.margins import Where, margins_of, simultaneous_margins
from robustpolish.loops.pictures import plot_steps
from robustpolish.loops.ranges import proven_range
from robustpolish.loops.report import LoopFigures, details, explain, lines_in_words, tables_of
from robustpolish.loops.requirements import LoopRequirements
from robustpolish.plants.blocks import GivenController
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.robust.questions import RobustStability
from robustpolish.synthesis.design import Design

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

    def tables(self) -> tuple[Table, ...]:
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

    def _card(self) -> Card:
        verdict = "can be built" if self.buildable else "cannot be built as it is"
        state = f"stable, {verdict}" if self.stable else "NOT stable"
        time = "discrete time" if self.loop.is_discrete else "continuous time"
        return Card(f"Loop analysis, {time}: {state}", self.tables(), (self.explain(),))


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

    def _card(self) -> Card:
        state = "stable as counted" if self.stable else "NOT stable as counted"
        return Card(f"Loop analysis of a measured plant: {state}", self.tables(), (self.explain(),))


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
