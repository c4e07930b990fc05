"""Measured records checked against a model, as arrays, cut into contiguous pieces.

Several records stand one behind the other in the arrays. What knows of time, such as a run, an
observer or the derivative of an input, begins anew with each of them.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, combinations, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import control
import numpy as np
import pandas as pd
import xarray as xr

from robustpolish.base.arrays import AnyArray, Array
from robustpolish.base.checks import described, invalid, misfit, one_of
from robustpolish.errors import InvalidInputError
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.loop import LoopCourse, followed, with_commands
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Input, Output
from robustpolish.machines.simulation import IntersampleLines, lines, raw_outputs, signals
from robustpolish.signals.forces import decimate
from robustpolish.signals.frequency_response import holds_frequency_response
from robustpolish.signals.raw import same_kind, sampling_time
from robustpolish.signals.read import read_measurement

# Concatenation of several records in one dataset, each with its name and its own time.
#
# The time of the joined dataset runs on, so that it can be drawn and cut as any other. Its
# coordinates say to which record a sample belongs, and when it was on that record's own clock.

_RECORD, _OWN_TIME = "record", "own_time"
_ONLY = "record 1"  # the name of a record that has none

_SAME_RATE = 1e-4
"""Relative difference of sampling rates that the rounding of times may make."""


def named_records(data: Any) -> dict[str, Any]:
    """Return the records that a user gave, by name.

    Parameters
    ----------
    data : xarray.Dataset, path or pandas.DataFrame, or a sequence or mapping of them
        In a sequence files go by their names, all others are called "record 1" and so on. A
        joined dataset is taken apart.

    Returns
    -------
    dict
        In the order given.

    Raises
    ------
    InvalidInputError
        If there is no record at all, or something that is none.
    """
    if isinstance(data, xr.Dataset):
        return split_joined(data)
    columns = (
        isinstance(data, Mapping)
        and data
        and all(
            isinstance(values, list | tuple | np.ndarray | int | float) for values in data.values()
        )
    )
    if isinstance(data, Mapping) and not columns:
        found = {str(name): record for name, record in data.items()}
    elif isinstance(data, list | tuple):
        numbered = [f"record {i + 1}" for i in range(len(data))]
        names = [
            Path(record).stem if isinstance(record, str | Path) else number
            for record, number in zip(data, numbered, strict=True)
        ]
        unique = len(set(names)) == len(names)
        found = dict(zip(names if unique else numbered, data, strict=True))
    else:
        return {_ONLY: data}
    if not found:
        raise misfit("data", "no record at all", "one or more", "Pass a record, or a list of them.")
    for name, record in found.items():
        if holds_frequency_response(record):
            remedy = "Pass frequency responses alone, all pairs in one array."
            raise misfit("data", f"frequency responses as {name!r}", "records over time", remedy)
        tables = xr.Dataset | pd.DataFrame | str | Path | Mapping | control.TimeResponseData
        if not isinstance(record, tables):
            shown = described(f"{type(record).__name__} as {name!r}")
            raise invalid("data", shown, "datasets, tables or paths", "Read it first.")
    return found


def split_joined(data: xr.Dataset) -> dict[str, xr.Dataset]:
    """Return the records of a joined dataset by name, each over its own time again.

    Parameters
    ----------
    data : xarray.Dataset
        A dataset that is not joined is one record.

    Returns
    -------
    dict of str to xarray.Dataset
    """
    if not {_RECORD, _OWN_TIME} <= set(data.coords) or data[_RECORD].dims != ("time",):
        return {_ONLY: data}
    labels = data[_RECORD].values
    begins = np.flatnonzero(np.append(True, labels[1:] != labels[:-1]))
    found = {}
    for begin, end in zip(begins, [*begins[1:], labels.size], strict=True):
        part = data.isel(time=slice(int(begin), int(end)))
        time = ("time", part[_OWN_TIME].values, dict(data["time"].attrs))
        found[str(labels[begin])] = part.drop_vars([_RECORD, _OWN_TIME]).assign_coords(time=time)
    return found


def join_records(records: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return records one behind the other.

    Parameters
    ----------
    records : mapping of str to xarray.Dataset
        Over uniform ``time``, of one sampling step.

    Returns
    -------
    xarray.Dataset
        The only record as it is. Of several the channels that all have, over a ``time`` that runs
        on, with the coordinates ``record`` (name) and ``own_time``.

    Examples
    --------
    >>> import xarray as xr
    >>> small = xr.Dataset({"x": ("time", [0.0, 1.0])}, {"time": [0.0, 0.1]})
    >>> both = join_records({"small": small, "large": 5 * small})
    >>> both["x"].values.tolist(), both["record"].values.tolist()
    ([0.0, 1.0, 0.0, 5.0], ['small', 'small', 'large', 'large'])
    >>> split_joined(both)["large"]["time"].values.tolist()
    [0.0, 0.1]
    """
    first, *others = records.values()
    if not others:
        return first
    shared = [
        name
        for name, channel in first.data_vars.items()
        if channel.dims == ("time",) and all(name in other for other in others)
    ]
    step, begin = sampling_time(first), float(first["time"].values[0])
    sizes = [data.sizes["time"] for data in records.values()]
    time = begin + step * np.arange(sum(sizes))
    own = np.concatenate([np.asarray(d["time"].values, dtype=float) for d in records.values()])
    coordinates = {
        "time": ("time", time, {"units": "s"}),
        _RECORD: ("time", np.repeat(list(records), sizes)),
        _OWN_TIME: ("time", own, {"units": "s"}),
    }
    values = {name: np.concatenate([d[name].values for d in records.values()]) for name in shared}
    channels = {name: ("time", values[name], first[name].attrs) for name in shared}
    notes = [f"{name}: {note}" for name, d in records.items() for note in d.attrs.get("notes", ())]
    return xr.Dataset(channels, coordinates, {**first.attrs, "notes": notes})


