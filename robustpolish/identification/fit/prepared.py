"""Preparation of records for fits: reduction, held-out parts, pieces with initial states."""

from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
import xarray as xr
from scipy.signal import welch

from robustpolish.base.arrays import Array
from robustpolish.base.budget import Budget
from robustpolish.base.checks import described, invalid
from robustpolish.identification.observer import kalman, starts
from robustpolish.identification.observer.runs import (
    InitialState,
    RecordRun,
    Runner,
    StartedPiece,
    free_run,
    rest,
)
from robustpolish.identification.policy import NEGLIGIBLE, STRONG, Policy
from robustpolish.identification.record import (
    Record,
    Repeats,
    frequencies,
    least_samples,
    measured,
    most_active_part,
    poles_of,
    quiet_after,
    record_of,
    repeats,
    require_length,
    with_all_outputs,
)
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.mechanical.data import linear_model
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import ACCELERATION, FORCE
from robustpolish.machines.simulation import loop_poles, needed_substeps
from robustpolish.signals.forces import FLAT, decimate

# Cross-validation split: held-out records, or held-out blocks of each.

# Two held-out pieces, 30 % of the record, between those for estimation; free decays keep their
# beginning, where the amplitude is, for estimation.
_BLOCK_BOUNDS = (0.0, 0.4, 0.55, 0.85, 1.0)
_DECAY_BLOCK_BOUNDS = (0.0, 0.35, 0.65, 0.9, 1.0)

_OVER = 1e-3
"""Share of the motion's power that is left where a free decay is over: 3 % of the amplitude."""
_UNSTEADY_SHARE = 0.15
"""Share of the motion by which it may be ahead of the time in a record that moves steadily."""
_SIMILAR_AMPLITUDE = 2.0
"""Times the amplitude up to which records move alike: a cubic spring does four times as much."""


def fit_and_held_out_parts(
    model: MechanicalModel, record: Record
) -> tuple[list[Record], list[Record]]:
    """Return what is fitted to and what is held out.

    Of records that move alike some are held out as a whole. One that has not its like is cut into
    blocks: a law is not to be judged where nothing of it was seen, nor left unjudged where alone
    it shows, as friction in the smallest motion.

    Parameters
    ----------
    model : MechanicalModel
        Its inputs say which of them a record moves.
    record : Record

    Returns
    -------
    kept, judges : list of Record
        In order.
    """
    kept, judges = [], []
    for group in _similar_records(model, record.parts):
        held = _records_held_out(group)
        for i, part in enumerate(group):
            if held:
                (judges if i in held else kept).append(part)
                continue
            a, b, c, d, e = _blocks(model, part, several=len(record.parts) > 1)
            kept += [part.part(a, b), part.part(c, d)]
            judges += [part.part(b, c), part.part(d, e)]
    return sorted(kept, key=lambda part: part.first), sorted(judges, key=lambda part: part.first)


def _similar_records(model: MechanicalModel, parts: Sequence[Record]) -> list[list[Record]]:
    """Return records in groups that move alike: by the same inputs, and about as much."""
    size = np.sqrt(np.mean([np.var(part.Y, axis=0) for part in parts], axis=0))
    size = np.where(size > 0, size, 1.0)
    amplitude = [float(np.mean(np.std(part.Y, axis=0) / size)) for part in parts]
    moved = [tuple(np.ptp(p.own(p.signals(model)), axis=0) > 0) for p in parts]
    groups: list[list[int]] = []
    for i in sorted(range(len(parts)), key=lambda i: (moved[i], amplitude[i])):
        first = groups[-1][0] if groups else i
        alike = amplitude[i] <= _SIMILAR_AMPLITUDE * amplitude[first]
        if groups and moved[i] == moved[first] and alike:
            groups[-1].append(i)
        else:
            groups.append([i])
    return [[parts[i] for i in group] for group in groups]


def _records_held_out(group: Sequence[Record]) -> list[int]:
    """Return which of a group of records, the smallest motion first, judge as a whole.

    A third of them, and half of their samples at most; those in the middle first.
    """
    middle, total = (len(group) - 1) / 2, sum(part.samples for part in group)
    held: list[int] = []
    for i in sorted(range(len(group)), key=lambda i: abs(i - middle)):
        tried = [*held, i]
        enough = len(tried) > max(1, round(len(group) / 3))
        if not enough and 2 * sum(group[k].samples for k in tried) <= total:
            held = tried
    return held


