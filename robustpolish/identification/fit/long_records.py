"""Long records as fits can take them: with fewer samples, or a part of them.

The motion of a machine of 40 Hz takes no 50,000 samples a second to be seen, but a fit to them
takes 25 times as long as one to 2000. How many are kept follows from four things: the fastest
motion of interest, which has to be seen as a smooth curve and, where friction or a stop makes
edges, with these edges; what drives the machine, because fast forces shake dry friction loose even
where they move nothing (dither); what the model leaves over, which must not be filtered away; and
how many samples a fit can take at all. What is fitted is a machine in continuous time, so that its
numbers hold for every sampling.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from scipy.signal import welch

from robustpolish.arrays import Array
from robustpolish.effects import Effect
from robustpolish.identification.observer.run import StartedPiece, free_run, rest
from robustpolish.identification.observer.starts import fitted_start, visible_sizes
from robustpolish.identification.policy import Policy
from robustpolish.identification.record import Record, frequencies, liveliest, record_of
from robustpolish.measurements import decimate
from robustpolish.measurements.filtering import FLAT
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.parts import ACCELERATION, DISPLACEMENT, FORCE, VELOCITY

_HOLD = "input_hold"
_AS_IT_IS, _SMOOTH = {"order": 1.0}, {"order": 3.0}
_SEGMENTS = 8
_LONGEST_SEGMENT = 2**16
# A coarse spectrum shows slow motion as faster than it is; behind a first decimation it is finer.
_LOOKS = 3
# About a mode of the model, whose numbers may be wrong.
_AROUND = 1.25
_ABOVE_FLOOR = 3.0
_LEAKS = 1e-4


@dataclass(frozen=True, eq=False)
class Taken:
    """What is fitted of a record, and with which model.

    Attributes
    ----------
    model : MechanicalModel
        Whose holds of inputs are those of the record as it is taken.
    record : Record
    thinned : bool
        Whether samples were left out: its inputs are smooth then, whatever they were before.
    notes : tuple of str
        What was left out.
    given : MechanicalModel
        The model as it was.
    """

    model: MechanicalModel
    record: Record
    thinned: bool
    notes: tuple[str, ...]
    given: MechanicalModel

    def as_given(self, fitted: MechanicalModel) -> MechanicalModel:
        """Return a fitted model for the sampling of the whole record: with its holds of inputs."""
        if not self.thinned:
            return fitted
        known = [e for e in self.given.effects if e.kind == _HOLD]
        mine = iter(known)
        there = [e.at for e in known]
        effects = [next(mine) if e.kind == _HOLD and e.at in there else e for e in fitted.effects]
        return replace(fitted, effects=tuple(effects))


def taken(model: MechanicalModel, record: Record, policy: Policy) -> Taken:
    """Return a record as fits can take it: as it is, unless it is long; several stay as they are.

    Parameters
    ----------
    model : MechanicalModel
    record : Record
    policy : Policy
        From how many samples on a record is long, and what has to be kept of it.

    Returns
    -------
    Taken
    """
    fewer, notes = record, []
    if record.samples > policy.comfortable and len(record.sets) == 1:
        fewer = _thinned(model, record, policy)
    thinned = fewer is not record
    if thinned:
        notes.append(
            f"The record was {fewer.data.attrs['notes'][-1]}. Errors and noise are those of the "
            "samples that were kept; the numbers of the model hold for every sampling."
        )
        # told above, with what it means
        data = fewer.data.assign_attrs(notes=record.data.attrs.get("notes", ()))
        fewer = replace(fewer, data=data, sets=(data,))
    if fewer.samples > policy.longest and len(record.sets) == 1:
        whole = fewer
        begin = liveliest(whole, policy.longest).first
        data = whole.data.isel(time=slice(begin, begin + policy.longest))
        fewer = replace(_record(model, data), honest=whole.honest)
        notes.append(
            f"Only {fewer.time[0]:.6g} to {fewer.time[-1]:.6g} s of the record were used, the "
            f"liveliest {fewer.samples} of {whole.samples} samples."
        )
    known = tuple(
        e.with_values(_AS_IT_IS) if thinned and e.kind == _HOLD else e for e in model.effects
    )
    return Taken(replace(model, effects=known), fewer, thinned, tuple(notes), model)


def _thinned(model: MechanicalModel, record: Record, policy: Policy) -> Record:
    """Return a record with as many samples as are needed, itself if these are all."""
    data = record.data[[*model.input_names, *model.output_names]]
    data = data.assign({
        effect.at[0]: ("time", effect.on_signal(data[effect.at[0]].values, record.times),
                       data[effect.at[0]].attrs)
        for effect in model.effects if effect.kind == _HOLD
    })  # fmt: skip
    fewer = record
    for _ in range(_LOOKS):
        rate = needed_rate(model, fewer, policy)
        nearer = decimate(data, rate)
        if nearer.sizes["time"] == data.sizes["time"]:
            return record
        again = _record(model, nearer)
        if again.samples == fewer.samples:
            break
        fewer = again
    return _smooth(model, fewer)


def _record(model: MechanicalModel, data: xr.Dataset) -> Record:
    return replace(record_of(model, data), honest=FLAT)


def _smooth(model: MechanicalModel, record: Record) -> Record:
    """Return a record whose forces, linear between samples, act as the smooth ones they are."""
    forces = {
        item.name: Effect(_HOLD, (item.name,), _SMOOTH)
        for item in model.inputs if item.imposes is None
    }  # fmt: skip
    data = record.data.assign({
        name: ("time", hold.on_signal(record.data[name].values, record.times),
               record.data[name].attrs)
        for name, hold in forces.items()
    })  # fmt: skip
    return replace(record, data=data, sets=(data,))


def needed_rate(model: MechanicalModel, record: Record, policy: Policy) -> float:
    """Return the sampling rate in Hz that a model's fit needs.

    Parameters
    ----------
    model : MechanicalModel
    record : Record
    policy : Policy
    """
    length = record.samples * record.dt
    fastest = fastest_motion(model, record)
    slowest = min((f for f in frequencies(model) if f > 0), default=fastest)
    lasting = policy.longest * slowest / policy.swings_kept
    sharp = any(o.quantity in (ACCELERATION, FORCE) for o in model.outputs)
    each = policy.sharp_samples if sharp else policy.swing_samples
    wanted = min(_residual_top(model, record, policy) * 2 / FLAT, policy.comfortable / length)
    driven = min(_input_top(model, record, policy) * 2 / FLAT, lasting)
    return max(each * fastest, wanted, driven, policy.few / length)


def fastest_motion(model: MechanicalModel, record: Record) -> float:
    """Return the frequency in Hz of the fastest motion that a record shows.

    It is the fastest mode of the model that the outputs show, or the frequency below which the
    motion happens that they show, if that is higher.

    Parameters
    ----------
    model : MechanicalModel
    record : Record
    """
    highest = 0.0
    modes = frequencies(model)
    for output, y in zip(model.outputs, record.Y.T, strict=True):
        frequency, density = _spectrum(y, record.dt)
        floor = float(np.percentile(density, 10))
        shown = [
            f for f in modes
            if np.max(density[(frequency > f / _AROUND) & (frequency < f * _AROUND)], initial=0.0)
            > _ABOVE_FLOOR * floor
        ]  # fmt: skip
        order = {DISPLACEMENT: 0, VELOCITY: 2, ACCELERATION: 4}.get(output.quantity, 0)
        least = max(floor, _LEAKS * float(np.max(density)))
        seen = np.maximum(density - _ABOVE_FLOOR * least, 0.0)
        # as displacement, of which what leaks from a strong line to 0 Hz would make a large one
        seen[1:] /= frequency[1:] ** order
        highest = max(highest, *shown, _top(frequency[1:], seen[1:], 0.98))
    return highest


def _residual_top(model: MechanicalModel, record: Record, policy: Policy) -> float:
    """Return the frequency in Hz below which most of what the linear model leaves over lies."""
    run = free_run(model.without_effects(), record)
    still = rest(run.model)
    sizes = visible_sizes(run, record, still) if still.vector.size else np.zeros(0)
    error = run.errors(StartedPiece(record, fitted_start(run, record, [still], sizes)))
    if not np.isfinite(error).all():
        return 0.0
    highest = 0.0
    for e in error.T:
        frequency, density = _spectrum(e, record.dt)
        left = np.maximum(density - _ABOVE_FLOOR * float(np.percentile(density, 10)), 0.0)
        highest = max(highest, _top(frequency, left, policy.kept))
    return highest


def _input_top(model: MechanicalModel, record: Record, policy: Policy) -> float:
    """Return the frequency in Hz below which most of the forces lies that drive a model."""
    found = [0.0]
    for item in model.inputs:
        if item.imposes is None:
            frequency, density = _spectrum(np.asarray(record.data[item.name].values), record.dt)
            found.append(_top(frequency, density, policy.kept))
    return max(found)


def _spectrum(y: Array, dt: float) -> tuple[Array, Array]:
    length = min(_LONGEST_SEGMENT, len(y) // _SEGMENTS)
    return welch(y - np.mean(y), 1 / dt, nperseg=length)


def _top(frequency: Array, density: Array, share: float) -> float:
    """Return the frequency below which this share of the power lies, 0 if there is none."""
    power = np.cumsum(density)
    if power[-1] <= 0:
        return 0.0
    return float(frequency[np.searchsorted(power, share * power[-1])])
