"""What a record holds, before any model: channels, spectra, likely modes, and a first draft."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from scipy.optimize import least_squares, nnls

from robustpolish.base.arrays import AnyArray, Array, Vector
from robustpolish.base.checks import misfit, one_of
from robustpolish.base.results import Card, Displayed, Table, estimate, tables
from robustpolish.errors import InvalidInputError
from robustpolish.identification.frequency import lines as spectral
from robustpolish.identification.observer.kalman import ABOVE_FLOOR, rounding, white_noise
from robustpolish.identification.record import poles_of, require_time_data
from robustpolish.identification.sanity import made_in_loop
from robustpolish.machines.effects.kind import GROUND
from robustpolish.machines.mechanical import parts
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import FORCE
from robustpolish.plots.frequency import plot_bode, plot_over_frequency
from robustpolish.plots.style import new_axes
from robustpolish.plots.time import plot_spectra
from robustpolish.signals import raw
from robustpolish.signals.frequency_response import estimate_frequency_response, labelled_response
from robustpolish.signals.raw import sampling_time, to_si
from robustpolish.signals.read import read_measurement, signals_over_time

# A first mechanical model from a record alone, as a guess to begin with.
#
# The spectra of a whole record obey the equations of motion line by line, but for what its two ends
# differ by, which is a polynomial of low degree in the frequency (Pintelon, Schoukens and
# Vandersteen, IEEE Trans. Automatic Control 42 (1997) 1717-1720). So any excitation will do.


_MEANING = {u: (of, turns) for turns, units in parts.UNITS.items() for of, u in units.items()}
_ORDER = {parts.VELOCITY: 1, parts.ACCELERATION: 2}
# Lines at most: more take time and say no more of a guess; at least; and the share of the mean that
# a tenth of the lines of noise lie below.
_MOST_LINES, _LEAST_LINES, _TENTH = 1000, 20, 0.105
# Rounds of weighted equation errors, steps of a fit, and logarithm by which it may change a number.
_ROUNDS, _STEPS, _FAR = 12, 1000, 14.0
# Coordinates that one force moves at most: with more no record of one force tells their springs.
_MOST = 3
# Log odds for a hold, and mean squares over that of white noise up to which they mean anything: a
# model that lacks more may take a hold for it.
_ODDS, _ADEQUATE = 20.0, 4.0


def meaning(channel: xr.DataArray) -> tuple[str, bool]:
    """Return the quantity of a channel by its unit, "" if it tells none, and whether it turns."""
    return _MEANING.get(str(channel.attrs.get("units", "")), ("", False))


class _Spectra(NamedTuple):
    """Lines of a record: displacements and the factors that make outputs of power one of them.

    Beside them stand the factors of a held force, which is late by half a step and a mean over a
    step, and the share of the outputs' power that may be white noise.
    """

    omega: Array
    motion: AnyArray
    unit: AnyArray
    inputs: AnyArray
    held: AnyArray
    noise: Array

    def of(self, rows: Sequence[int]) -> _Spectra:
        """Return the same of some outputs."""
        one = {name: getattr(self, name)[..., rows] for name in ("motion", "unit", "noise")}
        return self._replace(**one)


def _spectra(data: xr.Dataset, inputs: Sequence[str], outputs: Sequence[str]) -> _Spectra:
    """Return the lines in which outputs stand out of their noise."""
    dt, samples = sampling_time(data), data.sizes["time"]
    rows = np.array([data[name].values for name in (*outputs, *inputs)], dtype=float)
    lines = np.fft.rfft(rows.T - rows.mean(axis=1), axis=0)[1:]
    size = np.sum(np.abs(lines) ** 2, axis=0)[: len(outputs)]
    power = np.sum(np.abs(lines[:, : len(outputs)]) ** 2 / size, axis=1)
    above = np.count_nonzero(power > ABOVE_FLOOR * np.percentile(power, 10) / _TENTH)
    kept = np.sort(np.argsort(-power)[: min(max(above, _LEAST_LINES), _MOST_LINES)])
    omega = np.asarray(2 * np.pi * (kept + 1.0) / (samples * dt), dtype=np.float64)
    order = [_ORDER.get(meaning(data[name])[0], 0) for name in outputs]
    derived = (1j * omega[:, None]) ** order
    Y, U = np.split(lines[kept], [len(outputs)], axis=1)
    noise = np.array([white_noise(row, dt) ** 2 for row in rows[: len(outputs)]])
    held = np.exp(-0.5j * omega * dt) * np.sinc(omega * dt / (2 * np.pi))
    unit = derived / np.sqrt(np.sum(np.abs(Y) ** 2, axis=0))
    return _Spectra(omega, Y / derived, unit, U, held, samples * kept.size * noise / size)


def _without_ends(s: _Spectra, weight: AnyArray, errors: AnyArray) -> Array:
    """Return errors without what the ends of the record may add, real parts above imaginary ones.

    `weight` (lines, outputs, coordinates) is what the equations of motion are multiplied by,
    `errors` has the shape (lines * outputs, anything).
    """
    powers = np.stack([(1j * s.omega / s.omega[-1]) ** k for k in range(-2, 2)], axis=1)
    ends = np.einsum("loi,lk->loik", weight, powers).reshape(len(errors), -1)
    ends, left = (np.concatenate([x.real, x.imag]) for x in (ends, errors))
    basis = np.linalg.qr(ends / np.linalg.norm(ends, axis=0))[0]
    return left - basis @ (basis.T @ left)


def _oscillator(s: _Spectra, force: AnyArray | None) -> tuple[float, Array]:
    """Fit mass, damping and stiffness to one output; without a force the mass is 1.

    The equation error is weighted by the response of the round before (Sanathanan and Koerner,
    IEEE Trans. Automatic Control 8 (1963) 56-58); no number gets negative. What is left is a share
    of the output's power.
    """
    w, free = s.omega, int(force is None)
    columns = np.stack([-(w**2), 1j * w, 1.0 + 0 * w], axis=1)
    both = np.column_stack([columns * s.motion, 0 * w if force is None else -force])
    best, weight = (np.inf, np.ones(3)), s.unit / w[:, None] ** 2
    for _ in range(_ROUNDS):
        A = _without_ends(s, weight[:, :, None], both * weight)
        size = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
        found = nnls(A[:, free:3] / size[free:3], -A[:, 3] - free * A[:, 0])[0] / size[free:3]
        found = np.concatenate([[1.0] * free, found])
        Z = columns @ found
        if not np.all(np.abs(Z) > 0):
            break
        weight = s.unit / Z[:, None]
        left = _without_ends(s, weight[:, :, None], both * weight) @ [*found, 1.0]
        best = min(best, (float(left @ left), found), key=lambda fit: fit[0])
    return best


def _places(n: int) -> list[tuple[int, int]]:
    """Return the places of springs and dampers among coordinates 0 to n - 1; n is the ground."""
    return [*((i, n) for i in range(n)), *combinations(range(n), 2)]


def _errors(s: _Spectra, forces: AnyArray, numbers: Array, slopes: bool = False) -> Array:
    """Return what masses, dampers and springs leave of the outputs, each of power one.

    Or its slopes over the logarithms of the numbers (Kaufman, BIT 15 (1975) 49-57).
    """
    n, w = s.motion.shape[1], s.omega
    B = [np.eye(n + 1)[a, :n] - np.eye(n + 1)[b, :n] for a, b in _places(n)]
    V, each = np.vstack([np.eye(n), B, B]), [n, len(B), len(B)]
    g = np.repeat(np.stack([-(w**2), 1j * w, 1.0 + 0 * w], axis=1), each, axis=1) * numbers
    inverse = np.linalg.inv(np.einsum("lp,pi,pj->lij", g, V, V))
    weight, x = s.unit[:, :, None] * inverse, np.einsum("lij,lj->li", inverse, forces)
    left = _without_ends(s, weight, (s.unit * (x - s.motion)).ravel())
    if not slopes:
        return left
    # The ends of the record act as forces do.
    x = s.motion + np.reshape(left[: x.size] + 1j * left[x.size :], x.shape) / s.unit
    changes = -(weight @ V.T) * (x @ V.T * g)[:, None]
    return _without_ends(s, weight, changes.reshape(x.size, -1))


def _fitted(s: _Spectra, forces: AnyArray, start: Array) -> tuple[float, Array]:
    """Fit positive numbers by least squares from a start."""
    low, high = np.log(start) - _FAR, np.log(start) + _FAR

    def numbers(x: Array) -> Array:
        return np.exp(np.clip(x, low, high))

    def errors(x: Array) -> Array:
        return _errors(s, forces, numbers(x))

    slopes: Any = lambda x: _errors(s, forces, numbers(x), True)  # noqa: E731 (scipy's stub)
    found = least_squares(errors, np.log(start), slopes, method="lm", max_nfev=_STEPS)
    return 2 * float(found.cost), numbers(found.x)


def _group(s: _Spectra, alone: Array, force: AnyArray) -> tuple[float, Array, int, str]:
    """Fit the coordinates that one force moves, from the numbers that each would have alone.

    The start is no machine's: springs and dampers of a like size are everywhere. Those that the
    lines do not need, by Schwarz's criterion, are dropped.

    Returns
    -------
    error : float
    numbers : ndarray
        Masses, then dampings and stiffnesses at :func:`_places`.
    at : int
        The coordinate on which the force acts.
    hold : str
        What the force does between samples, "" where the lines do not tell.
    """
    n, count = s.motion.shape[1], 2 * s.motion.size
    m, c, k = alone.T
    m = np.maximum(m, 1e-3 * np.max(m) or 1.0)
    k = np.maximum(k, 1e-3 * m * s.omega[0] * s.omega[-1])
    c = np.maximum(c, 1e-2 * np.sqrt(k * m))
    between = [[np.sqrt(x[a] * x[b]) for a, b in _places(n)[n:]] for x in (c, k)]
    start = np.concatenate([m, c, between[0], k, between[1]])
    tried = [(*_fitted(s, np.outer(force, row), start), at) for at, row in enumerate(np.eye(n))]
    error, numbers, at = min(tried, key=lambda found: found[0])
    forces, hold = np.outer(force, np.eye(n)[at]), ""
    held = _fitted(s, forces * s.held[:, None], numbers)
    odds = s.motion.size * np.log(error / held[0])
    if abs(odds) > _ODDS and min(error, held[0]) < _ADEQUATE * np.sum(s.noise):
        hold = "held" if odds > 0 else "not held"
    if hold == "held":
        (error, numbers), forces = held, forces * s.held[:, None]
    for i in range(n, numbers.size):
        fewer = np.where(np.arange(numbers.size) == i, 0.0, numbers)
        changed = float(np.sum(_errors(s, forces, fewer) ** 2))
        if changed <= error * count ** (1 / count):
            error, numbers = changed, fewer
    return error, numbers, at, hold


class Draft(NamedTuple):
    """A model as a guess, the share of each output's size that it leaves, and holds of inputs."""

    model: MechanicalModel
    left: dict[str, float]
    holds: dict[str, str]
    notes: list[str]