def _blocks(model: MechanicalModel, part: Record, several: bool) -> list[int]:
    """Return where the blocks of a record begin, and its end.

    They are shares of its time where it moves steadily, and of one free decay, whose end shows what
    is small. In the long quiet ends of blows nothing could be judged, nor where a decay was over
    long before, and a sweep passes its resonances in a moment, where alone a stop may be met: of
    those they are shares of the motion.
    """
    marks = _BLOCK_BOUNDS if model.inputs else _DECAY_BLOCK_BOUNDS
    of_time = [round(part.samples * mark) for mark in marks]
    away = np.abs(part.Y - part.Y.mean(axis=0))
    motion = np.cumsum(np.sum(away / np.maximum(away.max(axis=0), 1e-300), axis=1))
    if model.inputs:
        ahead = np.abs(motion / motion[-1] - np.linspace(0, 1, motion.size))
        uneven = np.max(ahead) > _UNSTEADY_SHARE
    else:
        power = np.sum(away**2 / np.maximum(np.sum(away**2, axis=0), 1e-300), axis=1)
        uneven = np.sum(power[of_time[1] :]) < _OVER * np.sum(power)
    if not several and not uneven:
        return of_time
    inner = np.searchsorted(motion, np.array(marks[1:-1]) * motion[-1])
    found = [0, *inner.tolist(), part.samples]
    return found if np.min(np.diff(found)) >= least_samples(model) else of_time


# Reduction of long records: decimation, or a part of them.
#
# The motion of a machine of 40 Hz takes no 50,000 samples a second to be seen, but a fit to them
# takes 25 times as long as one to 2000. How many are kept follows from four things: the fastest
# motion of interest, which has to be seen as a smooth curve and, where friction or a stop makes
# edges, with these edges; what drives the machine, because fast forces shake dry friction loose
# even where they move nothing (dither); what the model leaves over, which must not be filtered
# away; and how many samples a fit can take at all. What is fitted is a machine in continuous time,
# so that its numbers hold for every sampling.

# Samples from which a record is thinned if its motion is slow enough for that, and beyond which
# only a part of it is used: a diagnosis of so many takes a minute, and one of 500,000 has to end
# in two.
_LONGEST = 30000
# Samples that thinning leaves at least.
_FEWEST = 12000
# Samples per swing of the fastest motion that thinning leaves, and where accelerations or forces
# are measured, which jump with friction at every reversal: the filter against aliases rounds a
# jump over a few samples, the model does not, and of a jump's power the share of about a tenth of
# a sample is an error ("coulomb between, at 50 kHz"). Of a displacement it is two integrals less;
# there it is the harmonics that count, up to the 15th.
_SWING_SAMPLES, _SHARP_SAMPLES = 40.0, 200.0
# Share that thinning leaves of the power of the forces, and of what the linear model leaves over.
# With broad forces friction acts at every change of a fast velocity, and a filtered force shows
# another friction: a part of the record says more there than a thinned whole.
_KEPT_POWER = 0.99
# Swings of the slowest mode that such a part lasts, or else more samples are left out.
_SWINGS_KEPT = 20.0
_HOLD = "input_hold"
_AS_IT_IS, _SMOOTH = {"order": 1.0}, {"order": 3.0}
_SEGMENTS = 8
_LONGEST_SEGMENT = 2**16
# A coarse spectrum shows slow motion as faster than it is; behind a first decimation it is finer.
_DECIMATION_ROUNDS = 3
# About a mode of the model, whose numbers may be wrong.
_AROUND = 1.25


@dataclass(frozen=True, eq=False)
class ReducedRecord:
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

    def restored(self, fitted: MechanicalModel) -> MechanicalModel:
        """Return a fitted model with all outputs, and holds of inputs as in the whole record."""
        fitted = with_all_outputs(fitted, self.given)
        if not self.thinned:
            return fitted
        known = {e.at: e for e in self.given.effects if e.kind == _HOLD}
        effects = (known.get(e.at, e) if e.kind == _HOLD else e for e in fitted.effects)
        return replace(fitted, effects=tuple(effects))


