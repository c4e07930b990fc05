"""The start from which a run comes closest to a record, found over stretches that grow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.base.budget import parallel_map
from robustpolish.identification.observer.runs import InitialState, RecordRun, StartedPiece
from robustpolish.identification.record import Record, output_sizes
from robustpolish.machines.mechanical.data import MechanicalData, dynamic_effects

# Estimation of initial states by damped least squares over growing stretches.

_ROUNDS = 8
_STEP = 1e-7  # as in fits, short enough not to span the small jumps of errors


def refine_starts(
    run: RecordRun,
    pieces: Sequence[StartedPiece],
    samples: int,
    sizes: Array,
    weights: Array,
    settled: float = 1e-6,
) -> list[StartedPiece]:
    """Improve the starts of pieces over their first samples, by damped least squares.

    No piece becomes worse. All are run together, each with a damping of its own.
    """
    heads = [p.record.part(0, min(samples, p.record.samples)) for p in pieces]
    vectors = np.array([piece.start.vector for piece in pieces])
    step, damping = (
        (1.0, np.zeros(len(pieces))) if run.linear else (_STEP, np.full(len(pieces), 1e-3))
    )

    def errors(rows: Array, which: Sequence[int]) -> list[Array]:
        found = _output_errors(run, tuple(heads[i] for i in which), rows, weights)
        return [error.ravel() for error in found]

    active = list(range(len(pieces)))
    now = dict(zip(active, errors(vectors, active), strict=True))
    for _ in range(1 if run.linear else _ROUNDS):
        if not active:
            break

        def moved(j: int, active: Sequence[int] = active) -> list[Array]:
            ahead = vectors[active]
            ahead[:, j] += step * sizes[j]
            return errors(ahead, active)

        columns = parallel_map(moved, range(len(sizes)))
        jacobians = {
            i: np.column_stack([(column[k] - now[i]) / step for column in columns])
            for k, i in enumerate(active)
        }
        done, waiting = [], active
        for attempt in range(5):
            tried = np.array(
                [
                    vectors[i]
                    - _damped_step(jacobians[i], now[i], damping[i] * 10**attempt) * sizes
                    for i in waiting
                ]
            )
            still = []
            for i, row, after in zip(waiting, tried, errors(tried, waiting), strict=True):
                if not after @ after < now[i] @ now[i]:
                    still.append(i)
                    continue
                if after @ after > (1 - settled) * (now[i] @ now[i]):
                    done.append(i)
                vectors[i], now[i] = row, after
                damping[i] *= 10.0 ** (attempt - 1)
            waiting = still
            if not waiting:
                break
        active = [i for i in active if i not in done and i not in waiting]
    return [
        StartedPiece(piece.record, piece.start.with_vector(row))
        for piece, row in zip(pieces, vectors, strict=True)
    ]


def output_weights(record: Record) -> Array:
    """Return what makes errors comparable: one over the size of each output."""
    return 1 / output_sizes(record.Y)


def squared_errors_of(
    run: RecordRun, pieces: Sequence[StartedPiece], samples: int, weights: Array
) -> list[float]:
    """Return for each piece the sum of the squares of its weighted errors over its first samples.

    Parameters
    ----------
    run : RecordRun
    pieces : sequence of StartedPiece
    samples : int
        All of a piece that has no more.
    weights : ndarray, shape (ny,)
        See :func:`output_weights`.
    """
    heads = tuple(p.record.part(0, min(samples, p.record.samples)) for p in pieces)
    errors = _output_errors(run, heads, np.array([p.start.vector for p in pieces]), weights)
    return [float(np.sum(error**2)) for error in errors]


def _output_errors(
    run: RecordRun, records: tuple[Record, ...], starts: Array, weights: Array
) -> list[Array]:
    """Return the weighted errors of each piece; a run that diverges has very large ones."""
    with np.errstate(over="ignore", invalid="ignore"):
        error = -run.errors_along(records, starts) * weights
    known = np.where(np.isfinite(error), np.clip(error, -1e6, 1e6), 1e6)
    return np.split(known, np.cumsum([record.samples for record in records])[:-1])


def _damped_step(jacobian: Array, error: Array, damping: float) -> Array:
    """Solve for the step; directions that the outputs hardly show are left as they are."""
    values, vectors = np.linalg.eigh(jacobian.T @ jacobian)
    seen = values > 1e-12 * max(values[-1], 1e-300)
    inverse = np.where(seen, 1 / np.where(seen, values + damping * values[-1], 1.0), 0.0)
    return vectors @ (inverse * (vectors.T @ (jacobian.T @ error)))


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
# Relative fall with which the start of a stretch is good enough for the next one.
_COARSE_TOLERANCE = 1e-2
# Mean square error over the first stretch, in those of the outputs, from which a start is wrong: a
# wrong model follows its few samples, too.
_WRONG_START_ERROR = 0.1


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
        What matters of each state: see :func:`state_sizes`, or :func:`visible_sizes`.

    Returns
    -------
    InitialState
    """
    if not sizes.size:
        return guesses[0]
    pieces, weights = [StartedPiece(record, guess) for guess in guesses], output_weights(record)
    if run.linear:
        found = fitted_starts(run, pieces, sizes)
        return found[int(np.argmin(squared_errors_of(run, found, record.samples, weights)))].start
    spans = doubling_lengths(record.samples)
    brief = _fit_over_short_stretches(run, pieces, spans[0], sizes, weights)
    search = _GrowingStretchSearch(run, sizes, weights, record.samples)
    found = search.best_of(search.over([*pieces, *brief], spans[0]), spans[0])
    for before, span in pairwise(spans):
        found = search.best_of(search.longer(found, before, span), span)
    return found[0].start