def draft_model(data: xr.Dataset, inputs: Sequence[str], outputs: Sequence[str]) -> Draft:
    """Make a model of a record, with one coordinate for each output.

    One force moves all coordinates. Of several forces each moves the one that it explains best;
    without any, coordinates move by themselves.

    Parameters
    ----------
    data : xarray.Dataset
        Uniform over ``time``.
    inputs, outputs : sequence of str
        Columns; what is no force by its unit is taken for one, with a gain.

    Returns
    -------
    Draft
    """
    kind = {name: meaning(data[name]) for name in (*inputs, *outputs)}
    unit = {n: None if of else data[n].attrs.get("units") or None for n, (of, _) in kind.items()}
    s = _spectra(data, inputs, outputs)
    fits: dict[tuple[int, str, int], tuple[float, Array]] = {}
    for k, o in enumerate(outputs):
        for i, force in zip(inputs, s.inputs.T, strict=True):
            if kind[i][0] != parts.FORCE or kind[i][1] == kind[o][1] or not kind[o][0]:
                fits |= {(k, i, g): _oscillator(s.of([k]), g * force) for g in (1, -1)}
        if not inputs:
            fits[k, str(k), 1] = _oscillator(s.of([k]), None)
    order, groups = sorted(fits, key=lambda key: fits[key][0]), dict[str, list[tuple[int, int]]]()
    for k, i, g in order:
        taken = {k for members in groups.values() for k, _ in members}
        room = _MOST if len(inputs) == 1 else 1
        if k not in taken and len(groups.get(i, [])) < room:
            groups.setdefault(i, []).append((k, g))
    made: dict[str, Any] = {f"{n}s": [] for n in ("dof", "damper", "spring", "input", "output")}
    notes, left, holds = list[str](), dict[str, float](), dict[str, str]()
    for i, members in groups.items():
        rows, names = [k for k, _ in members], [outputs[k] for k, _ in members]
        alone = [next(fits[key] for key in order if key[:2] == (k, i)) for k in rows]
        (error, numbers), at, known = alone[0], 0, False
        if i in inputs:
            force, known = members[0][1] * s.inputs[:, inputs.index(i)], kind[i][0] == parts.FORCE
            error, numbers, at, holds[i] = _group(
                s.of(rows), np.array([a for _, a in alone]), force
            )
        # Where nothing has a unit of force, only ratios of the numbers are known.
        scale = 1.0 if known else float(numbers[at])
        if not known:
            notes.append(
                f"{names[at]}: no force in N or N m is known to move it, its mass is set to 1"
            )
        if i in inputs:
            gain = members[0][1] / scale
            made["inputs"].append(parts.Input(i, (names[at], GROUND), None, gain, unit[i]))
        m, c, k = np.split(numbers / scale, [len(rows), len(rows) + len(_places(len(rows)))])
        for name, mass in zip(names, m, strict=True):
            turns = kind[name][1] or (not kind[name][0] and i in inputs and kind[i][1])
            made["dofs"].append(parts.Dof(name, float(mass), turns))
            of = kind[name][0] or parts.DISPLACEMENT
            made["outputs"].append(parts.Output(name, (name, GROUND), of, unit=unit[name]))
            left[name] = float(np.sqrt(error / len(rows)))
        for (a, b), *numbers in zip(_places(len(rows)), c.tolist(), k.tolist(), strict=True):
            ends = ([*names, GROUND][a], [*names, GROUND][b])
            for what, part, number in zip(
                ("dampers", "springs"), (parts.Damper, parts.Spring), numbers, strict=True
            ):
                made[what] += [part(ends, number)] * (number > 0)
    if rest := [o for o in outputs if o not in left]:
        notes.append(f"{', '.join(rest)}: not in the draft, what moves it is not known")
    model = MechanicalModel(**made, name="draft: every number is a guess")
    for i in (i for i, hold in holds.items() if hold == "held"):
        model = model.with_effect("input_hold", (i,), {"order": 0.0})
    return Draft(model, left, holds, notes)