def with_common_step(records: Mapping[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    """Return the records sampled alike, at the step of the slowest.

    Parameters
    ----------
    records : mapping of str to xarray.Dataset

    Returns
    -------
    dict of str to xarray.Dataset
        Faster ones are decimated, with a note.

    Raises
    ------
    InvalidInputError
        If a rate is no whole multiple of the lowest.
    """
    steps = {name: sampling_time(data) for name, data in records.items()}
    slowest = max(steps, key=lambda name: steps[name])
    found, least = {}, 1 / steps[slowest]
    for name, data in records.items():
        times = steps[slowest] / steps[name]
        if abs(times / round(times) - 1) > _SAME_RATE:
            rates = f"{name!r} sampled at {1 / steps[name]:.6g} Hz, {slowest!r} at {least:.6g} Hz"
            wanted = "one sampling rate, or whole multiples of the lowest"
            remedy = "Resample one of them, or use the records apart."
            raise invalid("data", described(rates), wanted, remedy)
        found[name] = data if round(times) == 1 else decimate(data, least)
    return found


_REPEATS = 0.98
"""Correlation of inputs with themselves, a period later, from which they repeat."""


@dataclass(frozen=True, eq=False)
class Record:
    """Data that a model can be held against, one record or several, or a part of them.

    Attributes
    ----------
    sets : tuple of xarray.Dataset
        Inputs and outputs over uniform ``time``, of each whole record: derivatives and delays of
        inputs do not know where a part begins.
    names : tuple of str
        Of the records.
    data : xarray.Dataset
        All of them, one behind the other, see
        :func:`robustpolish.identification.record.join_records`.
    times : ndarray
        Their times in s, each on its own clock.
    dt : float
        Sampling step in s.
    Y : ndarray, shape (samples, ny)
        Measured outputs of this part, in the model's order.
    first : int
        Where this part begins, counted through all records.
    honest : float
        Share of half the sampling rate up to which the spectra are those of the machine and its
        sensors; above it a filter may have taken their noise.
    """

    sets: tuple[xr.Dataset, ...]
    names: tuple[str, ...]
    data: xr.Dataset
    times: Array
    dt: float
    Y: Array
    first: int = 0
    honest: float = 1.0

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.Y.shape[0]

    @property
    def time(self) -> Array:
        """Times of the samples in s, on the clock of each record."""
        return self.own(self.times)

    @property
    def axis(self) -> Array:
        """Times in s that run on from record to record, to draw over."""
        return self.own(np.asarray(self.data["time"].values, dtype=float))

    @property
    def marks(self) -> list[int]:
        """Where records begin, counted through all of them, and the end."""
        return [0, *accumulate(data.sizes["time"] for data in self.sets)]

    @property
    def name(self) -> str:
        """Name of the record in which this part begins."""
        return self.names[bisect_right(self.marks, self.first) - 1]

    @property
    def parts(self) -> tuple[Record, ...]:
        """What of each record belongs to this part: the contiguous pieces of it."""
        inside = [m - self.first for m in self.marks if 0 < m - self.first < self.samples]
        return tuple(self.part(*ends) for ends in pairwise([0, *inside, self.samples]))

    def follows(self, other: Record) -> bool:
        """Return whether this part goes on where another ends, in the same record."""
        return other.first + other.samples == self.first and self.first not in self.marks

    def own(self, rows: Array) -> Array:
        """Return the rows of this part, of one for each sample of all records."""
        return rows[self.first : self.first + self.samples]

    def part(self, begin: int, end: int) -> Record:
        """Return the samples from `begin` up to `end`."""
        return replace(self, Y=self.Y[begin:end], first=self.first + begin)

    def signals(self, model: MechanicalModel) -> Array:
        """Return a model's input signals over all records, shape (samples, signals).

        See `machines.simulation.run.signals`; those of this part are ``own`` of it.
        """
        return np.concatenate([signals(model, data) for data in self.sets])

    def lines(self, model: MechanicalModel) -> IntersampleLines | None:
        """Return what a model's signals do between the samples, None if all are linear.

        See :func:`robustpolish.machines.simulation.lines`; over all records, as `signals`.
        """
        return joined_lines([lines(model, data) for data in self.sets])

    def own_lines(self, found: IntersampleLines | None) -> IntersampleLines | None:
        """Return the lines of this part, of those over all records."""
        return None if found is None else IntersampleLines(*map(self.own, found))

    def loop_course(self, model: MechanicalModel) -> LoopCourse | None:
        """Return how controllers of a model follow all records, None if it has none."""
        if not model.feedback:
            return None
        each = [followed(model, data) for data in self.sets]
        return LoopCourse(*(np.concatenate(part) for part in zip(*each, strict=True)))

    def raw_outputs(self, model: MechanicalModel) -> Array:
        """Return the measured outputs as a model without effects on signals shows them."""
        return raw_outputs(model, self.Y, self.time)


def joined_lines(each: Sequence[IntersampleLines | None]) -> IntersampleLines | None:
    """Return lines one behind the other, those that are known; None if none are."""
    known = [found for found in each if found is not None]
    joined = (np.concatenate(side) for side in zip(*known, strict=True))
    return IntersampleLines(*joined) if known else None


class Measured(NamedTuple):
    """A model with the outputs that a record holds.

    Attributes
    ----------
    model : MechanicalModel
    record : Record
    notes : tuple of str
        Which outputs were left out, and which modes the record cannot show.
    """

    model: MechanicalModel
    record: Record
    notes: tuple[str, ...]


def measured(model: MechanicalModel, data: Any, outputs: Sequence[str] | None = None) -> Measured:
    """Leave out the outputs of a model that were not measured, and check the others.

    Parameters
    ----------
    model : MechanicalModel
    data : xarray.Dataset, path or pandas.DataFrame, or a sequence or mapping of them
    outputs : sequence of str, optional
        Outputs that are used and that the data must hold; by default those that they do hold.

    Returns
    -------
    Measured

    Raises
    ------
    InvalidInputError
        If no output was measured, or one that is asked for; see :func:`record_of`.
    """
    given = named_records(data)
    require_model(model)
    wanted = model.output_names
    if outputs is not None:
        wanted = tuple([outputs] if isinstance(outputs, str) else outputs)
        for name in wanted:
            one_of("outputs", name, model.output_names)
    read = {
        name: source if isinstance(source, xr.Dataset) else read_channels(model, source, outputs)
        for name, source in given.items()
    }
    if outputs is None:
        held = tuple(n for n in wanted if any(n in each for each in read.values()))
        wanted = held or wanted  # of a record that holds none all are reported
    narrowed = with_outputs(model, wanted)
    record = record_of(narrowed, read)
    absent = [name for name in model.output_names if name not in wanted]
    note = f"{', '.join(absent)}: not measured, and left out of the comparison"
    notes = [note] * (bool(absent) and outputs is None)
    half = 0.5 / record.dt
    if fast := sorted({f"{f:.4g}" for f in frequencies(narrowed) if f >= half}, key=float):
        notes.append(
            f"the record, sampled at {2 * half:.6g} Hz, does not show the model's "
            f"mode{'s' if len(fast) > 1 else ''} at {', '.join(fast)} Hz: of modes above half "
            "the sampling rate only the static part counts"
        )
    return Measured(narrowed, record, tuple(notes))


def read_channels(
    model: MechanicalModel, source: Any, outputs: Sequence[str] | None = None, **how: Any
) -> xr.Dataset:
    """Read the inputs of a model, and those of its outputs that a file holds.

    Parameters
    ----------
    model : MechanicalModel
    source : path or pandas.DataFrame
    outputs : sequence of str, optional
        Outputs that the file must hold.
    **how
        For :func:`robustpolish.read_measurement`.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InvalidInputError
        If an input is missing, or every output.
    """
    needed = [*model.columns, *(outputs or ())]
    optional = (*model.driven, *(model.output_names if outputs is None else ()))
    # What an input is limited to is what acts on the machine.
    how = {**how, "at_limit": model.input_names}
    data = read_measurement(source, columns=needed, optional=optional, **how)
    if not any(name in data for name in model.output_names):  # refused with the file's columns
        return read_measurement(source, columns=[*needed, *optional], **how)
    return data


def with_outputs(model: MechanicalModel, names: Sequence[str]) -> MechanicalModel:
    """Return a model with some of its outputs and their effects, in the model's order.

    Parameters
    ----------
    model : MechanicalModel
    names : sequence of str
    """
    if set(names) == set(model.output_names):
        return model
    kept = tuple(e for e in model.effects if not _of_sensor(e) or set(e.at) <= set(names))
    outputs = tuple(output for output in model.outputs if output.name in names)
    return replace(model, outputs=outputs, effects=kept)


def with_all_outputs(fitted: MechanicalModel, given: MechanicalModel) -> MechanicalModel:
    """Return a fitted model with the outputs that :func:`with_outputs` left out, and their effects.

    Parameters
    ----------
    fitted, given : MechanicalModel
        With some outputs, and with all of them.
    """
    names = fitted.output_names
    if set(names) == set(given.output_names):
        return fitted
    missed = tuple(e for e in given.effects if _of_sensor(e) and not set(e.at) <= set(names))
    return replace(fitted, outputs=given.outputs, effects=(*fitted.effects, *missed))


def _of_sensor(effect: Effect) -> bool:
    return effect.definition.domain == "output"


def require_model(model: Any) -> None:
    """Refuse what is no mechanical model."""
    if not isinstance(model, MechanicalModel):
        raise misfit("model", type(model).__name__, "a MechanicalModel", "Read it with from_toml.")


def record_of(model: MechanicalModel, data: Any) -> Record:
    """Check that the data holds the model's columns, and return its arrays.

    Parameters
    ----------
    model : MechanicalModel
    data : xarray.Dataset, path or pandas.DataFrame, or a sequence or mapping of them
        Several records have the same channels. Faster ones are decimated to the rate of the
        slowest.

    Raises
    ------
    InvalidInputError
        If there is no record, a record does not suit the model or the others, or their sampling
        rates are no whole multiples of the lowest.
    """
    given = named_records(data)
    _check_channels(model, given)
    checked = {}
    for name, source in given.items():
        try:
            checked[name] = checked_data(model, source)
        except InvalidInputError as error:
            if len(given) == 1:
                raise
            raise InvalidInputError(f"{name}: {error}", error.key) from error
    sets = with_common_step(checked)
    time = [np.asarray(each["time"].values, dtype=float) for each in sets.values()]
    Y = [each[[*model.output_names]].to_array().values.T for each in sets.values()]
    span = sum(float(t[-1] - t[0]) for t in time)
    return Record(
        sets=tuple(sets.values()),
        names=tuple(sets),
        data=join_records(sets),
        times=np.concatenate(time),
        dt=span / sum(t.size - 1 for t in time),
        Y=np.ascontiguousarray(np.concatenate(Y), dtype=float),
    )


def _check_channels(model: MechanicalModel, given: dict[str, Any]) -> None:
    """Refuse a channel that some records have and others do not."""
    read = {name: data for name, data in given.items() if isinstance(data, xr.Dataset)}
    for item in [*model.columns, *model.output_names]:
        lacking = [name for name, data in read.items() if item not in data]
        if 0 < len(lacking) < len(read):
            has = next(name for name in read if name not in lacking)
            shown = f"{item!r} in {has!r}, but not in {', '.join(map(repr, lacking))}"
            remedy = "Leave those records out, or the channel out of the model."
            raise invalid("data", described(shown), "the same channels in all records", remedy)


def require_time_data(data: Any) -> None:
    """Refuse frequency responses, for what needs signals over time.

    Parameters
    ----------
    data : anything
        Paths are looked into.

    Raises
    ------
    InvalidInputError
        If it holds frequency responses.
    """
    if holds_frequency_response(data):
        wanted = "signals over time: which effect is missing shows in how a machine moves"
        remedy = (
            "Hand it a record of inputs and outputs over time. compare (in Python and on the "
            "command line) and refit take frequency responses, and amplitude_dependence tells from "
            "several amplitudes what is not linear."
        )
        raise invalid("data", described("frequency responses"), wanted, remedy)


def least_samples(model: MechanicalModel) -> int:
    """Return how many samples an observer or a fit of a model needs."""
    return 20 * (2 * len(model.free) + 1)


def require_length(model: MechanicalModel, record: Record) -> Record:
    """Return a record if it is long enough for observers and fits of a model.

    Raises
    ------
    InvalidInputError
        If it, or one of several, is too short.
    """
    least, shortest = least_samples(model), min(record.parts, key=lambda part: part.samples)
    if shortest.samples < least:
        which = f" in {shortest.name!r}" if len(record.parts) > 1 else ""
        shown = described(f"{shortest.samples} samples{which}")
        raise invalid("data", shown, f"at least {least}", "Record for longer.")
    return record


def most_active_part(record: Record, most: int) -> Record:
    """Return the contiguous samples in which outputs, each by its size, move most.

    Parameters
    ----------
    record : Record
        Of several records one is chosen, and a part of it.
    most : int
        Samples of the part; all of a record that has no more.
    """
    size = output_sizes(record.Y)
    found = []
    for part in record.parts:
        length = min(part.samples, most)
        total = np.concatenate([[0.0], np.cumsum(np.sum((part.Y / size) ** 2, axis=1))])
        starts = np.arange(0, part.samples - length + 1, max(1, length // 20))
        gathered = total[starts + length] - total[starts]
        begin = int(starts[np.argmax(gathered)])
        found.append((float(np.max(gathered)), part.part(begin, begin + length)))
    return max(found, key=lambda item: item[0])[1]


def quiet_after(outputs: Array, quiet: Array, least: int) -> int:
    """Return after how many samples outputs are quiet for good; all if that is less than half.

    Parameters
    ----------
    outputs : ndarray, shape (samples, ny)
    quiet : ndarray, shape (ny,)
        Root mean squares below which they are.
    least : int
        Samples that are left in any case; in blocks of half as many outputs are looked at.
    """
    samples, block = len(outputs), max(least // 2, 1)
    away = outputs - np.mean(outputs[samples // 2 :], axis=0)
    marks = np.arange(0, samples, block)
    power = np.add.reduceat(away**2, marks, axis=0) / np.diff(np.append(marks, samples))[:, None]
    loud = np.flatnonzero(np.any(power > quiet**2, axis=1))
    over = max(int(marks[loud[-1]]) + block, least) if loud.size else least
    return over if 2 * over < samples else samples


def input_period(inputs: Array, dt: float) -> float | None:
    """Return the period in s with which inputs repeat, None if they do not.

    Parameters
    ----------
    inputs : ndarray, shape (samples, nu)
    dt : float
        Sampling step in s.

    Returns
    -------
    float or None
        The shortest period; at most half of the record, so that it is seen twice.
    """
    U = inputs[:, np.ptp(inputs, axis=0) > 0]
    if not U.size:
        return None
    U = (U - U.mean(axis=0)) / U.std(axis=0)
    n, half = len(U), len(U) // 2
    spectrum = np.abs(np.fft.rfft(U, 2 * n, axis=0)) ** 2
    products = np.fft.irfft(spectrum, axis=0)[: half + 1].sum(axis=1)
    power = np.concatenate([[0.0], np.cumsum(np.sum(U**2, axis=1))])
    lags = np.arange(half + 1)
    likeness = 2 * products / (power[n - lags] + power[n] - power[lags])
    apart = np.flatnonzero(likeness < 0)  # short lags are alike in every smooth signal
    again = np.flatnonzero(likeness > _REPEATS)
    again = again[again > apart[0]] if apart.size else again[:0]
    if not again.size:
        return None
    run = again[: int(np.argmax(np.append(np.diff(again) > 1, True))) + 1]
    return float(run[np.argmax(likeness[run])] * dt)


def checked_data(model: MechanicalModel, data: Any) -> xr.Dataset:
    """Return `data`, the model's columns checked.

    Parameters
    ----------
    model : MechanicalModel
    data : xarray.Dataset, path or pandas.DataFrame
        Anything but a dataset is read with :func:`robustpolish.read_measurement`.

    Returns
    -------
    xarray.Dataset
        Inputs, outputs and whatever else it holds, over uniform ``time``.

    Raises
    ------
    InvalidInputError
        If a column is missing, has another unit than the model, or is not finite; if time is not
        uniform.
    """
    require_model(model)
    if not isinstance(data, xr.Dataset):
        data = read_channels(model, data, model.output_names)
    if "time" not in data.coords or data["time"].dims != ("time",):
        shown = described(f"coordinates {', '.join(map(str, data.coords)) or 'none'}")
        raise invalid("data", shown, "the coordinate time", "Read it with read_measurement.")
    time = np.asarray(data["time"].values)
    if time.dtype.kind not in "fiu":
        shown = described(f"time of type {time.dtype}")
        raise invalid("data", shown, "seconds", "Read it with read_measurement.")
    if time.size < 3:
        raise invalid("data", described(f"{time.size} samples"), "three or more", "Record longer.")
    steps, step = np.diff(time.astype(float)), (time[-1] - time[0]) / (time.size - 1)
    rounding = 1e-3 * step + 4 * np.spacing(np.max(np.abs(time)))
    if not np.isfinite(time).all() or step <= 0 or np.max(np.abs(steps - step)) > rounding:
        shown = described(f"steps from {np.min(steps):.6g} to {np.max(steps):.6g} s")
        remedy = "Read it with read_measurement, which resamples small irregularities."
        raise invalid("time", shown, "a uniform, rising grid", remedy)
    given = [i for i in model.inputs if i.name in data or i.name not in model.driven]
    for item in [*given, *model.references, *model.outputs]:
        _check_column(model, item, data)
    return with_commands(model, data)


def _check_column(model: MechanicalModel, item: Input | Output | str, data: xr.Dataset) -> None:
    name = item if isinstance(item, str) else item.name
    if name not in data:
        listed = ", ".join(str(column) for column in data.data_vars) or "none"
        wanted = f"the model's inputs and outputs among the columns: {listed}"
        remedy = "Rename the column, or the input or output in the model."
        raise invalid("data", described(f"no column {name!r}"), wanted, remedy)
    column = data[name]
    values = np.asarray(column.values)
    if column.dims != ("time",) or values.dtype.kind not in "fiub":
        shown = described(f"{values.dtype} over {', '.join(map(str, column.dims))}")
        raise invalid(name, shown, "numbers over time", "Read it with read_measurement.")
    if not np.isfinite(values).all():
        i = int(np.flatnonzero(~np.isfinite(values))[0])
        raise misfit(name, f"{values[i]} at sample {i}", "finite numbers", "Cut the record there.")
    if isinstance(item, Output) and np.ptp(values) == 0:
        remedy = "Check the sensor, or leave the output out with outputs= (--columns)."
        raise misfit(name, f"{values[0]:.6g} throughout", "a signal that changes", remedy)
    if isinstance(item, str):
        return
    unit, wanted = str(column.attrs.get("units", "")), model.unit_of(item)
    converts = isinstance(item, Input) and abs(item.gain) != 1 and item.unit is None
    if not converts and not same_kind(unit, wanted):
        remedy = "Correct the unit or the quantity, or give the gain that converts."
        raise misfit(name, f"a column in {unit}", f"{wanted}, as the model says", remedy)


def poles_of(model: MechanicalModel) -> AnyArray:
    """Return the poles of the linear part of a model in rad/s; none if nothing moves freely."""
    return np.linalg.eigvals(model.matrices.first_order()[0]) if model.free else np.zeros(0)


def frequencies(model: MechanicalModel) -> list[float]:
    """Return the frequencies in Hz at which the linear part of a model swings."""
    return [abs(float(pole.imag)) / (2 * np.pi) for pole in poles_of(model)]


def output_sizes(outputs: Array) -> Array:
    """Return the standard deviation of each output, 1 where it stands still, shape (ny,)."""
    size = np.std(outputs, axis=0)
    return np.where(size > 0, size, 1.0)


# Sensor noise from repeated records.
#
# Where the same inputs made the same motion, records differ by noise alone: its variance is half
# the mean square of their difference, whatever its colour, and no model is asked.


# Samples below which nothing can be said of two records.
_FEWEST_SAMPLES = 200
# Difference of the inputs over their size from which they are others: measured ones have noise too.
_OTHER_INPUTS = 0.02
# Half the mean square of the difference over that of the motion: records without an input, of which
# any two would have the same, show the same motion or not.
_OTHER_OUTPUTS = 0.25
# Share of the difference that follows from the motion by a short filter: other amplitudes, a shift
# in time. Of short records with slow noise 15 % do by chance; as much again makes the noise 20 %
# too large.
_OF_MOTION = 0.3
# Lags of that filter to either side, and the share of the largest below which the singular values
# of its signals are noise.
_LAGS, _NEGLIGIBLE = 4, 0.03
# Blocks in which the difference is looked at, and times their median that one of them may be: a
# start that was not the same dies out, noise stays. Blocks of slow noise scatter by a factor of 2.
_BLOCKS, _UNSTEADY = 5, 4.0


@dataclass(frozen=True)
class Repeats:
    """Noise that records show which repeat each other.

    Attributes
    ----------
    noise : ndarray, shape (ny,)
        Standard deviation, in the outputs' units.
    names : str
        The records, in words.
    """

    noise: Array
    names: str


def repeats(model: MechanicalModel, record: Record) -> Repeats | None:
    """Return the noise that repeated records show, None if no two of them are alike.

    Parameters
    ----------
    model : MechanicalModel
    record : Record
        Several records; they have to begin with the same sample of the motion.

    Returns
    -------
    Repeats or None
    """
    inputs = record.signals(model)
    parts = [(part, part.own(inputs)) for part in record.parts]
    found, names = [], []
    for (one, u), (other, w) in combinations(parts, 2):
        n = min(one.samples, other.samples)
        if n < _FEWEST_SAMPLES or not _same(u[:n], w[:n]):
            continue
        difference = (one.Y[:n] - other.Y[:n]) / np.sqrt(2)
        motion = (one.Y[:n] + other.Y[:n]) / 2
        if all(_noise_alone(d, m) for d, m in zip(difference.T, motion.T, strict=True)):
            found.append(np.mean(difference**2, axis=0))
            names += [one.name, other.name]
    if not found or np.any(np.mean(found, axis=0) == 0):
        return None  # copies of one record, or a record without noise
    *first, last = dict.fromkeys(names)
    return Repeats(np.sqrt(np.mean(found, axis=0)), f"{', '.join(first)} and {last}")


def _same(one: Array, other: Array) -> bool:
    """Return whether two inputs are the same but for noise."""
    size = np.sqrt(np.mean(one**2 + other**2, axis=0) / 2)
    return bool(np.all(np.std(one - other, axis=0) <= _OTHER_INPUTS * size))


def _noise_alone(difference: Array, motion: Array) -> bool:
    """Return whether the difference of two outputs is small, steady and not made by the motion."""
    power = float(np.mean(difference**2))
    if power > _OTHER_OUTPUTS * float(np.var(motion)):
        return False
    blocks = [float(np.mean(block**2)) for block in np.array_split(difference, _BLOCKS)]
    if max(blocks) > _UNSTEADY * float(np.median(blocks)):
        return False
    k, n = _LAGS, len(motion)
    near = np.column_stack([motion[k + lag : n - k + lag] for lag in range(-k, k + 1)])
    near, inner = near - near.mean(axis=0), difference[k : n - k] - np.mean(difference[k : n - k])
    left = inner - near @ np.linalg.lstsq(near, inner, rcond=_NEGLIGIBLE)[0]
    return float(left @ left) >= (1 - _OF_MOTION) * float(inner @ inner)
