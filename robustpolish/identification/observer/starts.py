"""The start from which a run comes closest to a record, found over stretches that grow."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.identification.observer.runs import Chains, InitialState, RecordRun, StartedPiece
from robustpolish.identification.record import Record, output_sizes
from robustpolish.machines.mechanical.data import MechanicalData, dynamic_effects
from robustpolish.machines.mechanical.equations import sizes_of_states

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


def state_sizes(model: MechanicalData, states: Array) -> Array:
    """Append the sizes of internal states to those of the free displacements and velocities."""
    q, v = (float(np.max(half, initial=1e-12)) for half in np.split(states, 2))
    sizes: list[float] = []
    for item in model.equations:
        sizes += [size or 1.0 for size in sizes_of_states(item, q, v)]
    for i, effect in dynamic_effects(model):
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
