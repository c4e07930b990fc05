"""Comparison of a model with measured frequency responses."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robustpolish.base.arrays import AnyArray, Array
from robustpolish.base.checks import described, invalid, one_of, positive
from robustpolish.base.results import Card, Displayed, Table, plus_minus, tables
from robustpolish.identification.frequency.lines import (
    ACCURACY,
    MeasuredResponse,
    Resonance,
    likeness,
    match_modes,
    measured_resonances,
    measured_response,
    model_resonances,
)
from robustpolish.machines.mechanical.data import port_row
from robustpolish.machines.mechanical.linear import linear_system
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.plots.charts import plot_error_bars
from robustpolish.plots.frequency import plot_bode, plot_nyquist


@dataclass(frozen=True)
class PairError:
    """The error of one pair of output and input.

    Attributes
    ----------
    output, input, unit : str
    relative : float
        Error over size, both as root mean squares over lines that are weighed by their size and
        noise: above the noise all lines count alike, antiresonances like resonances, and lines
        in the noise hardly. 1 is no better than no model.
    noise : float
        What of `relative` the noise alone would leave.
    over_noise : float or None
        Root mean square of the error over the noise's standard deviation, where variance or
        coherence say what that is; 1 for the true model.
    likeness : float
        Frequency response assurance criterion, from 0 to 1; it forgives a common factor, and
        hears little but resonances.
    weight : float
        Of the pair among all; the more lines stand above the noise, the more.
    """

    output: str
    input: str
    unit: str
    relative: float
    noise: float
    over_noise: float | None
    likeness: float
    weight: float


@dataclass(frozen=True)
class ModeComparison:
    """A mode of the model beside the measured one.

    Attributes
    ----------
    model_frequency, model_damping : float or None
        In Hz, and as a ratio; None if the model has no such mode.
    frequency, damping : float or None
        As measured; None if it does not show.
    frequency_error, damping_error : float or None
        Standard errors of the measured ones.
    likeness : float or None
        Modal assurance criterion of the two, over the measured pairs.
    """

    model_frequency: float | None
    model_damping: float | None
    frequency: float | None
    damping: float | None
    frequency_error: float | None
    damping_error: float | None
    likeness: float | None


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyComparison(Displayed):
    """Comparison of a model with measured frequency responses.

    Attributes
    ----------
    model : MechanicalModel
    measured, modelled : xarray.DataArray
        Over ``frequency``, ``output`` and ``input``; the model's at the measured lines.
    pairs : dict of (str, str) to PairError
        Errors by output and input.
    modes : tuple of ModeComparison
        From low to high frequency.
    notes : tuple of str
        What has to be known to judge the figures.

    Examples
    --------
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> def machine(stiffness):
    ...     place = ("x", "ground")
    ...     return rp.MechanicalModel(
    ...         [rp.Dof("x", 1.0)], [rp.Spring(place, stiffness)], [rp.Damper(place, 2.0)],
    ...         [rp.Input("F", place)], [rp.Output("x", place)])
    >>> measured = machine(1e4).frequency_response(np.linspace(5, 30, 200))
    >>> comparison = rp.compare(machine(1.1e4), measured)
    >>> mode = comparison.modes[0]
    >>> round(mode.model_frequency, 2), round(mode.frequency, 2)
    (16.69, 15.92)
    >>> sorted(comparison.to_dict())
    ['modes', 'notes', 'overall', 'pairs']
    >>> comparison.plot().get_ylabel(), comparison.plot(kind="nyquist").get_xlabel()
    ('magnitude of x/F', 'real part of x/F [mm/N]')
    >>> len(comparison.plot_panels().axes)  # magnitude and phase
    2
    """

    model: MechanicalModel
    measured: xr.DataArray
    modelled: xr.DataArray
    pairs: Mapping[tuple[str, str], PairError]
    modes: tuple[ModeComparison, ...]
    notes: tuple[str, ...] = ()

    @property
    def relative(self) -> float:
        """Relative error of all pairs together, each with its weight."""
        return combined_error(self.pairs.values())

    @property
    def residual(self) -> xr.DataArray:
        """Measured minus modelled response."""
        return self.measured - self.modelled

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as in the JSON of ``robustpolish compare``.

        Returns
        -------
        dict
        """
        figures = ("relative", "noise", "over_noise", "likeness", "unit")
        return {
            "pairs": {
                "/".join(pair): {name: getattr(error, name) for name in figures}
                for pair, error in self.pairs.items()
            },
            "overall": {"relative": self.relative},
            "modes": [vars(mode) for mode in self.modes],
            "notes": list(self.notes),
        }

    def plot(
        self,
        ax: Axes | None = None,
        *,
        output: str | None = None,
        input: str | None = None,
        kind: Literal["bode", "nyquist"] = "bode",
    ) -> Axes:
        """Draw one pair as measured and as modelled.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default a new figure, for ``"bode"`` with the phase below.
        output, input : str, optional
            The pair with the largest error by default.
        kind : {"bode", "nyquist"}, optional
            Magnitude and phase over frequency, or circles in the complex plane.

        Returns
        -------
        matplotlib.axes.Axes
        """
        one_of("kind", kind, ("bode", "nyquist"))
        left = [
            pair for pair in self.pairs if output in (None, pair[0]) and input in (None, pair[1])
        ]
        if not left:
            one_of("output", output, sorted({pair[0] for pair in self.pairs}))
            one_of("input", input, sorted({pair[1] for pair in self.pairs}))
        pair = max(left or self.pairs, key=lambda key: self.pairs[key].relative)
        curves, unit, spread = self._curves(pair)
        name = "/".join(pair)
        if kind == "nyquist":
            return plot_nyquist(curves, ax, name=name, unit=unit)
        return plot_bode(curves, ax, name=f"magnitude of {name}", unit=unit, spread=spread)

    def plot_panels(self) -> Figure:
        """Draw all pairs: magnitude above phase, measured and modelled.

        Returns
        -------
        matplotlib.figure.Figure
        """
        columns = min(len(self.pairs), 3)
        rows = -(-len(self.pairs) // columns)
        figure = plt.figure(figsize=(5.5 * columns, 4.5 * rows), layout="constrained")
        grid = figure.add_gridspec(rows, columns)
        for k, pair in enumerate(self.pairs):
            part = grid[k // columns, k % columns].subgridspec(2, 1, height_ratios=(2, 1))
            upper = figure.add_subplot(part[0])
            lower = figure.add_subplot(part[1], sharex=upper)
            curves, unit, spread = self._curves(pair)
            name = f"magnitude of {'/'.join(pair)}"
            plot_bode(curves, upper, name=name, unit=unit, spread=spread, phase=lower)
        return figure

    def _curves(
        self, pair: tuple[str, str]
    ) -> tuple[dict[str, xr.DataArray], str, xr.DataArray | None]:
        chosen = {"output": pair[0], "input": pair[1]}
        curves = {"measured": self.measured.sel(chosen), "model": self.modelled.sel(chosen)}
        known = "variance" in self.measured.coords
        spread = self.measured["variance"].sel(chosen) ** 0.5 if known else None
        return curves, self.pairs[pair].unit, spread

    def _card(self) -> Card:
        rows = tuple(
            (f"{e.output}/{e.input}", 100 * e.relative, 100 * e.noise, e.over_noise, e.likeness)
            for e in self.pairs.values()
        )
        columns = ("pair", "error [%]", "of it noise [%]", "error/noise", "likeness")

        def percent(value: float | None, error: float | None = 0.0, scale: float = 100.0) -> Any:
            if value is None or error is None:
                return None
            return plus_minus(scale * value, scale * error)

        modes = tuple(
            (m.model_frequency, percent(m.frequency, m.frequency_error, 1.0),
             m.model_damping and 100 * m.model_damping, percent(m.damping, m.damping_error),
             m.likeness)
            for m in self.modes
        )  # fmt: skip
        heads = ("model [Hz]", "measured [Hz]", "model [%]", "measured [%]", "likeness")
        tables = [Table("", columns, rows)]
        if modes:
            tables.append(Table("Modes: frequency and damping ratio", heads, modes))
        title = f"Comparison (frequency responses), error {100 * self.relative:.2f} %"
        return Card(title, tuple(tables), self.notes)


def compare_frequency_response(model: MechanicalModel, data: Any) -> FrequencyComparison:
    """Hold the linear part of a model against measured frequency responses.

    Parameters
    ----------
    model : MechanicalModel
    data : xarray.DataArray, control.FrequencyResponseData or path
        See :func:`robustpolish.read_frequency_response`.

    Returns
    -------
    FrequencyComparison

    Raises
    ------
    InvalidInputError
        If no pair is the model's, or a unit is of another kind than the model says.
    """
    measured = measured_response(model, data)
    values, remarks = measured.of(model)
    modelled = measured.data.copy(data=np.full(measured.data.shape, np.nan, dtype=complex))
    for column, (output, source) in zip(values.T, measured.pairs, strict=True):
        modelled.loc[{"output": output, "input": source}] = column
    modelled = modelled.drop_vars(["variance", "coherence"], errors="ignore")
    notes = [*(str(note) for note in measured.data.attrs.get("notes", ())), *remarks]
    if not measured.known:
        notes.append("noise taken from the scatter of neighbouring lines")
    pairs = dict(zip(measured.pairs, pair_errors(measured, values), strict=True))
    modes = _modes(model, measured)
    return FrequencyComparison(model, measured.data, modelled, pairs, modes, tuple(notes))


def combined_error(errors: Iterable[PairError]) -> float:
    """Return the relative error of several pairs."""
    each = np.array([(error.weight, error.relative**2) for error in errors])
    return float(np.sqrt(each[:, 0] @ each[:, 1] / np.sum(each[:, 0])))


def pair_errors(measured: MeasuredResponse, modelled: AnyArray) -> list[PairError]:
    """Return the error of each pair.

    Parameters
    ----------
    measured : MeasuredResponse
    modelled : ndarray, shape (lines, pairs)

    Returns
    -------
    list of PairError
    """
    result, spread = [], measured.spread(ACCURACY)
    for k, (output, source) in enumerate(measured.pairs):
        there = measured.there[:, k] & np.isfinite(modelled[:, k])
        H, G = measured.values[there, k], modelled[there, k]
        variance, weights = measured.variance[there, k], spread[there, k] ** -2
        error, size = np.abs(H - G) ** 2, float(weights @ np.abs(H) ** 2)
        over_noise = float(np.sqrt(np.mean(error / variance))) if measured.known else None
        relative, noise = (float(np.sqrt(weights @ e / size)) for e in (error, variance))
        unit, alike = measured.units[k], likeness(H, G)
        result.append(PairError(output, source, unit, relative, noise, over_noise, alike, size))
    return result


def _modes(model: MechanicalModel, measured: MeasuredResponse) -> tuple[ModeComparison, ...]:
    """Put the model's modes and the measured ones side by side."""
    ours, theirs = model_resonances(model, measured), measured_resonances(measured)
    partners = dict(match_modes(ours, theirs))
    low, high = measured.frequency[[0, -1]]
    absent: Any = Resonance(*[None] * 5)  # pyright: ignore[reportArgumentType]
    sides = [(mode, theirs[partners[i]]) for i, mode in enumerate(ours) if i in partners]
    sides += [
        (mode, absent)
        for i, mode in enumerate(ours)
        if i not in partners and low <= mode.frequency <= high
    ]
    sides += [(absent, mode) for j, mode in enumerate(theirs) if j not in partners.values()]
    rows = [
        ModeComparison(
            mode.frequency, mode.damping, seen.frequency, seen.damping, seen.frequency_error,
            seen.damping_error,
            None if absent in (mode, seen) else likeness(mode.shape, seen.shape),
        )
        for mode, seen in sides
    ]  # fmt: skip
    return tuple(sorted(rows, key=lambda row: row.frequency or row.model_frequency or 0.0))


# Detection of nonlinearity by frequency responses at several amplitudes.


Trend = Literal["rises", "falls", "stays"]
_Shape = tuple[Resonance, dict[tuple[str, str], float]]
# Standard errors beyond which a mode's frequency or damping depends on the amplitude, and relative
# errors that the fit of a single pole makes anyway: its neighbours, leakage.
_CHANGED, _SAME_FREQUENCY, _SAME_DAMPING = 4.0, 1e-4, 0.03
# What a mode does as the amplitude grows (frequency, damping), and what would do that.
_CAUSES = tables(__file__)["causes"]


@dataclass(frozen=True, eq=False)
class AmplitudeMode:
    """One mode at several amplitudes.

    Attributes
    ----------
    amplitudes : ndarray, shape (levels,)
        Those at which it was found, rising.
    frequency, frequency_error, damping, damping_error : ndarray, shape (levels,)
        In Hz and as a ratio, with standard errors.
    frequency_trend, damping_trend : {"rises", "falls", "stays"}
        With the amplitude, beyond the scatter.
    character : str
        What that is called.
    effects : tuple of str
        Kinds of the catalogue that would do it.
    places : tuple of ((str, str), float)
        Pairs of coordinates by their relative motion in the model's mode, the largest as 1;
        empty without a model.
    """

    amplitudes: Array
    frequency: Array
    frequency_error: Array
    damping: Array
    damping_error: Array
    frequency_trend: Trend
    damping_trend: Trend
    character: str
    effects: tuple[str, ...]
    places: tuple[tuple[tuple[str, str], float], ...]

    @property
    def linear(self) -> bool:
        """Whether neither frequency nor damping depends on the amplitude."""
        return self.frequency_trend == self.damping_trend == "stays"


@dataclass(frozen=True, eq=False, repr=False)
class AmplitudeDependence(Displayed):
    """Resonances over the amplitude of excitation.

    Attributes
    ----------
    modes : tuple of AmplitudeMode
        From low to high frequency.
    places : tuple of ((str, str), float)
        Pairs that move in the modes which change and rest in those which do not, best first,
        with the difference of their relative motions; empty without a model or a change.
    notes : tuple of str

    Examples
    --------
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> def machine(stiffness):
    ...     place = ("x", "ground")
    ...     return rp.MechanicalModel(
    ...         [rp.Dof("x", 1.0)], [rp.Spring(place, stiffness)], [rp.Damper(place, 2.0)],
    ...         [rp.Input("F", place)], [rp.Output("x", place)])
    >>> lines = np.linspace(10, 25, 300)
    >>> found = rp.identification.amplitude_dependence({
    ...     0.1: machine(1e4).frequency_response(lines),
    ...     1.0: machine(1.1e4).frequency_response(lines)}, machine(1e4))
    >>> found.linear, found.modes[0].character, found.places[0][0]
    (False, 'hardens', ('x', 'ground'))
    >>> found.plot().get_ylabel()
    'change of frequency [%]'
    >>> sorted(found.to_dict())
    ['linear', 'modes', 'notes', 'places']
    >>> print(found.explain().splitlines()[0])
    The machine is not linear: 1 of 1 modes depends on the amplitude.
    """

    modes: tuple[AmplitudeMode, ...]
    places: tuple[tuple[tuple[str, str], float], ...]
    notes: tuple[str, ...] = ()

    @property
    def linear(self) -> bool:
        """Whether no mode depends on the amplitude beyond the data's scatter."""
        return all(mode.linear for mode in self.modes)

    def explain(self) -> str:
        """Say in words what depends on the amplitude, what would do that, and where to look.

        Returns
        -------
        str
        """
        changing = [mode for mode in self.modes if not mode.linear]
        verdict, count = "Linear within the scatter of the data", "none"
        if changing:
            verdict, count = "The machine is not linear", str(len(changing))
        verb = "depend" if len(changing) > 1 else "depends"
        lines = [f"{verdict}: {count} of {len(self.modes)} modes {verb} on the amplitude."]
        for mode in changing:
            f, damping = mode.frequency, 100 * mode.damping
            text = (
                f"The mode at {f[0]:.4g} Hz {mode.character}: {f[0]:.5g} to {f[-1]:.5g} Hz, "
                f"damping ratio {damping[0]:.3g} to {damping[-1]:.3g} %. "
                f"That would do: {', '.join(mode.effects)}."
            )
            if mode.places:
                largest = (" - ".join(pair) for pair, share in mode.places[:3] if share > 0.3)
                text += f" Largest relative motion: {', '.join(largest)}."
            lines.append(text)
        if self.places:
            best = ", ".join(" - ".join(pair) for pair, _ in self.places[:3])
            lines.append(f"Where to look first, by the modes that change and do not: {best}.")
        return "\n".join([*lines, *self.notes])

    def to_dict(self) -> dict[str, Any]:
        """Return the figures for JSON.

        Returns
        -------
        dict
        """
        return {
            "linear": self.linear,
            "modes": [
                {
                    key: value.tolist() if isinstance(value, np.ndarray) else value
                    for key, value in vars(mode).items()
                }
                for mode in self.modes
            ],
            "places": [{"at": list(pair), "score": score} for pair, score in self.places],
            "notes": list(self.notes),
        }

    def plot(
        self, ax: Axes | None = None, *, of: Literal["frequency", "damping"] = "frequency"
    ) -> Axes:
        """Draw frequency or damping of every mode over the amplitude, with 95 % bars.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        of : {"frequency", "damping"}, optional
            The change of frequency against the smallest amplitude, or the damping ratio.

        Returns
        -------
        matplotlib.axes.Axes
        """
        one_of("of", of, ("frequency", "damping"))
        curves, name = {}, "change of frequency" if of == "frequency" else "damping ratio"
        for mode in self.modes:
            first = mode.frequency[0]
            values, error = mode.frequency / first - 1, mode.frequency_error / first
            if of == "damping":
                values, error = mode.damping, mode.damping_error
            labels = {"amplitude": mode.amplitudes, "bar": ("amplitude", 196 * error)}
            curves[f"{first:.4g} Hz"] = xr.DataArray(100 * values, labels, "amplitude")
        return plot_error_bars(curves, name, "%", ax, over="amplitude")

    def _card(self) -> Card:
        rows = tuple(
            (f"{f[0]:.5g} -> {f[-1]:.5g}", mode.frequency_trend,
             f"{100 * mode.damping[0]:.3g} -> {100 * mode.damping[-1]:.3g}", mode.damping_trend,
             mode.character)
            for mode in self.modes for f in [mode.frequency]
        )  # fmt: skip
        columns = ("frequency [Hz]", "trend", "damping [%]", "trend", "the mode")
        verdict = "linear within the scatter" if self.linear else "not linear"
        title = f"Amplitude dependence: {verdict}"
        return Card(title, (Table("", columns, rows),), tuple(self.explain().splitlines()[1:]))


def amplitude_dependence(
    responses: Mapping[float, Any], model: MechanicalModel | None = None
) -> AmplitudeDependence:
    """Find out from responses at several amplitudes what of a machine is not linear.

    The response of a linear machine does not depend on the level of excitation. Of each
    resonance frequency and damping are fitted at every level, with their uncertainty; how they
    move says what kind of effect there is, and the modes that move say where.

    Parameters
    ----------
    responses : mapping of float to frequency response
        By the amplitude of excitation, in any unit; each as for
        :func:`robustpolish.read_frequency_response`. Stepped sines with the amplitude of force
        held show the most; random excitation averages over amplitudes.
    model : MechanicalModel, optional
        Names the places by its modes' shapes.

    Returns
    -------
    AmplitudeDependence

    Raises
    ------
    InvalidInputError
        If there are fewer than two amplitudes, pairs differ, or no resonance stands out.

    References
    ----------
    K. Worden, G. R. Tomlinson, Nonlinearity in Structural Dynamics (2001), sections 2.2 and 3.2.

    Examples
    --------
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> def machine(damping):
    ...     place = ("x", "ground")
    ...     return rp.MechanicalModel(
    ...         [rp.Dof("x", 1.0)], [rp.Spring(place, 1e4)], [rp.Damper(place, damping)],
    ...         [rp.Input("F", place)], [rp.Output("x", place)])
    >>> lines = np.linspace(10, 25, 300)
    >>> levels = {1.0: 4.0, 10.0: 2.0}  # damping falls with the amplitude
    >>> found = rp.identification.amplitude_dependence(
    ...     {level: machine(c).frequency_response(lines) for level, c in levels.items()})
    >>> found.modes[0].effects
    ('coulomb_friction', 'stribeck_friction')
    """
    if len(responses) < 2:
        shown = described(f"{len(responses)} response")
        raise invalid("responses", shown, "two or more amplitudes", "Measure at another level.")
    levels = sorted(responses, key=lambda each: positive("amplitude", each))
    measured = [measured_response(model, responses[level]) for level in levels]
    if any(each.names != measured[0].names for each in measured):
        listed = "; ".join(", ".join(each.names) for each in measured)
        raise invalid("responses", described(listed), "the same pairs", "Select those.")
    found = [measured_resonances(each) for each in measured]
    if not any(found):
        shown, remedy = "no resonance above the noise", "Measure finer about the resonances."
        raise invalid("responses", described(shown), "a resonance", remedy)
    # each resonance, from amplitude to amplitude
    tracks: list[dict[float, Resonance]] = []
    for level, resonances in zip(levels, found, strict=True):
        last = tuple(track[max(track)] for track in tracks)
        partners = {j: i for i, j in match_modes(last, resonances)}
        for j, mode in enumerate(resonances):
            if j in partners:
                tracks[partners[j]][level] = mode
            else:
                tracks.append({level: mode})
    tracks.sort(key=lambda track: track[min(track)].frequency)
    shapes = _model_motion(model, measured[0]) if model is not None else []
    judged = tuple(_mode(track, shapes) for track in tracks if len(track) > 1)
    lone = [f"{m.frequency:.4g} Hz" for t in tracks if len(t) < 2 for m in t.values()]
    notes = (f"seen at one amplitude only, and not judged: {', '.join(lone)}",) if lone else ()
    return AmplitudeDependence(judged, _places(judged), notes)


def _mode(track: Mapping[float, Resonance], shapes: Sequence[_Shape]) -> AmplitudeMode:
    """Return a resonance over the amplitudes, and the relative motions in the model's mode."""
    amplitudes, modes = np.array([*track]), track.values()
    frequency, frequency_error, damping, damping_error, _ = map(np.array, zip(*modes, strict=True))
    by_frequency = _trend(amplitudes, frequency, frequency_error, _SAME_FREQUENCY)
    by_damping = _trend(amplitudes, damping, damping_error, _SAME_DAMPING)
    character, effects = _CAUSES[f"{by_frequency} {by_damping}"]
    pairs = match_modes(tuple(mode for mode, _ in shapes), (track[min(track)],))
    motion = shapes[pairs[0][0]][1] if pairs else {}
    return AmplitudeMode(
        amplitudes, frequency, frequency_error, damping, damping_error, by_frequency, by_damping,
        character, tuple(effects.split()), tuple(sorted(motion.items(), key=lambda item: -item[1])),
    )  # fmt: skip


def _trend(amplitudes: Array, values: Array, errors: Array, same: float) -> Trend:
    """Return whether values rise with the logarithm of the amplitude, beyond their errors."""
    spread = np.hypot(errors, same * values)
    weights = spread**-2
    x = np.log(amplitudes)
    x = x - (weights @ x) / np.sum(weights)
    slope = weights @ (x * values) / (weights @ x**2)
    sigmas = slope * np.sqrt(weights @ x**2)
    if abs(sigmas) < _CHANGED:
        return "stays"
    return "rises" if sigmas > 0 else "falls"


def _model_motion(model: MechanicalModel, measured: MeasuredResponse) -> list[_Shape]:
    """Return the model's modes, each with the relative motion of every pair in it."""
    (A, _, _, _), _ = linear_system(model)
    poles, vectors = np.linalg.eig(A)
    pairs = [*(s.between for s in model.springs), *(d.between for d in model.dampers)]
    pairs += [(name, "ground") for name in model.free]
    unique = {frozenset(pair): pair for pair in reversed(pairs)}
    places = list(reversed(unique.values()))
    rows = np.array([port_row(model, pair) for pair in places])[:, model.matrices.free]
    result = []
    for mode in model_resonances(model, measured):
        nearest = int(np.argmin(np.abs(np.abs(poles) / (2 * np.pi) - mode.frequency)))
        motion = np.abs(rows @ vectors[: len(model.free), nearest])
        motion = motion / max(float(np.max(motion, initial=0.0)), 1e-300)
        result.append((mode, dict(zip(places, motion.tolist(), strict=True))))
    return result


def _places(modes: tuple[AmplitudeMode, ...]) -> tuple[tuple[tuple[str, str], float], ...]:
    """Rank pairs: they move in the modes that change, and rest in those that do not."""
    changing = [dict(mode.places) for mode in modes if not mode.linear and mode.places]
    staying = [dict(mode.places) for mode in modes if mode.linear and mode.places]
    scores = {}
    for pair in changing[0] if changing else ():
        rests = np.mean([motion[pair] for motion in staying]) if staying else 0.0
        scores[pair] = float(np.mean([motion[pair] for motion in changing]) - rests)
    return tuple(sorted(scores.items(), key=lambda item: -item[1]))