_WORDS = tables(__file__)["look"]
# Share of its size that an input has of its own at least: below, it is a sum of the others.
_OWN = 0.1
# What is left of an autocorrelation under its window.
_FADED = 0.01
# Probability with which a coherence comes about by chance where a mode is one.
_CHANCE = 0.01
# Samples below which there is nothing to look at, and steps of an input below which it may be
# chance that all are multiples of one number.
_FEWEST, _CHANGES = 40, 8


@dataclass(frozen=True, eq=False, repr=False)
class RecordLook(Displayed):
    """A record before any model, and a draft of a model.

    Attributes
    ----------
    data : xarray.Dataset
        The part of the record that can be read, in SI units.
    channels : dict of str to dict
        All channels of the record by name: "unit" as the file says it ("" if it says none), "role"
        (what it is taken for), and in "si_unit": "low", "high", "mean", "deviation", "step" (the
        distance of neighbouring values, of a converter or of rounding; 0 if there is none) and
        "noise" (standard deviation of white noise, at most: the quietest band of the spectrum);
        "missing" samples, and the share of samples "at_limit", which is run into at full speed.
    sampling : dict of str to float
        "samples", median "step", "shortest" and "longest" step in s, and "gaps".
    modes : dict of str to tuple of Resonance
        Modes of the "draft", and peaks of the frequency "response", as far as they follow from the
        inputs; without inputs of the correlation of the "motion". Frequency in Hz, damping ratio
        and their standard errors.
    response : xarray.DataArray or None
        Frequency responses with coherence; None without inputs, or if the record is too short.
    loop : {"yes", "no sign", "not known"}
        Whether past outputs predict an input that its own past does not, as in a feedback loop.
    holds : dict of str to str
        Of each input "held", "not held", "held over 5 samples" or "not known".
    left : dict of str to float
        Share of each output's size that the draft leaves in the lines that it was fitted to.
    draft : MechanicalModel or None
        A model whose numbers are guesses; None if none could be made.
    options : tuple of str
        What `robustpolish compare` needs to read the record as it was read here, beside the options
        of this call.
    notes : tuple of str

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> import robustpolish as rp
    >>> from robustpolish.simulation import simulate_model
    >>> place = ("x", "ground")
    >>> machine = rp.MechanicalModel(
    ...     [rp.Dof("x", 2.0)], [rp.Spring(place, 3e4)], [rp.Damper(place, 9.0)],
    ...     [rp.Input("F", place)], [rp.Output("x", place)])
    >>> time = np.arange(8000) / 1000
    >>> force = np.random.default_rng(0).normal(size=time.size)
    >>> table = pd.DataFrame({"time [s]": time, "F [N]": force})
    >>> table["x [m]"] = simulate_model(machine, rp.read_measurement(table)).outputs[:, 0]
    >>> found = rp.look(table)
    >>> round(found.modes["draft"][0].frequency, 1), round(found.draft.dof("x").mass, 2), found.loop
    (19.5, 2.0, 'no sign')
    >>> sorted(found.to_dict())[:4], found.plot().get_ylabel()
    (['channels', 'draft', 'holds', 'left'], 'magnitude')
    >>> print(found.explain().splitlines()[0])
    8000 samples at 1000 Hz, 2 channels, 0 gaps
    """

    data: xr.Dataset
    channels: dict[str, dict[str, Any]]
    sampling: dict[str, float]
    modes: dict[str, tuple[spectral.Resonance, ...]]
    response: xr.DataArray | None
    loop: Literal["yes", "no sign", "not known"]
    holds: dict[str, str]
    left: dict[str, float]
    draft: MechanicalModel | None
    options: tuple[str, ...]
    notes: tuple[str, ...]

    def explain(self) -> str:
        """Say in words what the record holds, and which command comes next.

        Returns
        -------
        str
        """
        rate = 1 / self.sampling["step"]
        count, gaps = f"{self.sampling['samples']:.0f} samples", f"{self.sampling['gaps']:.0f} gaps"
        says = [f"{count} at {rate:.6g} Hz, {len(self.channels)} channels, {gaps}", *self.notes]
        says += [_WORDS["loop"][self.loop]]
        says += [f"{name} between its samples: {hold}" for name, hold in self.holds.items()]
        if self.draft is not None:
            rest = ", ".join(f"{name} {100 * share:.2g} %" for name, share in self.left.items())
            says.append(f"The draft's numbers are guesses; it leaves of the outputs: {rest}")
            says.append(" ".join([_WORDS["next"], *self.options]))
        return "\n".join(says)

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the signals as plain values, such as for JSON.

        Returns
        -------
        dict
        """
        found = {k: v for k, v in vars(self).items() if k not in ("data", "response")}
        kept = ("frequency", "frequency_error", "damping", "damping_error")
        modes = {
            place: [{name: getattr(mode, name) for name in kept} for mode in modes]
            for place, modes in self.modes.items()
        }
        return {**found, "modes": modes, "draft": self.draft and self.draft.to_toml()}

    def plot(
        self,
        ax: Axes | None = None,
        *,
        of: Literal["response", "coherence", "spectra"] = "response",
    ) -> Axes:
        """Draw frequency responses, their coherence, or the spectra of all channels.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        of : {"response", "coherence", "spectra"}, optional
            Without a response spectra are drawn.

        Returns
        -------
        matplotlib.axes.Axes
        """
        one_of("of", of, ("response", "coherence", "spectra"))
        if of == "spectra" or self.response is None:
            return plot_spectra({str(n): c for n, c in self.data.items()}, new_axes(ax))
        ends = itertools.product(self.response["output"].values, self.response["input"].values)
        curves = {f"{o}/{i}": self.response.sel(output=o, input=i) for o, i in ends}
        if of == "response":
            units = {str(curve["units"].item()) for curve in curves.values()}
            return plot_bode(curves, ax, unit=units.pop() if len(units) == 1 else "")
        shown = {n: c["coherence"].reset_coords(drop=True) for n, c in curves.items()}
        return plot_over_frequency(xr.Dataset(shown), "coherence", ax)

    def _card(self) -> Card:
        rows = tuple(
            (name, *(c[key] for key in _WORDS["columns"])) for name, c in self.channels.items()
        )
        modes = tuple(
            (place, *estimate(*mode[:2]), *estimate(*mode[2:4]))
            for place, found in self.modes.items()
            for mode in found
        )
        shown = [Table("Channels", ("channel", *_WORDS["columns"].values()), rows)]
        shown += [Table("Likely modes", tuple(_WORDS["modes"]), modes)] * bool(modes)
        title, *sentences = self.explain().splitlines()
        return Card(f"Record: {title}", tuple(shown), tuple(sentences))


def look(
    source: Any,
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    between: tuple[float, float] | None = None,
    **how: Any,
) -> RecordLook:
    """Look at a record before there is a model, and draft one.

    Nothing in the record is refused: gaps, limits and constant channels are told, and what can be
    read is looked at further.

    Parameters
    ----------
    source : path, pandas.DataFrame, pandas.Series, xarray.Dataset or xarray.DataArray
        As for :func:`robustpolish.read_measurement`.
    inputs, outputs : sequence of str, optional
        Channels that drive the machine, and that tell its motion. By default inputs are those with
        a unit of force, torque, voltage or current, or with a name such as ``cmd``.
    between : (float, float), optional
        First and last time in s to be looked at.
    **how
        units, time, rename, sampling_rate, table and max_bytes as for
        :func:`robustpolish.read_measurement`.

    Returns
    -------
    RecordLook

    Raises
    ------
    InvalidInputError
        If the file cannot be read, has no time, or lacks a channel that was asked for.

    Notes
    -----
    A record is made in a feedback loop if the outputs' past predicts an input better than the
    input's own past does (C. W. J. Granger, Econometrica 37 (1969) 424-438), by Schwarz's
    criterion. A loop without noise and an input that repeats may stay unseen.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> import robustpolish as rp
    >>> time = np.arange(2000) / 1000
    >>> swing = np.exp(-2 * time) * np.cos(2 * np.pi * 20 * time)
    >>> found = rp.look(pd.DataFrame({"time [s]": time, "x [mm]": swing}))
    >>> mode = found.modes["motion"][0]
    >>> print(f"{mode.frequency:.2f} Hz, {100 * mode.damping:.1f} %")
    20.00 Hz, 1.6 %
    """
    require_time_data(source)
    raw, stamps, channels = signals_over_time(source, None, (), **how)
    part, kept, gaps = _readable(stamps, channels, between)
    if part.stop - part.start < _FEWEST:
        remedy = "Record for longer, or choose another part."
        raise misfit("measurement", "no longer part without a gap", f"{_FEWEST} samples", remedy)
    options, notes = (), [*raw.notes, *(f"{n} lacks values" for n in channels.keys() - kept)]
    if part.stop - part.start < stamps.size:
        options = (f"--between {stamps[part][0]:.9g} {stamps[part][-1]:.9g}",)
        notes.append("only the longest part without a gap is looked at further")
    columns = {n: ("time", channels[n][part], {"units": raw.units.get(n, "")}) for n in kept}
    whole = xr.Dataset(columns, {"time": stamps[part]}, {"notes": notes})
    data = read_measurement(whole, at_limit=kept)
    sources, ends = _roles(data, inputs, outputs)
    moved = [name for name in ends if meaning(data[name])[0] != FORCE]
    notes = [*data.notes, *(f"{n}: no unit, taken as m" for n in moved if not data[n].units)]
    notes += ["no channel is known as an input by its unit or name"] * (not sources)
    draft = response = None
    modes: dict[str, list[spectral.Resonance]] = {}
    try:
        if moved:
            draft = draft_model(data, sources, moved)
            notes += draft.notes
            modes["draft"] = [
                spectral.Resonance(f, np.nan, float(-p.real) / f / (2 * np.pi) + 0.0, np.nan, p)
                for p in sorted(poles_of(draft.model), key=abs)
                for f in [float(abs(p)) / (2 * np.pi)]
                if p.imag > 0
            ]
        if ends and sources:
            response = estimate_frequency_response(data, sources, ends)
            seen = response["coherence"].max(["output", "input"])
            chance = 1 - _CHANCE ** (1 / (response.attrs["averages"] - len(sources)))
            found = spectral.measured_resonances(spectral.measured_response(None, response))
            modes["response"] = [m for m in found if seen.interp(frequency=m.frequency) > chance]
        elif ends:
            modes["motion"] = _own_modes(data, ends)
    except (InvalidInputError, ArithmeticError, np.linalg.LinAlgError) as error:
        notes.append(f"not all can be computed: {error}")
    own = draft.holds if draft else {}
    roles = {**dict.fromkeys(sources, "input"), **dict.fromkeys(ends, "output")}
    steps = np.diff(stamps)
    sampling = {"samples": stamps.size, "step": float(np.median(steps)), "gaps": gaps}
    sampling |= {"shortest": float(steps.min()), "longest": float(steps.max())}
    return RecordLook(
        data,
        {n: _channel(n, v, raw.units.get(n, ""), data, roles) for n, v in channels.items()},
        sampling,
        {place: tuple(found) for place, found in modes.items()},
        response,
        made_in_loop(data, sources, ends),
        {i: _hold(data[i].values) or own.get(i) or "not known" for i in sources},
        draft.left if draft else {},
        draft.model if draft else None,
        options,
        tuple(notes),
    )


def _readable(
    stamps: Vector, channels: Mapping[str, Vector], between: tuple[float, float] | None
) -> tuple[slice, list[str], int]:
    """Return the longest part without a gap, the channels that have values, and how many gaps."""
    steps = np.diff(stamps)
    broken = (steps <= 0) | (steps > (raw.LONGEST_GAP + 1.5) * np.median(steps))
    low, high = between or (-np.inf, np.inf)
    missing = {name: ~np.isfinite(values) for name, values in channels.items()}
    kept = [name for name, gone in missing.items() if 2 * np.count_nonzero(gone) < gone.size]
    lost = (stamps < low) | (stamps > high) | np.insert(broken, 0, False)
    for name in kept:
        for a, b in raw.marked_runs(missing[name]):
            lost[a : b + 1] |= b - a >= raw.LONGEST_GAP or not np.isnan(channels[name][a])
    runs = [(a, b + 1) for a, b in raw.marked_runs(~lost)]
    part = slice(*max(runs, key=lambda run: run[1] - run[0], default=(0, 0)))
    return part, kept, int(np.count_nonzero(broken))


def _channel(
    name: str, values: Vector, unit: str, data: xr.Dataset, roles: Mapping[str, str]
) -> dict[str, Any]:
    """Return what is known of one channel."""
    there, si_unit = to_si(values[np.isfinite(values)], unit, f"unit of {name!r}")
    there = there if there.size else np.array([np.nan])
    moves = float(np.ptp(there)) > 0
    noise = white_noise(data[name].values, raw.sampling_time(data)) if name in data else np.nan
    return {
        "unit": unit, "role": roles.get(name, ""), "si_unit": si_unit,
        "low": float(there.min()), "high": float(there.max()), "mean": float(there.mean()),
        "deviation": float(there.std()), "missing": int(np.count_nonzero(~np.isfinite(values))),
        "at_limit": raw.share_at_limit(there) if moves else 0.0,
        "step": rounding(there) * 12**0.5 if moves else 0.0, "noise": noise if moves else 0.0,
    }  # fmt: skip


def _roles(
    data: xr.Dataset, inputs: Sequence[str] | None, outputs: Sequence[str] | None
) -> tuple[list[str], list[str]]:
    """Return inputs and outputs as they were asked for, or by units and names."""
    for name in (*(inputs or ()), *(outputs or ())):
        if name not in data:
            known = ", ".join(map(str, data))
            raise misfit("inputs and outputs", f"no channel {name!r}", known, "Correct the name.")
    drives, moves, commands = list[str](), list[str](), list[str]()
    for name in (str(n) for n, c in data.items() if np.ptp(c.values) > 0):
        words, kind = {*re.findall("[a-z]+", name.casefold())}, meaning(data[name])[0]
        known = kind == FORCE or data[name].units in _WORDS["drives"]["units"]
        if not kind or kind == FORCE:
            known |= bool(words & {*_WORDS["drives"]["names"], *_WORDS["drives"]["commands"]})
        told = bool(kind and words & {*_WORDS["drives"]["commands"]})
        (drives if known else commands if told else moves).append(name)
    sources = list(inputs or ())
    # Of inputs that add up to each other the last ones count: files go along the loop.
    for name in reversed((drives or commands) if inputs is None else ()):
        if name not in (outputs or ()):
            u, rows = data[name].values, [data[n].values for n in sources]
            others = np.array([np.ones_like(u), *rows])
            left = np.std(u - np.linalg.lstsq(others.T, u)[0] @ others)
            sources = [name] * bool(left > _OWN * np.std(u)) + sources
    moves = [n for n in moves if n not in sources]
    meant = [n for n in moves if meaning(data[n])[0]] or moves
    return sources, meant if outputs is None else list(outputs)


def _own_modes(data: xr.Dataset, names: Sequence[str]) -> list[spectral.Resonance]:
    """Return the peaks of the outputs' own correlation, as it decays like free motion.

    G. H. James, T. G. Carne, J. P. Lauffer, Sandia report SAND92-1666 (1993). An exponential
    window ends it, whose damping is taken off again.
    """
    n, dt = data.sizes["time"], raw.sampling_time(data)
    count = n // 4
    window = np.append(0.5, _FADED ** (np.arange(1, count) / count))
    rows = np.array([data[name].values - data[name].values.mean() for name in names])
    correlation = np.fft.irfft(np.abs(np.fft.rfft(rows, 2 * n)) ** 2)[:, :count]
    curves = np.fft.rfft(correlation * window, 2 * count).T[1:, :, None]
    frequency = np.arange(1, count + 1) / (2 * count * dt)
    found = spectral.measured_response(None, labelled_response(frequency, curves, names, ["own"]))
    modes = []
    for mode in spectral.measured_resonances(found):
        decay = mode.damping * mode.frequency + np.log(_FADED) / (2 * np.pi * count * dt)  # Hz
        size = float(np.hypot(decay, mode.frequency * np.sqrt(1 - mode.damping**2)))
        modes += [mode._replace(frequency=size, damping=float(decay) / size)] * bool(decay > 0)
    return modes


def _hold(u: Vector) -> str:
    """Say so if an input changes at every so many samples only; by chance few changes do."""
    between = np.diff(np.flatnonzero(np.diff(u)))
    every = int(np.gcd.reduce(between))
    return f"held over {every} samples" if every > 1 and between.size >= _CHANGES else ""
