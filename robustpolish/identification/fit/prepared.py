"""A record prepared for fits: pieces with their starts, sizes, and what a fit goes by."""

from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from robustpolish.arrays import Array
from robustpolish.errors import InvalidInputError
from robustpolish.identification.fit.held_out import sides
from robustpolish.identification.observer.kalman import (
    FREE,
    Level,
    Scales,
    amplitude_of,
    peak_of,
    scales_of,
)
from robustpolish.identification.observer.missing_force import Smoothed, smooth
from robustpolish.identification.observer.run import RecordRun, Runner, Start, StartedPiece, rest
from robustpolish.identification.observer.starts import fitted_starts, state_sizes
from robustpolish.identification.policy import Policy
from robustpolish.identification.record import Record, least_samples, liveliest, moving
from robustpolish.identification.repeats import Repeats, repeats
from robustpolish.long_calls import Budget
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.validation import described, invalid

# Forces that are so many times those that the motion takes are in other units.
_OUT_OF_PROPORTION = 1e7
# Runs that are kept: what was found last is asked for its error, its noise and its calm in turn.
_KEPT = 4


@dataclass
class Work(Budget):
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


class _ClosestRuns(NamedTuple):
    """What :meth:`PreparedRecord.closest_runs` found."""

    model: MechanicalModel
    pieces: Sequence[StartedPiece]
    run: RecordRun
    started: list[StartedPiece]