def reduced_data(
    model: MechanicalModel, data: Any, outputs: Sequence[str] | None = None
) -> ReducedRecord:
    """Return what fits and observers take of data, with the outputs that were measured.

    Parameters
    ----------
    model : MechanicalModel
    data : xarray.Dataset, path or pandas.DataFrame, or a sequence or mapping of them
    outputs : sequence of str, optional
        Outputs that the data must hold; by default those that they do hold.

    Returns
    -------
    ReducedRecord

    Raises
    ------
    InvalidInputError
        If the data do not suit the model, or are too short.
    """
    narrowed, record, notes = measured(model, data, outputs)
    fewer = reduce_record(narrowed, require_length(narrowed, record))
    return replace(fewer, notes=(*notes, *fewer.notes), given=model)


def reduce_record(model: MechanicalModel, record: Record) -> ReducedRecord:
    """Return a record as fits can take it: as it is, unless it is long; several stay as they are.

    Parameters
    ----------
    model : MechanicalModel
    record : Record

    Returns
    -------
    ReducedRecord
    """
    if len(record.sets) > 1:
        return ReducedRecord(model, record, False, (), model)
    long, notes = record.samples > _LONGEST, []
    # what controllers see is not to be filtered
    fewer = _decimated(model, record) if long and not model.feedback else record
    thinned = fewer is not record
    if thinned:
        notes.append(
            f"The record was {fewer.data.attrs['notes'][-1]}. Errors and noise are those of the "
            "samples that were kept; the numbers of the model hold for every sampling."
        )
        # told above, with what it means
        data = fewer.data.assign_attrs(notes=record.data.attrs.get("notes", ()))
        fewer = replace(fewer, data=data, sets=(data,))
    whole = fewer
    if whole.samples > _LONGEST:
        begin = most_active_part(whole, _LONGEST).first
        data = whole.data.isel(time=slice(begin, begin + _LONGEST))
        fewer = replace(record_of(model, data), honest=whole.honest)
        notes.append(
            f"Only {fewer.time[0]:.6g} to {fewer.time[-1]:.6g} s of the record were used, the "
            f"liveliest {fewer.samples} of {whole.samples} samples."
        )
    effects = (
        e.with_values(_AS_IT_IS) if thinned and e.kind == _HOLD else e for e in model.effects
    )
    return ReducedRecord(
        replace(model, effects=tuple(effects)), fewer, thinned, tuple(notes), model
    )


def _decimated(model: MechanicalModel, record: Record) -> Record:
    """Return a record with as many samples as are needed, itself if these are all."""

    def as_held(data: xr.Dataset, times: Array, holds: Sequence[Effect]) -> xr.Dataset:
        """Return data whose inputs, linear between samples, act as held ones."""
        inputs = {hold.at[0]: data[hold.at[0]] for hold in holds}
        acting = {h.at[0]: h.on_signal(inputs[h.at[0]].values, times) for h in holds}
        return data.assign({n: ("time", u, inputs[n].attrs) for n, u in acting.items()})

    holds = [effect for effect in model.effects if effect.kind == _HOLD]
    data = as_held(record.data[[*model.input_names, *model.output_names]], record.times, holds)
    fewer = record
    for _ in range(_DECIMATION_ROUNDS):
        nearer = decimate(data, needed_rate(model, fewer))
        if nearer.sizes["time"] == data.sizes["time"]:
            return record
        again = replace(record_of(model, nearer), honest=FLAT)
        if again.samples == fewer.samples:
            break
        fewer = again
    # what was decimated is smooth
    smooth_holds = [Effect(_HOLD, (i.name,), _SMOOTH) for i in model.inputs if i.imposes is None]
    data = as_held(fewer.data, fewer.times, smooth_holds)
    return replace(fewer, data=data, sets=(data,))


