"""The start from which a run comes closest to a record, found over stretches that grow."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.identification.observer import kalman
from robustpolish.identification.observer.runs import (
    Chains,
    InitialState,
    RecordRun,
    Runner,
    StartedPiece,
    rest,
)
from robustpolish.identification.record import Record, least_samples, output_sizes
from robustpolish.machines.effects.evaluate import force_with
from robustpolish.machines.mechanical import data
from robustpolish.machines.mechanical.equations import sizes_of_states
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.simulation import IntersampleLines, NonlinearResponse

# Estimation of the missing force by a Kalman smoother on the measured outputs.


_INITIAL_AMPLITUDE = 3.0
# Samples to which the start is fitted: many swings of every machine, and quick.
_START_SAMPLES = 4000
# Levels of a model that may be nearly right, to predict with and to see the motion.
_OBSERVER_LEVELS = tuple(kalman.Level(share) for share in (0.01, 0.03, 0.1, 0.3, 1.0))


@dataclass(frozen=True, eq=False)
class SmoothedMotion:
    """Motion and missing force along a record.

    Attributes
    ----------
    q, v, a : ndarray, shape (coordinates, samples)
        Displacements and velocities of all coordinates, and the accelerations that the model
        gives them without the missing force.
    force : ndarray, shape (sites, samples)
        Missing force at each site.
    inputs : ndarray, shape (samples, signals)
    outputs : ndarray, shape (samples, ny)
        Noise-free outputs.
    internal : ndarray, shape (samples, nz)
        Internal states of the effects, from the forward pass.
    """

    q: Array
    v: Array
    a: Array
    force: Array
    inputs: Array
    outputs: Array
    internal: Array

    def start(self, model: MechanicalModel, sample: int) -> InitialState:
        """Return the state at a sample."""
        free = model.matrices.free
        state = np.concatenate([self.q[free, sample], self.v[free, sample]])
        return InitialState(state, self.internal[sample])


def known_forces(
    model: MechanicalModel, q: Array, v: Array, time: Array, dt: float, inputs: Array
) -> kalman.PortForces | None:
    """Return the forces of a model's effects along a motion."""
    effects = [effect for _, effect in data.dynamic_effects(model)]
    if not effects:
        return None
    motions = ((e, data.motion_at(model, e, time, q, v, dt / 4, inputs)) for e in effects)
    values = [force_with(effect.definition, effect.values, motion) for effect, motion in motions]
    pairs = [pair for effect in effects for pair in data.port_pairs(effect)]
    return kalman.PortForces(
        np.vstack([data.port_rows(model, e) for e in effects]), pairs, np.vstack(values)
    )


_DIVERGED_AMPLITUDE = 1e3
"""Times the amplitude of a motion beyond which what was smoothed is none."""