@dataclass(frozen=True, eq=False)
class PreparedRecord:
    """A record prepared for fits of a model and its extensions.

    Attributes
    ----------
    record : Record
    policy : Policy
        What fits and decisions go by.
    scales : Scales
    amplitude, peak : float
        Of displacements, in m or rad, and the largest; the second decides on steps.
    motion_sizes : ndarray, shape (n,)
        Sizes of the free displacements and velocities.
    estimation, trial, held_out, everything : list of StartedPiece
        `trial` is the first part of each estimation piece, for first fits of candidates.
    windows : list of StartedPiece
        The whole record in short pieces, for models whose long free runs judge nothing.
    motion_before : Smoothed
        What the linear model's observer made of the record.
    short : int
        Samples of short windows.
    repeats : Repeats or None
        Noise that records show which repeat each other; `scales` holds it too.
    held : frozenset of str
        Keys of numbers that fits leave as they are.
    work : Work
        What all who share the record have done together; without a limit by default.
    """

    record: Record
    policy: Policy
    scales: Scales
    amplitude: float
    peak: float
    motion_sizes: Array
    estimation: list[StartedPiece]
    trial: list[StartedPiece]
    held_out: list[StartedPiece]
    everything: list[StartedPiece]
    windows: list[StartedPiece]
    motion_before: Smoothed
    short: int
    repeats: Repeats | None = None
    held: frozenset[str] = frozenset()
    work: Work = field(default_factory=Work)
    _recent: deque[_ClosestRuns] = field(
        default_factory=partial(deque, maxlen=_KEPT), init=False, repr=False
    )

    def spans(self, pieces: Sequence[StartedPiece], growth: int = 2) -> list[int]:
        """Return the lengths of windows that grow from a few swings to whole pieces."""
        longest = max(piece.record.samples for piece in pieces)
        swing = 2 * np.pi / (self.scales.bandwidth * self.record.dt)
        span = max(self.policy.least_window, round(self.policy.swings * swing))
        found = []
        while 2 * span < longest:
            found.append(span)
            span *= growth
        return [*found, longest]

    def windows_of(
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
        linear, still = model.without_effects(), rest(model).internal
        found = []
        for piece in pieces:
            if piece.record.samples <= span:
                found.append(piece)
                continue
            for begin, end in _windows((0, piece.record.samples), span):
                part = piece.record.part(begin, end)
                state = self.motion_before.start(linear, part.first).state
                found.append(StartedPiece(part, Start(state, still)))
        return with_rest(model, found)

    def with_memory(
        self, model: MechanicalModel, pieces: Sequence[StartedPiece]
    ) -> list[StartedPiece]:
        """Return the pieces with the memory of effects as the run before each leaves it.

        Where the pieces follow each other, an effect remembers what happened before.
        """
        started = with_rest(model, pieces)
        if not started[0].start.internal.size:
            return started
        known = pieces[0].start.internal.size
        seen = self.runner(model).run(model).over_all(started, keep=True).internal
        ends = np.cumsum([p.record.samples for p in started]) - 1
        for i in range(1, len(started)):
            here, end = started[i], seen[ends[i - 1]]
            if here.record.follows(started[i - 1].record) and np.isfinite(end).all():
                internal = here.start.internal.copy()
                internal[known:] = end[known:]
                started[i] = StartedPiece(here.record, Start(here.start.state, internal))
        return started

    @cached_property
    def fades(self) -> bool:
        """Whether all outputs are far quieter where fits are judged than where they are made."""
        held, fitted = (
            np.std(np.concatenate([piece.record.Y for piece in pieces]), axis=0)
            for pieces in (self.held_out, self.trial)
        )
        return bool(np.all(self.policy.fades * held < fitted))

    @property
    def steps(self) -> int:
        """Most steps of a stage."""
        return self.policy.steps(self.record.samples)

    @property
    def screened(self) -> Record:
        """The contiguous part of a record that is screened: the liveliest, while it moves.

        What a motion has died away to is the same noise for all models, and over most of a record
        it says that none of them explains anything.
        """
        policy = self.policy
        most = policy.screened if self.motion_sizes.size else policy.screened_imposed
        part = liveliest(self.record, most)
        return part.part(
            0, moving(part.Y, policy.shape_above * self.scales.noise, policy.least_moving)
        )

    def runner(self, model: MechanicalModel, level: Level = FREE) -> Runner:
        """Return what runs a model and those that are tried in its place, led at a level."""
        dt, spend = self.record.dt, self.work.spend
        return Runner(model, dt, self.peak, level, self.scales, spend=spend)

    def motion(self, model: MechanicalModel, record: Record) -> Smoothed:
        """Return the smoothed motion along the record or a part of it."""
        return smooth(model, record, self.scales, self.amplitude, self.policy.following)

    def sizes(self, model: MechanicalModel) -> Array:
        """Return the sizes of a model's states, internal ones included."""
        return state_sizes(model, self.motion_sizes)

    def closest_runs(
        self, model: MechanicalModel, pieces: Sequence[StartedPiece]
    ) -> tuple[RecordRun, list[StartedPiece]]:
        """Return a model ready to run, and the pieces with the starts that suit it best."""
        for known in tuple(self._recent):
            if known.model is model and known.pieces is pieces:
                return known.run, known.started
        run = self.runner(model).run(model)
        started = self.with_fitted_starts(run, with_rest(model, pieces))
        self._recent.append(_ClosestRuns(model, pieces, run, started))
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
            return fitted_starts(run, pieces, sizes)
        linear = run.model.without_effects()
        none = rest(linear).internal
        bare = [StartedPiece(p.record, Start(p.start.state, none)) for p in pieces]
        straight = fitted_starts(self.runner(linear).run(linear), bare, self.motion_sizes)
        others = [
            StartedPiece(piece.record, Start(other.start.state, piece.start.internal))
            for piece, other in zip(pieces, straight, strict=True)
        ]
        return fitted_starts(run, pieces, sizes, others)


def _moving_force(model: MechanicalModel, amplitude: float, scales: Scales) -> float:
    """Return the largest force that a motion of this size takes in the model."""
    m, omega = model.matrices, scales.bandwidth
    rows = [np.abs(np.diag(matrix)) for matrix in (m.K, m.C * omega, m.M * omega**2)]
    return float(np.max(np.sum(rows, axis=0)) * amplitude)


def _no_such_motion(amplitude: float, scales: Scales) -> InvalidInputError:
    return invalid(
        "data",
        described(f"motions of {amplitude:.3g} with forces of {np.max(scales.force):.3g}"),
        "motions that the model can have",
        "Check the units of the columns, and the model's masses and stiffnesses.",
    )


def prepare(model: MechanicalModel, record: Record, policy: Policy) -> PreparedRecord:
    """Prepare a record for fits of a model and its extensions."""
    scales = scales_of(model, record)
    amplitude = amplitude_of(model, record, scales.bandwidth)
    linear = model.without_effects()
    if 0 < _OUT_OF_PROPORTION * _moving_force(model, amplitude, scales) < np.max(scales.force):
        raise _no_such_motion(amplitude, scales)
    try:
        motion = smooth(linear, record, scales, amplitude, policy.following)
    except np.linalg.LinAlgError as error:
        raise _no_such_motion(amplitude, scales) from error
    peak = peak_of(model, record, scales.bandwidth, motion.q)
    repeated = repeats(model, record)
    if repeated is not None:
        scales = replace(scales, noise=repeated.noise)
    kept, judges = sides(model, record)
    first = max(2 * policy.trial // len(kept), policy.trial // 4, least_samples(model))
    short = policy.window(record.samples)
    longest = max(part.samples for part in record.parts)
    length = short if drifts(model, longest * record.dt) else longest

    def pieces(parts: Sequence[Record], length: int = length) -> list[StartedPiece]:
        cut = [part.part(*ends) for part in parts for ends in _windows((0, part.samples), length)]
        return with_rest(
            model, [StartedPiece(part, motion.start(linear, part.first)) for part in cut]
        )

    return PreparedRecord(
        record, policy, scales, amplitude, peak, _motion_sizes(model, motion),
        estimation=pieces(kept),
        trial=pieces([part.part(0, min(first, part.samples)) for part in kept]),
        held_out=pieces(judges),
        everything=pieces(record.parts),
        windows=pieces(record.parts, length=short),
        motion_before=motion, short=short, repeats=repeated, work=Work(policy.work),
    )  # fmt: skip


def with_rest(model: MechanicalModel, pieces: Sequence[StartedPiece]) -> list[StartedPiece]:
    """Return the pieces with internal states that suit a model, at rest where they are new."""
    found = []
    for piece in pieces:
        internal = rest(model).internal
        known = min(internal.size, piece.start.internal.size)
        internal[:known] = piece.start.internal[:known]
        found.append(StartedPiece(piece.record, Start(piece.start.state, internal)))
    return found


def drifts(model: MechanicalModel, length: float) -> bool:
    """Return whether the linear part integrates over a record of `length` seconds.

    The free run of such a model forgets nothing, so that it is judged in windows.
    """
    if not model.free:
        return False
    poles = np.linalg.eigvals(model.matrices.first_order()[0])
    return bool(np.min(np.abs(poles)) * length < 1)


def _motion_sizes(model: MechanicalModel, motion: Smoothed) -> Array:
    """Return the size of each free displacement and velocity."""
    free = model.matrices.free
    sizes = np.concatenate([np.std(motion.q[free], axis=1), np.std(motion.v[free], axis=1)])
    largest = np.max(sizes, initial=0.0)
    return np.maximum(sizes, 1e-6 * largest) if largest > 0 else np.ones(len(sizes))


def _windows(part: tuple[int, int], length: int) -> list[tuple[int, int]]:
    """Cut a range of samples into windows of about a length."""
    count = max(1, round((part[1] - part[0]) / length))
    marks = np.linspace(*part, count + 1).astype(int).tolist()
    return list(itertools.pairwise(marks))
