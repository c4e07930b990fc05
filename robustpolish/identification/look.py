"""What a record holds, before any model: channels, spectra, likely modes, and a first draft."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.base.arrays import Vector
from robustpolish.base.checks import misfit, one_of
from robustpolish.base.results import Card, Displayed, Table, estimate
from robustpolish.base.texts import tables
from robustpolish.errors import InvalidInputError
from robustpolish.identification.draft import draft_model, meaning
from robustpolish.identification.frequency import lines
from robustpolish.identification.observer.kalman import rounding, white_noise
from robustpolish.identification.record import poles_of, require_time_data
from robustpolish.identification.sanity import made_in_loop
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import FORCE
from robustpolish.plots.frequency import plot_bode, plot_over_frequency
from robustpolish.plots.style import new_axes
from robustpolish.plots.time import plot_spectra
from robustpolish.signals import quality
from robustpolish.signals.frequency_response import estimate_frequency_response, labelled_response
from robustpolish.signals.raw import to_si
from robustpolish.signals.read import read_measurement, signals_over_time

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
    modes: dict[str, tuple[lines.Resonance, ...]]
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
    modes: dict[str, list[lines.Resonance]] = {}
    try:
        if moved:
            draft = draft_model(data, sources, moved)
            notes += draft.notes
            modes["draft"] = [
                lines.Resonance(f, np.nan, float(-p.real) / f / (2 * np.pi) + 0.0, np.nan, p)
                for p in sorted(poles_of(draft.model), key=abs)
                for f in [float(abs(p)) / (2 * np.pi)]
                if p.imag > 0
            ]
        if ends and sources:
            response = estimate_frequency_response(data, sources, ends)
            seen = response["coherence"].max(["output", "input"])
            chance = 1 - _CHANCE ** (1 / (response.attrs["averages"] - len(sources)))
            found = lines.measured_resonances(lines.measured_response(None, response))
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
    broken = (steps <= 0) | (steps > (quality.LONGEST_GAP + 1.5) * np.median(steps))
    low, high = between or (-np.inf, np.inf)
    missing = {name: ~np.isfinite(values) for name, values in channels.items()}
    kept = [name for name, gone in missing.items() if 2 * np.count_nonzero(gone) < gone.size]
    lost = (stamps < low) | (stamps > high) | np.insert(broken, 0, False)
    for name in kept:
        for a, b in quality.marked_runs(missing[name]):
            lost[a : b + 1] |= b - a >= quality.LONGEST_GAP or not np.isnan(channels[name][a])
    runs = [(a, b + 1) for a, b in quality.marked_runs(~lost)]
    part = slice(*max(runs, key=lambda run: run[1] - run[0], default=(0, 0)))
    return part, kept, int(np.count_nonzero(broken))


def _channel(
    name: str, values: Vector, unit: str, data: xr.Dataset, roles: Mapping[str, str]
) -> dict[str, Any]:
    """Return what is known of one channel."""
    there, si_unit = to_si(values[np.isfinite(values)], unit, f"unit of {name!r}")
    there = there if there.size else np.array([np.nan])
    moves = float(np.ptp(there)) > 0
    noise = white_noise(data[name].values, quality.sampling_time(data)) if name in data else np.nan
    return {
        "unit": unit, "role": roles.get(name, ""), "si_unit": si_unit,
        "low": float(there.min()), "high": float(there.max()), "mean": float(there.mean()),
        "deviation": float(there.std()), "missing": int(np.count_nonzero(~np.isfinite(values))),
        "at_limit": quality.share_at_limit(there) if moves else 0.0,
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


def _own_modes(data: xr.Dataset, names: Sequence[str]) -> list[lines.Resonance]:
    """Return the peaks of the outputs' own correlation, as it decays like free motion.

    G. H. James, T. G. Carne, J. P. Lauffer, Sandia report SAND92-1666 (1993). An exponential
    window ends it, whose damping is taken off again.
    """
    n, dt = data.sizes["time"], quality.sampling_time(data)
    count = n // 4
    window = np.append(0.5, _FADED ** (np.arange(1, count) / count))
    rows = np.array([data[name].values - data[name].values.mean() for name in names])
    correlation = np.fft.irfft(np.abs(np.fft.rfft(rows, 2 * n)) ** 2)[:, :count]
    curves = np.fft.rfft(correlation * window, 2 * count).T[1:, :, None]
    frequency = np.arange(1, count + 1) / (2 * count * dt)
    found = lines.measured_response(None, labelled_response(frequency, curves, names, ["own"]))
    modes = []
    for mode in lines.measured_resonances(found):
        decay = mode.damping * mode.frequency + np.log(_FADED) / (2 * np.pi * count * dt)  # Hz
        size = float(np.hypot(decay, mode.frequency * np.sqrt(1 - mode.damping**2)))
        modes += [mode._replace(frequency=size, damping=float(decay) / size)] * bool(decay > 0)
    return modes


def _hold(u: Vector) -> str:
    """Say so if an input changes at every so many samples only; by chance few changes do."""
    between = np.diff(np.flatnonzero(np.diff(u)))
    every = int(np.gcd.reduce(between))
    return f"held over {every} samples" if every > 1 and between.size >= _CHANGES else ""