@dataclass
class _GrowingStretchSearch:
    """A search for the start of one record over stretches that grow.

    Over a stretch twice as long a start may be a wrong phase although it was right over the one
    before: where runs part, as near chaos, what noise left open has grown too far. Then the
    stretch grows by less. Where even that loses the record the model is wrong, not the start.
    """

    run: RecordRun
    sizes: Array
    weights: Array
    longest: int
    hopeless: bool = False

    def over(self, pieces: Sequence[StartedPiece], span: int) -> list[StartedPiece]:
        """Return the pieces, their starts improved over a stretch."""
        settled = 1e-6 if span == self.longest else _COARSE_TOLERANCE
        return refine_starts(self.run, pieces, span, self.sizes, self.weights, settled)

    def best_of(self, pieces: Sequence[StartedPiece], span: int) -> list[StartedPiece]:
        """Return the best piece first, then others that are nearly as good and not the same."""
        errors = _errors(self.run, pieces, span, self.weights)
        kept: list[int] = []
        for i in np.argsort(errors, kind="stable").tolist():
            near = errors[i] <= _ALTERNATIVE_RATIO * errors[kept[0]] if kept else True
            if near and all(abs(errors[i] - errors[j]) > _SAME * errors[j] for j in kept):
                kept.append(i)
        return [pieces[i] for i in kept[:_MOST_ALTERNATIVES]]

    def longer(
        self, pieces: Sequence[StartedPiece], before: int, span: int, halvings: int = 3
    ) -> list[StartedPiece]:
        """Return the pieces over a longer stretch, grown in smaller steps if that loses it."""
        found = self.over(pieces, span)
        middle = round(np.sqrt(before * span))
        if (
            self.hopeless
            or not before < middle < span
            or not self._lost(pieces, before, found, span)
        ):
            return found
        if not halvings:
            self.hopeless = True
            return found
        halfway = self.longer(pieces, before, middle, halvings - 1)
        if self.hopeless:
            return found
        return [*self.longer(halfway, middle, span, halvings - 1), *found]

    def _lost(
        self, pieces: Sequence[StartedPiece], before: int, after: Sequence[StartedPiece], span: int
    ) -> bool:
        least = min(_errors(self.run, pieces, before, self.weights))
        return min(_errors(self.run, after, span, self.weights)) > _LOST_RATIO * least


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
        As of :func:`fitted_start`.
    others : sequence of StartedPiece, optional
        The same pieces with other starts, which are tried beside those over the first stretches.
    """
    found, given = list(pieces), others
    if not sizes.size or not found:
        return found
    weights = output_weights(max((p.record for p in pieces), key=lambda record: record.samples))
    longest = max(piece.record.samples for piece in pieces)
    for i, samples in enumerate([longest] if run.linear else doubling_lengths(longest)):
        settled = 1e-6 if samples == longest else _COARSE_TOLERANCE
        found = refine_starts(run, found, samples, sizes, weights, settled)
        if others and i < _ALTERNATIVE_STRETCHES:
            others = refine_starts(run, others, samples, sizes, weights, settled)
        if i == 0 and not run.linear:
            guesses = [known for known in (pieces, given) if known]
            found = _restart_wrong_pieces(run, found, guesses, samples, sizes, weights)
        if others and (i + 1 == _ALTERNATIVE_STRETCHES or samples == longest):
            found = _better_starts(run, found, others, samples, weights)
            others = ()
    return found


def _restart_wrong_pieces(
    run: RecordRun,
    found: list[StartedPiece],
    guesses: Sequence[Sequence[StartedPiece]],
    samples: int,
    sizes: Array,
    weights: Array,
) -> list[StartedPiece]:
    """Return the pieces, those whose start is wrong over a stretch begun over very short ones."""
    errors = _errors(run, found, samples, weights)
    wrong = [i for i, error in enumerate(errors) if error > _WRONG_START_ERROR]
    if not wrong:
        return found
    for known in guesses:
        brief = _fit_over_short_stretches(run, [known[i] for i in wrong], samples, sizes, weights)
        brief = refine_starts(run, brief, samples, sizes, weights, _COARSE_TOLERANCE)
        better = _better_starts(run, [found[i] for i in wrong], brief, samples, weights)
        for i, piece in zip(wrong, better, strict=True):
            found[i] = piece
    return found


def _fit_over_short_stretches(
    run: RecordRun, pieces: Sequence[StartedPiece], samples: int, sizes: Array, weights: Array
) -> list[StartedPiece]:
    """Return pieces with their starts improved over stretches shorter than the first usual one."""
    brief = list(pieces)
    for span in (n for n in (samples // 8, samples // 4, samples // 2) if n >= _SHORTEST_STRETCH):
        brief = refine_starts(run, brief, span, sizes, weights, _COARSE_TOLERANCE)
    return brief


def _better_starts(
    run: RecordRun,
    found: Sequence[StartedPiece],
    others: Sequence[StartedPiece],
    samples: int,
    weights: Array,
) -> list[StartedPiece]:
    """Return of each two pieces the one that its start follows better over the first samples."""
    left = (squared_errors_of(run, pieces, samples, weights) for pieces in (found, others))
    return [one if a <= b else other for one, other, a, b in zip(found, others, *left, strict=True)]


def _errors(
    run: RecordRun, pieces: Sequence[StartedPiece], samples: int, weights: Array
) -> list[float]:
    """Return the mean square errors of pieces over their first samples."""
    return [
        square / (min(samples, piece.record.samples) * piece.record.Y.shape[1])
        for piece, square in zip(
            pieces, squared_errors_of(run, pieces, samples, weights), strict=True
        )
    ]


def doubling_lengths(samples: int) -> list[int]:
    """Return lengths that grow twofold up to the whole."""
    found = [samples]
    while found[0] > 2 * _SHORTEST:
        found.insert(0, found[0] // 2)
    return found


def state_sizes(model: MechanicalData, states: Array) -> Array:
    """Append the sizes of internal states to those of the free displacements and velocities."""
    half = len(states) // 2
    q, v = np.max(states[:half], initial=1e-12), np.max(states[half:], initial=1e-12)
    sizes: list[float] = []
    for _, effect in dynamic_effects(model):
        kind = effect.definition
        known = kind.state_sizes(effect.values, float(q), float(v))
        sizes += [size or 1.0 for size in known] if known else [1.0] * kind.states
    return np.concatenate([states, np.array(sizes, dtype=float)])


def visible_sizes(linear: RecordRun, record: Record, start: InitialState) -> Array:
    """Return for each state of a linear model what would move its outputs by their own size."""
    vector = start.vector
    base = linear.over(StartedPiece(record, start)).outputs
    size = output_sizes(record.Y)
    scale = np.ones(vector.size)
    for i in range(vector.size):
        moved = vector.copy()
        moved[i] += 1.0
        other = linear.over(StartedPiece(record, start.with_vector(moved))).outputs
        change = np.nan_to_num((other - base) / size)
        largest = float(np.max(np.abs(change)))
        scale[i] = 1 / largest if largest > 0 else 1.0
    return scale