def needed_rate(model: MechanicalModel, record: Record) -> float:
    """Return the sampling rate in Hz that a model's fit needs.

    Parameters
    ----------
    model : MechanicalModel
    record : Record
    """
    length = record.samples * record.dt
    fastest = _fastest_motion(model, record)
    slowest = min((f for f in frequencies(model) if f > 0), default=fastest)
    lasting = _LONGEST * slowest / _SWINGS_KEPT
    sharp = any(o.quantity in (ACCELERATION, FORCE) for o in model.outputs)
    each = _SHARP_SAMPLES if sharp else _SWING_SAMPLES
    residual = _residual_bandwidth(model, record)
    # of the forces that drive a model
    pushing = [record.data[item.name].values for item in model.inputs if item.imposes is None]
    spectra = (_spectrum(np.asarray(u), record.dt) for u in pushing)
    pushed = max((kalman.power_bandwidth(*each, _KEPT_POWER) for each in spectra), default=0.0)
    wanted = min(residual * 2 / FLAT, _LONGEST / length)
    driven = min(pushed * 2 / FLAT, lasting)
    return max(each * fastest, wanted, driven, _FEWEST / length)


def _fastest_motion(model: MechanicalModel, record: Record) -> float:
    """Return the frequency in Hz of the fastest motion that a record shows.

    It is the fastest mode of the model that the outputs show, or the frequency below which the
    motion happens that they show, if that is higher.
    """
    highest = 0.0
    modes = frequencies(model)
    for output, y in zip(model.outputs, record.Y.T, strict=True):
        frequency, density = _spectrum(y, record.dt)
        floor = float(np.percentile(density, 10))
        shown = [
            f for f in modes
            if np.max(density[(frequency > f / _AROUND) & (frequency < f * _AROUND)], initial=0.0)
            > kalman.ABOVE_FLOOR * floor
        ]  # fmt: skip
        moving = kalman.motion_bandwidth(output.quantity, frequency, density)
        highest = max(highest, *shown, moving)
    return highest


def _residual_bandwidth(model: MechanicalModel, record: Record) -> float:
    """Return the frequency in Hz below which most of what the linear model leaves over lies."""
    run = free_run(linear_model(model), record)
    still = rest(run.model)
    sizes = starts.visible_sizes(run, record, still) if still.vector.size else np.zeros(0)
    error = run.all_errors([StartedPiece(record, starts.fitted_start(run, record, [still], sizes))])
    if not np.isfinite(error).all():
        return 0.0
    spectra = (_spectrum(e, record.dt) for e in error.T)
    left = ((f, d - kalman.ABOVE_FLOOR * float(np.percentile(d, 10))) for f, d in spectra)
    return max(kalman.power_bandwidth(f, np.maximum(d, 0.0), _KEPT_POWER) for f, d in left)


