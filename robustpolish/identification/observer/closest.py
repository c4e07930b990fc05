"""Starts of runs, improved over their first samples by damped least squares."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robustpolish.arrays import Array
from robustpolish.identification.observer.run import RecordRun, StartedPiece
from robustpolish.identification.record import Record
from robustpolish.long_calls import on_all_cores

_ROUNDS = 8
_STEP = 1e-7  # as in fits, short enough not to span the small jumps of errors


def closest(
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
        found = _errors(run, tuple(heads[i] for i in which), rows, weights)
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

        columns = on_all_cores(moved, range(len(sizes)))
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


def weights_of(record: Record) -> Array:
    """Return what makes errors comparable: one over the size of each output."""
    size = np.std(record.Y, axis=0)
    return 1 / np.where(size > 0, size, 1.0)


def squares(
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
        See :func:`weights_of`.
    """
    heads = tuple(p.record.part(0, min(samples, p.record.samples)) for p in pieces)
    errors = _errors(run, heads, np.array([p.start.vector for p in pieces]), weights)
    return [float(np.sum(error**2)) for error in errors]


def _errors(
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