def best_observer_level(
    model: MechanicalModel, record: Record, scales: kalman.Scales, levels: Sequence[kalman.Level]
) -> tuple[kalman.Level, NonlinearResponse]:
    """Return the level at which an observer predicts the record best, and what it saw.

    The observer begins at rest: what it does in the first samples is not counted.

    Parameters
    ----------
    model : MechanicalModel
    record : Record
    scales : Scales
    levels : sequence of Level
        The first of them if the observer diverges at all.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the observer's equation has no solution at any level.
    """
    best, chosen, unsolved = np.inf, None, None
    piece = StartedPiece(record, rest(model))
    for level in levels:
        try:
            run = Runner(model, record.dt, scales.amplitude, level, scales).run(model)
        except np.linalg.LinAlgError as error:
            unsolved = error
            continue
        found = run.over(piece, keep=True)
        tail = (record.Y - found.outputs)[record.samples // 20 :]
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            # minus infinity where nothing is left: data that this very model has made
            score = float(np.sum(np.log(np.mean(tail**2, axis=0))))
        if chosen is None or score < best:
            chosen = level, found
            best = np.inf if np.isnan(score) else score
    if chosen is None:
        assert unsolved is not None
        raise unsolved
    return chosen


def smooth(
    model: MechanicalModel, record: Record, scales: kalman.Scales, levels: Sequence[kalman.Level]
) -> SmoothedMotion:
    """Return motion and missing force along a record, led by the data as far as they ask for.

    Effects of the model enter as known forces along the motion that a forward pass of the
    nonlinear observer finds. Each of several records is smoothed by itself. Arguments as of
    :func:`best_observer_level`.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # no level may follow the record
        each = [_smooth(model, part, scales, levels) for part in record.parts]
    if len(each) == 1:
        return each[0]
    rows = ("inputs", "outputs", "internal")  # have a row for each sample, others a column
    return SmoothedMotion(
        **{
            name: np.concatenate([getattr(s, name) for s in each], 0 if name in rows else 1)
            for name in SmoothedMotion.__dataclass_fields__
        }
    )


def _smooth(
    model: MechanicalModel, record: Record, scales: kalman.Scales, levels: Sequence[kalman.Level]
) -> SmoothedMotion:
    """Smooth one record, or a contiguous part of one."""
    level, seen = best_observer_level(model, record, scales, levels)
    W, Y, nf = record.own(record.signals(model)), record.raw_outputs(model), len(model.free)
    observer = kalman.LinearObserver(model, record.dt, level, scales)
    sizes, m = _start_sizes(model, scales), model.matrices
    lines = record.own_lines(record.lines(model))
    first = min(len(Y), _START_SAMPLES)
    begin = None if lines is None else IntersampleLines(*(side[:first] for side in lines))
    # The force of a law far stronger than the springs is none that is known from a motion that
    # lacks it: where it leaves all bounds it is left out.
    bound, travels = _DIVERGED_AMPLITUDE * scales.amplitude or np.inf, model.frame.sizes[m.free]

    def along(forces: kalman.PortForces | None) -> Array:
        head = None if forces is None else forces._replace(values=forces.values[:, :first])
        errors = observer.innovations(Y[:first], W[:first], head, lines=begin)[1]
        start = observer.likeliest_start(errors, sizes)
        return observer.smooth(*observer.innovations(Y, W, forces, start, lines))

    q, v = (np.nan_to_num(part) for part in motion_of(model, seen.states, W))
    forces = s = None
    for _ in range(2):  # along the motion that the forward pass found, then the smoothed one
        forces = known_forces(model, q, v, record.time, record.dt, W)
        s = None
        if forces is None or not np.isfinite(forces.values).all():
            break
        with suppress(np.linalg.LinAlgError):
            s = along(forces)
        if s is None or not np.max(np.abs(s[:, :nf] / travels), initial=0.0) <= bound:
            s = None
            break
        q, v = motion_of(model, s, W)
    if s is None:
        forces, s = None, along(None)
        q, v = motion_of(model, s, W)
    A, B, _, _ = m.first_order()
    # The missing force is left out: with it, errors of the masses could explain it away.
    a = np.zeros_like(q)
    a[m.free] = A[nf:] @ np.concatenate([q[m.free], v[m.free]]) + B[nf:] @ W.T
    outputs = s @ observer.system.C.T + W @ observer.system.D.T
    if forces is not None:
        a[m.free] += m.inverse_mass @ (forces.rows.T @ forces.values)[m.free]
        outputs = outputs + (observer.port_steps(forces.rows, forces.pairs)[2] @ forces.values).T
    return SmoothedMotion(q, v, a, s[:, 2 * nf :].T, W, outputs, seen.internal)


def best_observer_run(model: MechanicalModel, record: Record) -> NonlinearResponse:
    """Return the predictions and states of the observer that predicts a record best."""
    return best_observer_level(model, record, kalman.scales_of(model, record), _OBSERVER_LEVELS)[1]


def smoothed_motion(model: MechanicalModel, record: Record) -> SmoothedMotion | None:
    """Return the smoothed motion of a record; None if it is too short or cannot be followed."""
    if min(part.samples for part in record.parts) < least_samples(model):
        return None
    found = smooth(model, record, kalman.scales_of(model, record), _OBSERVER_LEVELS)
    finite = all(np.isfinite(part).all() for part in (found.q, found.force, found.internal))
    return found if finite else None


def _start_sizes(model: MechanicalModel, scales: kalman.Scales) -> Array:
    """Return what free displacements and velocities may be at the start, roughly.

    No coordinate holds much more energy than the softest one does at the measured amplitude, and
    none moves much faster than its displacement and the bandwidth allow. This holds still what
    the outputs hardly show, a stiff mass that is not measured.
    """
    m, sizes = model.matrices, model.frame.sizes
    mass, stiffness = (np.diag(part * sizes**2)[m.free] for part in (m.M, m.K))
    elastic = np.where(stiffness > 0, stiffness, mass * scales.bandwidth**2)
    if scales.amplitude == 0 or not elastic.size:
        return np.full(2 * len(elastic), np.inf)
    energy = np.min(elastic) * (_INITIAL_AMPLITUDE * scales.amplitude) ** 2
    q = np.where(stiffness > 0, np.sqrt(energy / elastic), np.inf)
    v = np.minimum(np.sqrt(energy / mass), _INITIAL_AMPLITUDE * scales.bandwidth * q)
    return np.concatenate([q, v]) * np.tile(sizes[m.free], 2)


def motion_of(model: MechanicalModel, states: Array, W: Array) -> tuple[Array, Array]:
    """Return displacements and velocities of all coordinates, shape (coordinates, samples)."""
    Lq, Lv, Rq, Rv = model.matrices.motion_map
    s = states[:, : Lq.shape[1]].T
    return Lq @ s + Rq @ W.T, Lv @ s + Rv @ W.T


# Estimation of initial states by damped least squares over growing stretches.

_ROUNDS = 8
_STEP = 1e-7  # as in fits, short enough not to span the small jumps of errors
_SHORTEST = 50
# Samples of the very first stretches of unknown starts: a spring that stiffens may swing several
# times over what its linear part takes for one swing.
_SHORTEST_STRETCH = 6
# Times the mean square error with which a start is still tried beside the best, how many are, the
# relative difference below which two are the same, and the rise over a longer stretch that noise
# does not make: then the start is lost.
_ALTERNATIVE_RATIO = 4.0
_MOST_ALTERNATIVES = 2
_SAME = 1e-6
_LOST_RATIO = 1.5
# Stretches over which a second start is tried beside the first.
_ALTERNATIVE_STRETCHES = 2
# Relative fall with which a start is good enough, and that of a stretch for the next one.
_TOLERANCE, _COARSE_TOLERANCE = 1e-6, 1e-2
# Share of an output's size that an error counts for at least.
_LEAST_LEFT = 1e-6
# Mean square error over the first stretch, in those of the outputs, from which a start is wrong: a
# wrong model follows its few samples, too.
_WRONG_START_ERROR = 0.1


class StartFit:
    """Least-squares estimation of the starts of pieces, each over its first samples.

    Parameters
    ----------
    run : RecordRun
    sizes : ndarray, shape (n,)
        What matters of each state: see :func:`state_sizes`, or :func:`visible_sizes`.
    pieces : sequence of StartedPiece
        The sizes of the outputs of the longest make errors comparable.
    """

    def __init__(self, run: RecordRun, sizes: Array, pieces: Sequence[StartedPiece]) -> None:
        longest = max((piece.record for piece in pieces), key=lambda record: record.samples)
        self.run, self.sizes, self.longest = run, sizes, longest.samples
        self.weights = 1 / output_sizes(longest.Y)
        self.chains = Chains(run.model)

    def _errors(self, records: Sequence[Record], starts: Array) -> list[Array]:
        """Return the weighted errors of each piece; a run that diverges has very large ones."""
        with np.errstate(over="ignore", invalid="ignore"):
            error = -self.run.errors_along(tuple(records), starts) * self.weights
        known = np.where(np.isfinite(error), np.clip(error, -1e6, 1e6), 1e6)
        return np.split(known, np.cumsum([record.samples for record in records])[:-1])

    def squares(self, pieces: Sequence[StartedPiece], samples: int) -> list[float]:
        """Return the sum of the squares of each piece's weighted errors."""
        errors = self._errors(_heads(pieces, samples), np.array([p.start.vector for p in pieces]))
        return [float(np.sum(error**2)) for error in errors]

    def mean_squares(self, pieces: Sequence[StartedPiece], samples: int) -> list[float]:
        """Return the mean square of each piece's weighted errors."""
        sizes = (head.Y.size for head in _heads(pieces, samples))
        return [s / n for s, n in zip(self.squares(pieces, samples), sizes, strict=True)]

    def refined(
        self, pieces: Sequence[StartedPiece], samples: int, settled: float = _TOLERANCE
    ) -> list[StartedPiece]:
        """Improve the starts of pieces by damped least squares.

        No piece becomes worse. All are run together, each with a damping of its own.
        """
        heads, sizes, linear = _heads(pieces, samples), self.sizes, self.run.linear
        vectors = np.array([piece.start.vector for piece in pieces])
        step, rounds = (1.0, 1) if linear else (_STEP, _ROUNDS)
        damping = np.full(len(pieces), 0.0 if linear else 1e-3)

        def errors(rows: Array, which: Sequence[int]) -> list[Array]:
            return [error.ravel() for error in self._errors([heads[i] for i in which], rows)]

        active = list(range(len(pieces)))
        now = dict(zip(active, errors(vectors, active), strict=True))
        while active and rounds:
            rounds -= 1

            def change(group: Sequence[int], active: Sequence[int] = active) -> Array:
                ahead = vectors[active]
                ahead[:, group] += step * sizes[group]
                after = zip(errors(ahead, active), active, strict=True)
                moved = np.concatenate([(error - now[i]) / step for error, i in after])
                return moved.reshape(-1, len(self.weights))

            changes = self.chains.changes(self.chains.states, change)
            columns = np.column_stack([each.ravel() for each in changes])
            marks = np.cumsum([now[i].size for i in active])[:-1]
            jacobians = dict(zip(active, np.split(columns, marks), strict=True))
            waiting, active = active, []
            for attempt in range(5):
                trust = damping * 10**attempt
                steps = [_damped_step(jacobians[i], now[i], trust[i]) for i in waiting]
                tried = vectors[waiting] - np.array(steps) * sizes
                still = []
                for i, row, after in zip(waiting, tried, errors(tried, waiting), strict=True):
                    if not after @ after < now[i] @ now[i]:
                        still.append(i)
                        continue
                    if after @ after <= (1 - settled) * (now[i] @ now[i]):
                        active.append(i)  # it may still become better
                    vectors[i], now[i] = row, after
                    damping[i] *= 10.0 ** (attempt - 1)
                waiting = still
                if not waiting:
                    break
            active.sort()
        return [piece.with_start(row) for piece, row in zip(pieces, vectors, strict=True)]

    def refined_by_noise(self, pieces: Sequence[StartedPiece], samples: int) -> list[StartedPiece]:
        """Improve starts once more, each output weighted by the error that is left of it.

        Weighted by its size alone the noise of a faint output would spoil what a clear one tells
        (reweighted least squares, the maximum of the likelihood).
        """
        if len(self.weights) < 2:
            return list(pieces)
        heads, starts = _heads(pieces, samples), np.array([p.start.vector for p in pieces])
        left = np.sqrt(np.mean(np.concatenate(self._errors(heads, starts)) ** 2, axis=0))
        self.weights = self.weights / np.maximum(left, _LEAST_LEFT)
        return self.refined(pieces, samples)

    def refined_briefly(self, pieces: Sequence[StartedPiece], samples: int) -> list[StartedPiece]:
        """Improve starts over stretches shorter than the first usual one."""
        brief = list(pieces)
        for span in (samples // 8, samples // 4, samples // 2):
            if span >= _SHORTEST_STRETCH:
                brief = self.refined(brief, span, _COARSE_TOLERANCE)
        return brief

    def better(
        self, pieces: Sequence[StartedPiece], others: Sequence[StartedPiece], samples: int
    ) -> list[StartedPiece]:
        """Return of each two pieces the one that its start follows better."""
        each = (zip(side, self.squares(side, samples), strict=True) for side in (pieces, others))
        return [one if a <= b else other for (one, a), (other, b) in zip(*each, strict=True)]


def _heads(pieces: Sequence[StartedPiece], samples: int) -> list[Record]:
    return [piece.record.part(0, min(samples, piece.record.samples)) for piece in pieces]


def _damped_step(jacobian: Array, error: Array, damping: float) -> Array:
    """Solve for the step; directions that the outputs hardly show are left as they are."""
    values, vectors = np.linalg.eigh(jacobian.T @ jacobian)
    seen = values > 1e-12 * max(values[-1], 1e-300)
    inverse = np.where(seen, 1 / np.where(seen, values + damping * values[-1], 1.0), 0.0)
    return vectors @ (inverse * (vectors.T @ (jacobian.T @ error)))


def fitted_start(
    run: RecordRun, record: Record, guesses: Sequence[InitialState], sizes: Array
) -> InitialState:
    """Find the start from which a free run comes closest to the measured outputs.

    Parameters
    ----------
    run : RecordRun
    record : Record
        All of it is run over.
    guesses : sequence of Start
        Where the search may begin: at the best of them over the first stretch.
    sizes : ndarray, shape (n,)
        As of :class:`StartFit`.

    Returns
    -------
    InitialState
    """
    if not sizes.size:
        return guesses[0]
    pieces = [StartedPiece(record, guess) for guess in guesses]
    search, hopeless = StartFit(run, sizes, pieces), False
    if run.linear:
        found = fitted_starts(run, pieces, sizes)
        return found[int(np.argmin(search.squares(found, record.samples)))].start

    def over(pieces: Sequence[StartedPiece], span: int) -> list[StartedPiece]:
        return search.refined(
            pieces, span, _TOLERANCE if span == record.samples else _COARSE_TOLERANCE
        )

    def best_of(pieces: Sequence[StartedPiece], span: int) -> list[StartedPiece]:
        """Return the best piece first, then others that are nearly as good and not the same."""
        errors = search.mean_squares(pieces, span)
        kept: list[int] = []
        for i in np.argsort(errors, kind="stable").tolist():
            near = errors[i] <= _ALTERNATIVE_RATIO * errors[kept[0]] if kept else True
            if near and all(abs(errors[i] - errors[j]) > _SAME * errors[j] for j in kept):
                kept.append(i)
        return [pieces[i] for i in kept[:_MOST_ALTERNATIVES]]

    def longer(
        pieces: Sequence[StartedPiece], before: int, span: int, halvings: int = 3
    ) -> list[StartedPiece]:
        """Return the pieces over a longer stretch, grown in smaller steps if that loses it.

        Over a stretch twice as long a start may be a wrong phase although it was right over the one
        before: where runs part, as near chaos, what noise left open has grown too far. Where even
        smaller steps lose the record the model is wrong, not the start.
        """
        nonlocal hopeless
        found, middle = over(pieces, span), round(np.sqrt(before * span))
        if hopeless or not before < middle < span:
            return found
        least, left = (search.mean_squares(*of) for of in ((pieces, before), (found, span)))
        if min(left) <= _LOST_RATIO * min(least):
            return found
        hopeless = not halvings
        halfway = [] if hopeless else longer(pieces, before, middle, halvings - 1)
        return found if hopeless else [*longer(halfway, middle, span, halvings - 1), *found]

    spans = doubling_lengths(record.samples)
    found = over([*pieces, *search.refined_briefly(pieces, spans[0])], spans[0])
    found = best_of(found, spans[0])
    for before, span in pairwise(spans):
        found = best_of(longer(found, before, span), span)
    return search.refined_by_noise(found[:1], record.samples)[0].start


def fitted_starts(
    run: RecordRun,
    pieces: Sequence[StartedPiece],
    sizes: Array,
    others: Sequence[StartedPiece] = (),
) -> list[StartedPiece]:
    """Return pieces with the starts from which free runs come closest to the measured outputs.

    For a linear model that is one least-squares problem, over the whole of a piece, as in
    MATLAB's ``compare``. With effects it is solved by damped Gauss-Newton steps on stretches that
    grow twofold: errors over a short stretch depend smoothly on the start even where those over a
    long one do not, and over a long run a wrong start is a wrong phase.

    Parameters
    ----------
    run : RecordRun
    pieces : sequence of StartedPiece
        With the starts at which the search begins.
    sizes : ndarray, shape (n,)
        As of :class:`StartFit`.
    others : sequence of StartedPiece, optional
        The same pieces with other starts, which are tried beside those over the first stretches.
    """
    found, given = list(pieces), others
    if not sizes.size or not found:
        return found
    search = StartFit(run, sizes, pieces)
    longest = search.longest
    for i, samples in enumerate([longest] if run.linear else doubling_lengths(longest)):
        settled = _TOLERANCE if samples == longest else _COARSE_TOLERANCE
        found = search.refined(found, samples, settled)
        if others and i < _ALTERNATIVE_STRETCHES:
            others = search.refined(others, samples, settled)
        if i == 0 and not run.linear:
            errors = search.mean_squares(found, samples)
            wrong = [k for k, error in enumerate(errors) if error > _WRONG_START_ERROR]
            # what is wrong begins over very short stretches
            for known in (pieces, given) if wrong else ():
                if known:
                    brief = search.refined_briefly([known[k] for k in wrong], samples)
                    brief = search.refined(brief, samples, _COARSE_TOLERANCE)
                    better = search.better([found[k] for k in wrong], brief, samples)
                    for k, piece in zip(wrong, better, strict=True):
                        found[k] = piece
        if others and (i + 1 == _ALTERNATIVE_STRETCHES or samples == longest):
            found, others = search.better(found, others, samples), ()
    return search.refined_by_noise(found, longest)


def doubling_lengths(samples: int) -> list[int]:
    """Return lengths that grow twofold up to the whole."""
    found = [samples]
    while found[0] > 2 * _SHORTEST:
        found.insert(0, found[0] // 2)
    return found


def state_sizes(model: data.MechanicalData, states: Array) -> Array:
    """Append the sizes of internal states to those of the free displacements and velocities."""
    q, v = (float(np.max(half, initial=1e-12)) for half in np.split(states, 2))
    sizes: list[float] = []
    for item in model.equations:
        sizes += [size or 1.0 for size in sizes_of_states(item, q, v)]
    for i, effect in data.dynamic_effects(model):
        if i < 0:
            continue
        kind = effect.definition
        known = kind.state_sizes(effect.values, q, v) or [1.0] * kind.states
        sizes += [size or 1.0 for size in known]
    return np.concatenate([states, np.array(sizes, dtype=float)])


def visible_sizes(linear: RecordRun, record: Record, start: InitialState) -> Array:
    """Return for each state of a linear model what would move its outputs by their own size."""
    piece, size = StartedPiece(record, start), output_sizes(record.Y)
    base, scale = linear.over(piece).outputs, []
    for unit in np.eye(start.vector.size):
        other = linear.over(piece.with_start(start.vector + unit)).outputs
        largest = float(np.max(np.abs(np.nan_to_num((other - base) / size))))
        scale.append(1 / largest if largest > 0 else 1.0)
    return np.array(scale)