def _spectrum(y: Array, dt: float) -> tuple[Array, Array]:
    length = min(_LONGEST_SEGMENT, len(y) // _SEGMENTS)
    return welch(y - np.mean(y), 1 / dt, nperseg=length)


# Levels among which an observer looks for the one that shows the motion best.
_FOLLOWING = tuple(kalman.Level(share) for share in (10.0, 3.0, 1.0, 0.3, 0.1))
# Samples of a trial piece.
_TRIAL = 3500
# Samples that are screened; where all motion is imposed, screening is quick and the amplitudes of
# the whole record are welcome (the friction damper).
_SCREENED, _SCREENED_IMPOSED = 5000, 30000
# Samples that are screened at least where a motion dies away early, and times the noise up to
# which what is left of it is as good as over.
_LEAST_MOVING, _MOVING = 200, 1.5
# Swings of the fastest motion, and samples, that the first windows of a fit have at least: errors
# over a swing or two depend smoothly on every number.
_SWINGS, _LEAST_WINDOW = 1.5, 50
# Samples from which a stage of a fit has to do with few steps, and its steps for shorter records.
_LONG_RECORD, _MANY_STEPS = 4000, 15
# Number and least length of windows, for models whose long runs judge nothing.
_WINDOWS, _SHORTEST_WINDOW = 25, 60
# Swings of the fastest motion in a window of what integrates: over fewer of them a start of its own
# takes what the machine does.
_SWINGS_OF_WINDOW = 10
# Forces that are so many times those that the motion takes are in other units.
_OUT_OF_PROPORTION = 1e7
# Runs that are kept: what was found last is asked for its error, its noise and its calm in turn.
_KEPT = 4


@dataclass
class WorkBudget(Budget):
    """Steps of all runs of models over a record, see :attr:`Policy.work`.

    Attributes
    ----------
    refused : bool
        Whether something was not tried because all were done.
    """

    refused: bool = field(default=False, init=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False, repr=False)

    def spend(self, work: float = 1.0) -> None:
        """Count steps; derivatives are run in several threads."""
        with self._lock:
            super().spend(work)

    def left(self) -> bool:
        """Return whether something more may be tried; that it may not is remembered."""
        self.refused = self.refused or self.exhausted
        return not self.exhausted


@dataclass(frozen=True, eq=False)
class PreparedRecord:
    """A record prepared for fits of a model and its extensions.

    Attributes
    ----------
    record : Record
    policy : Policy
        What fits and decisions go by.
    scales : Scales
    peak : float
        Largest displacement, in m or rad; decides on steps.
    motion_sizes : ndarray, shape (n,)
        Sizes of the free displacements and velocities.
    estimation, trial, held_out, everything : list of StartedPiece
        `trial` is the first part of each estimation piece, for first fits of candidates.
    windows : list of StartedPiece
        The whole record in short pieces, for models whose long free runs judge nothing.
    linear_motion : SmoothedMotion
        What the linear model's observer made of the record.
    short : int
        Samples of short windows.
    repeats : Repeats or None
        Noise that records show which repeat each other; `scales` holds it too.
    held : frozenset of str
        Keys of numbers that fits leave as they are.
    work : WorkBudget
        What all who share the record have done together; without a limit by default.
    """

    record: Record
    policy: Policy
    scales: kalman.Scales
    peak: float
    motion_sizes: Array
    estimation: list[StartedPiece]
    trial: list[StartedPiece]
    held_out: list[StartedPiece]
    everything: list[StartedPiece]
    windows: list[StartedPiece]
    linear_motion: starts.SmoothedMotion
    short: int
    repeats: Repeats | None = None
    held: frozenset[str] = frozenset()
    work: WorkBudget = field(default_factory=WorkBudget)
    # of run_with_fitted_starts: what was asked for, and what was found
    _recent: deque[tuple[object, object, RecordRun, list[StartedPiece]]] = field(
        default_factory=partial(deque, maxlen=_KEPT), init=False, repr=False
    )

    def spans(self, pieces: Sequence[StartedPiece], growth: int = 2) -> list[int]:
        """Return the lengths of windows that grow from a few swings to whole pieces."""
        longest = max(piece.record.samples for piece in pieces)
        swing = 2 * np.pi / (self.scales.bandwidth * self.record.dt)
        span = max(_LEAST_WINDOW, round(_SWINGS * swing))
        found = []
        while 2 * span < longest:
            found.append(span)
            span *= growth
        return [*found, longest]

    def cut_windows(
        self, model: MechanicalModel, pieces: Sequence[StartedPiece], span: int
    ) -> list[StartedPiece]:
        """Return pieces cut into windows, with starts from the smoothed motion.

        Parameters
        ----------
        model : MechanicalModel
            Internal states of its effects begin at rest.
        pieces : sequence of StartedPiece
        span : int
            Samples of a window, about.
        """
        linear, still = linear_model(model), rest(model).internal
        found = []
        for piece in pieces:
            parts = _windows(piece.record, span) if piece.record.samples > span else ()
            states = (self.linear_motion.start(linear, part.first).state for part in parts)
            cut = zip(parts, (InitialState(state, still) for state in states), strict=True)
            found += [StartedPiece(*each) for each in cut] or [piece]
        return with_initial_memory(model, found)

    def with_propagated_memory(
        self, run: RecordRun, pieces: Sequence[StartedPiece]
    ) -> list[StartedPiece]:
        """Return the pieces with the memory of effects as the run before each leaves it.

        Where the pieces follow each other, an effect remembers what happened before.
        """
        started = with_initial_memory(run.model, pieces)
        if not started[0].start.internal.size:
            return started
        known = pieces[0].start.internal.size
        seen = run.over_all(started, keep=True).internal
        ends = np.cumsum([p.record.samples for p in started]) - 1
        for i in range(1, len(started)):
            here, end = started[i], seen[ends[i - 1]]
            if here.record.follows(started[i - 1].record) and np.isfinite(end).all():
                internal = here.start.internal.copy()
                internal[known:] = end[known:]
                started[i] = StartedPiece(here.record, InitialState(here.start.state, internal))
        return started

    @cached_property
    def folds(self) -> list[StartedPiece]:
        """All pieces over which models are compared: fitted and held out."""
        return [*self.trial, *self.held_out]

    @property
    def steps(self) -> int:
        """Most steps of a stage: short records can afford more."""
        return _MANY_STEPS if self.record.samples < _LONG_RECORD else self.policy.few_steps

    @property
    def screened(self) -> Record:
        """The contiguous part of a record that is screened: the liveliest, while it moves.

        What a motion has died away to is the same noise for all models, and over most of a record
        it says that none of them explains anything.
        """
        most = _SCREENED if self.motion_sizes.size else _SCREENED_IMPOSED
        part, quiet = most_active_part(self.record, most), _MOVING * self.scales.noise
        return part.part(0, quiet_after(part.Y, quiet, _LEAST_MOVING))

    def runner(self, model: MechanicalModel, like: Runner | None = None) -> Runner:
        """Return what runs a model freely, and those that are tried in its place.

        Parameters
        ----------
        model : MechanicalModel
        like : Runner, optional
            Whose steps it takes; by default so few as the noise hides.
        """
        steps = self._hidden_steps(model) if like is None else like.substeps
        return Runner(model, self.record.dt, self.peak, substeps=steps, spend=self.work.spend)

    def _hidden_steps(self, model: MechanicalModel) -> int:
        """Return steps per sample so few that twice as many change no decision.

        Twice as many change each error by d, which is worth (d / sigma)^2 / 2 nats; sigma^2 is
        that of the noise, and of the share of the motion that does not count.
        """
        few, most = (
            needed_substeps(model, self.record.dt, self.peak, edges) for edges in (False, True)
        )
        if few == most:
            return most
        started = with_initial_memory(model, self.trial)

        def outputs(steps: int) -> Array:
            fixed = Runner(model, self.record.dt, self.peak, substeps=steps, spend=self.work.spend)
            return fixed.run(model).over_all(started).outputs

        sigma = np.hypot(self.scales.noise, NEGLIGIBLE * np.std(self.record.Y, axis=0))
        before = outputs(few)
        while few < most:
            after = outputs(min(2 * few, most))
            with np.errstate(over="ignore", invalid="ignore"):
                change = float(np.sum(((after - before) / sigma) ** 2)) / 2
            if change < STRONG:
                return few
            few, before = min(2 * few, most), after
        return most

    def motion(self, model: MechanicalModel, record: Record) -> starts.SmoothedMotion:
        """Return the smoothed motion along the record or a part of it."""
        return starts.smooth(model, record, self.scales, _FOLLOWING)

    def sizes(self, model: MechanicalModel) -> Array:
        """Return the sizes of a model's states, internal ones included."""
        return starts.state_sizes(model, self.motion_sizes)

    def run_with_fitted_starts(
        self, model: MechanicalModel, pieces: Sequence[StartedPiece]
    ) -> tuple[RecordRun, list[StartedPiece]]:
        """Return a model ready to run, and the pieces with the starts that suit it best."""
        for of, over, run, started in tuple(self._recent):
            if of is model and over is pieces:
                return run, started
        run = self.runner(model).run(model)
        started = self.with_fitted_starts(run, with_initial_memory(model, pieces))
        self._recent.append((model, pieces, run, started))
        return run, started

    def with_fitted_starts(
        self, run: RecordRun, pieces: Sequence[StartedPiece]
    ) -> list[StartedPiece]:
        """Return the pieces with the starts from which a model runs closest to them.

        The smoothed motion may be far off, as of accelerometers with coloured noise; what suits the
        linear part is tried beside it.
        """
        sizes = self.sizes(run.model)
        if run.linear or not sizes.size:
            return starts.fitted_starts(run, pieces, sizes)
        linear = linear_model(run.model)
        none = rest(linear).internal
        bare = [StartedPiece(p.record, InitialState(p.start.state, none)) for p in pieces]
        straight = starts.fitted_starts(self.runner(linear).run(linear), bare, self.motion_sizes)
        others = [
            StartedPiece(piece.record, InitialState(other.start.state, piece.start.internal))
            for piece, other in zip(pieces, straight, strict=True)
        ]
        return starts.fitted_starts(run, pieces, sizes, others)


def prepare(model: MechanicalModel, record: Record, policy: Policy) -> PreparedRecord:
    """Prepare a record for fits of a model and its extensions."""
    scales = kalman.scales_of(model, record)
    linear, m, omega = linear_model(model), model.matrices, scales.bandwidth
    # the largest force that a motion of this size takes in the model
    stiffness = [np.abs(np.diag(matrix)) for matrix in (m.K, m.C * omega, m.M * omega**2)]
    sizes = model.frame.sizes
    moving = float(np.max(np.sum(stiffness, axis=0) * sizes) * scales.amplitude)
    try:
        if 0 < _OUT_OF_PROPORTION * moving < np.max(scales.force):
            raise np.linalg.LinAlgError
        motion = starts.smooth(linear, record, scales, _FOLLOWING)
    except np.linalg.LinAlgError as error:
        shown = f"motions of {scales.amplitude:.3g} with forces of {np.max(scales.force):.3g}"
        remedy = "Check the units of the columns, and the model's masses and stiffnesses."
        wanted = "motions that the model can have"
        raise invalid("data", described(shown), wanted, remedy) from error
    peak = kalman.displacement_peak(model, record, scales.bandwidth, motion.q)
    repeated = repeats(model, record)
    if repeated is not None:
        scales = replace(scales, noise=repeated.noise)
    kept, judges = fit_and_held_out_parts(model, record)
    first = max(2 * _TRIAL // len(kept), _TRIAL // 4, least_samples(model))
    short = window_samples(record.samples)
    longest = max(part.samples for part in record.parts)
    length = longest
    if has_integrator(model, longest * record.dt):
        swings = round(_SWINGS_OF_WINDOW * 2 * np.pi / (scales.bandwidth * record.dt))
        length = min(longest, max(short, swings))

    def pieces(parts: Sequence[Record], length: int = length) -> list[StartedPiece]:
        cut = [window for part in parts for window in _windows(part, length)]
        started = [StartedPiece(part, motion.start(linear, part.first)) for part in cut]
        return with_initial_memory(model, started)

    return PreparedRecord(
        record, policy, scales, peak, _motion_sizes(model, motion),
        estimation=pieces(kept),
        trial=pieces([part.part(0, min(first, part.samples)) for part in kept]),
        held_out=pieces(judges),
        everything=pieces(record.parts),
        windows=pieces(record.parts, length=short),
        linear_motion=motion, short=short, repeats=repeated, work=WorkBudget(policy.work),
    )  # fmt: skip


def with_initial_memory(
    model: MechanicalModel, pieces: Sequence[StartedPiece]
) -> list[StartedPiece]:
    """Return the pieces with internal states that suit a model, at rest where they are new."""
    found, size = [], rest(model).internal.size
    for piece in pieces:
        known = piece.start.internal[:size]
        internal = np.concatenate([known, np.zeros(size - known.size)])
        found.append(StartedPiece(piece.record, InitialState(piece.start.state, internal)))
    return found


def window_samples(samples: int) -> int:
    """Return the samples of a window, for models whose long runs judge nothing."""
    return max(_SHORTEST_WINDOW, samples // _WINDOWS)


def has_integrator(model: MechanicalModel, length: float) -> bool:
    """Return whether the linear part integrates over a record of `length` seconds.

    The free run of such a model forgets nothing, so that it is judged in windows.
    """
    poles = loop_poles(model) if model.feedback else poles_of(model)
    return bool(np.min(np.abs(poles), initial=np.inf) * length < 1)


def _motion_sizes(model: MechanicalModel, motion: starts.SmoothedMotion) -> Array:
    """Return the size of each free displacement and velocity."""
    free = model.matrices.free
    sizes = np.concatenate([np.std(motion.q[free], axis=1), np.std(motion.v[free], axis=1)])
    largest = np.max(sizes, initial=0.0)
    return np.maximum(sizes, 1e-6 * largest) if largest > 0 else np.ones(len(sizes))


def _windows(part: Record, length: int) -> list[Record]:
    """Cut a contiguous part of a record into windows of about a length."""
    count = max(1, round(part.samples / length))
    marks = np.linspace(0, part.samples, count + 1).astype(int).tolist()
    return [part.part(*ends) for ends in itertools.pairwise(marks)]
