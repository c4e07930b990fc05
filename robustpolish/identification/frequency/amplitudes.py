"""Detection of nonlinearity by frequency responses at several amplitudes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.base.arrays import Array
from robustpolish.base.checks import described, invalid, one_of, positive
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.base.texts import tables
from robustpolish.identification.frequency.lines import (
    MeasuredResponse,
    Resonance,
    match_modes,
    measured_resonances,
    measured_response,
    model_resonances,
)
from robustpolish.machines.mechanical.data import port_row
from robustpolish.machines.mechanical.linear import linear_system
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.plots.charts import plot_error_bars

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
