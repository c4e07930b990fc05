"""Sizes of whole sets of effects by linear least squares, before anything is fitted by simulation.

Each candidate force is a column: what it changes in the errors of a run. After all that starts, the
model's own numbers and constants can do is taken out of the columns and of the errors, the sizes of
one effect or of several together follow from least squares (a score test, Rao 1948). What helps
only beside another effect is found with it. The columns come from two kinds of run: from the
model's own free runs, and from the linear model along the measured motion, which is the better one
where the model without the effects moves far from the data.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from robustpolish.base.arrays import Array
from robustpolish.base.budget import parallel_map
from robustpolish.identification.fit.least_squares import (
    Fit,
    fit,
    independent_errors,
    normal_of,
    residuals_of,
    windows_from_stage,
)
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.search import screening
from robustpolish.identification.search.score import Place
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.kind import CONSTANT

_TINY = 1e-4
"""Size of a candidate on trial, as a share of the forces."""
_DIVERGED = 1e100
_CONSTANT = 1e-9
"""Spread of a column over its size, from which it varies."""
_WIDTH, _KEPT = 8, 24
"""Sets of each size from which larger ones are made, and that are kept at least."""
_TRACE = 1e-10
"""Share of its trace that makes a matrix of nearly equal columns regular."""


@dataclass(frozen=True, eq=False)
class EffectSet:
    """Effects together, with the sizes that linear least squares gives them.

    Attributes
    ----------
    effects : tuple of Effect
        What explains most stands first; constants that are worth their cost stand last.
    nats : float
        Gain of the score to be expected.
    """

    effects: tuple[Effect, ...]
    nats: float

    @property
    def places(self) -> frozenset[Place]:
        """Kinds and places."""
        return frozenset((e.kind, e.at) for e in self.effects)


@dataclass(frozen=True, eq=False)
class _Sized:
    """Candidates together, their rows of the problem, and sizes."""

    which: tuple[int, ...]
    rows: list[int]
    sizes: Array
    nats: float


class SetProblem:
    """Least squares for the sizes of candidates.

    Parameters
    ----------
    entries : sequence of CandidateColumns
    X : ndarray, shape (errors, coefficients)
        Changes of the errors for a unit of each coefficient of each entry, in this order.
    project : callable
        Takes what starts and the model's own numbers can do out of columns, shape (errors, n).
    e : ndarray, shape (samples, ny)
        Weighted errors, which ``-X @ sizes`` should be.
    noise : ndarray, shape (ny,)
        Of the sensors, weighted alike.
    """

    def __init__(
        self,
        entries: Sequence[screening.CandidateColumns],
        X: Array,
        project: Callable[[Array], Array],
        e: Array,
        noise: Array,
    ) -> None:
        self.entries, self.shape, self.noise = entries, e.shape, noise
        self.tasks = [(i, j) for i, entry in enumerate(entries) for j in range(entry.numbers)]
        self.unit = np.sqrt(np.sum(X**2, axis=0))
        X = X / np.where(self.unit > 0, self.unit, 1.0)
        self.C, self.rest = np.ascontiguousarray(project(X).T), project(e.reshape(-1, 1))[:, 0]
        self.gram, self.target = self.C @ X, -X.T @ self.rest
        self.total = max(float(e.ravel() @ self.rest), 1e-300)
        self.usable = (self.unit > 0) & (np.diag(self.gram) >= screening.HIDDEN)
        self.signs = np.array([entries[i].shape.signs[j] for i, j in self.tasks])
        self.samples = independent_errors(self.rest.reshape(self.shape), noise)
        self.rows: dict[int, list[int]] = {}
        for k, (i, _) in enumerate(self.tasks):
            self.rows.setdefault(i, []).append(k)
        self.candidates = [i for i, rows in self.rows.items() if self.usable[rows].all()]
        self.constants = [i for i in self.candidates if entries[i].kind.family == CONSTANT]
        self.extra = [None, *self.constants]  # none, or one of the constants
        self.alone = np.array([len(self.rows[i]) == 1 for i, _ in self.tasks])

    def best_sets(self, most: int) -> list[EffectSet]:
        """Return sets of up to so many effects that would gain most, the best first."""
        found = self._grow(most)
        # errors are as coloured as what is missing makes them: what the best set leaves tells
        # better how many of them are independent
        if found:
            best = found[0]
            left = self.rest + best.sizes @ self.C[best.rows]
            counted = independent_errors(left.reshape(self.shape), self.noise)
            if counted > self.samples:
                self.samples = counted
                found = self._grow(most)
        return [EffectSet(self._effects(s), s.nats) for s in found]

    def _grow(self, most: int) -> list[_Sized]:
        # one shape of each effect and place goes on into larger sets
        leaders: dict[Place, int] = {}
        singles = self._solved([(i,) for i in self.candidates])
        for found in singles:
            leaders.setdefault(self._place(found.which[0]), found.which[0])
        for i in self.candidates:  # what pulls the wrong way alone may be right beside another
            leaders.setdefault(self._place(i), i)
        kept = [s for s in singles if leaders[self._place(s.which[0])] == s.which[0]]
        laws = [i for i in leaders.values() if i not in self.constants]
        beam = [(i,) for i in laws]
        for _ in range(most - 1):
            larger = {
                frozenset((*smaller, i)): (*smaller, i)
                for smaller, i in itertools.product(beam, laws)
                if i not in smaller and self._compatible((*smaller, i))
            }
            level = self._solved([*larger.values()])
            kept += level
            beam = [s.which for s in level[:_WIDTH]]
        return sorted(kept, key=lambda s: -s.nats)

    def _solved(self, sets: Sequence[tuple[int, ...]]) -> list[_Sized]:
        """Return the best of some sets with their sizes, the best first.

        All are solved at once, beside no constant and beside each, whatever their signs: right
        signs cannot gain more. In this order the sizes of the right signs follow, each set beside
        the constant that is worth its cost, until none that is left can come near.
        """
        groups: dict[int, list[tuple[int, ...]]] = {}
        for which in sets:
            groups.setdefault(sum(len(self.rows[i]) for i in which), []).append(which)
        bounded: list[tuple[tuple[int, ...], Array]] = []
        for alike in groups.values():
            own = [[k for i in which for k in self.rows[i]] for which in alike]
            gains = [self._bounds(own, self.rows[i] if i is not None else []) for i in self.extra]
            bounded += zip(alike, np.array(gains).T, strict=True)
        bounded.sort(key=lambda pair: -np.max(pair[1]))
        found: list[_Sized] = []
        for which, bounds in bounded:
            level = sorted((s.nats for s in found), reverse=True)
            if len(found) >= _KEPT and np.max(bounds) < level[_WIDTH - 1]:
                break
            one = self._sized(which, bounds)
            found += [one] if one is not None else []
        return sorted(found, key=lambda s: -s.nats)

    def _bounds(self, own: Sequence[list[int]], also: list[int]) -> Array:
        """Return what sets of as many numbers each gain at most, beside others.

        Minus infinity where one that is alone in its effect pulls the wrong way: of right signs it
        would be zero, or another one (Karush, Kuhn and Tucker), and the set a smaller one.
        """
        rows = np.array([each + also for each in own])
        G = self.gram[rows[:, :, None], rows[:, None, :]]
        G = G + _TRACE * np.einsum("kii->k", G)[:, None, None] * np.eye(rows.shape[1])
        g = self.target[rows]
        c = np.linalg.solve(G, g[:, :, None])[:, :, 0]
        falls = np.einsum("ki,ki->k", g, c)
        gains = np.array([self._nats(fall, rows.shape[1]) for fall in falls.tolist()])
        wrong = np.any((self.signs[rows] * c < 0) & self.alone[rows], axis=1)
        return np.where(wrong, -np.inf, gains)

    def _sized(self, which: tuple[int, ...], bounds: Array) -> _Sized | None:
        """Return a set with its sizes, and with a constant if one is worth its cost.

        None if one of them pulls the wrong way or does nothing. `bounds` are the gains that the
        set can have beside each of the constants at most.
        """
        found: list[_Sized] = []
        for position in np.argsort(-bounds, kind="stable"):
            constant = self.extra[position]
            if constant is not None and set(which).intersection(self.constants):
                continue
            if bounds[position] == -np.inf:
                break
            if found and bounds[position] <= max(s.nats for s in found):
                break
            also = () if constant is None else (constant,)
            rows = [k for i in (*which, *also) for k in self.rows[i]]
            c = coefficients(self.gram[np.ix_(rows, rows)], self.target[rows], self.signs[rows])
            size = dict(zip(rows, c.tolist(), strict=True))
            if all(any(size[k] != 0 for k in self.rows[i]) for i in which):
                left = self.rest + c @ self.C[rows]  # no difference of large numbers
                nats = self._nats(self.total - float(left @ left), len(rows))
                found.append(_Sized((*which, *also), rows, c, nats))
        return max(found, key=lambda s: s.nats, default=None)

    def _nats(self, fall: float, numbers: int) -> float:
        left = max(self.total - fall, screening.LEAST_LEFT * self.total)
        return 0.5 * self.samples * np.log(self.total / left) - 0.5 * numbers * np.log(self.samples)

    def _effects(self, found: _Sized) -> tuple[Effect, ...]:
        """Return the effects of a set, what explains most first, constants last."""
        size = dict(zip(found.rows, found.sizes.tolist(), strict=True))

        def explains(i: int) -> tuple[bool, float]:
            return i in self.constants, -sum(self.target[k] * size[k] for k in self.rows[i])

        each = [
            (i, np.array([size[k] / self.unit[k] for k in self.rows[i]]))
            for i in sorted(found.which, key=explains)
        ]
        return tuple(screening.effect_from(self.entries[i], c) for i, c in each)

    def _place(self, i: int) -> Place:
        return self.entries[i].kind.kind, self.entries[i].at

    def _compatible(self, which: tuple[int, ...]) -> bool:
        """Return whether no two are of one family at one place."""
        for i, j in itertools.combinations(which, 2):
            a, b = self.entries[i], self.entries[j]
            if set(a.at) == set(b.at) and (
                a.kind.kind == b.kind.kind or screening.mutually_exclusive(a.kind, b.kind)
            ):
                return False
        return True


def problem_of_free_runs(
    stage: Fit, prepared: PreparedRecord, entries: Sequence[screening.CandidateColumns]
) -> SetProblem | None:
    """Return the problem about the model's own free runs over windows, None if these diverge."""
    spans = prepared.spans(prepared.trial, prepared.policy.growth)
    span = (spans[1:-1] or spans[-1:])[-1]
    windows = windows_from_stage(stage.model, prepared, prepared.trial, span, stage)
    settled = fit(residuals_of(stage.model, windows, prepared, stage.model), 3)
    if not (entries and np.isfinite(settled.cost)):
        return None
    residuals = residuals_of(settled.model, settled.pieces, prepared, settled.model)
    normal = normal_of(residuals, settled.errors, settled.sigma)
    force = float(np.mean(prepared.scales.force)) or 1.0
    signal = float(np.mean(np.std(prepared.record.Y, axis=0)))

    def column(task: tuple[screening.CandidateColumns, int]) -> Array:
        """Change of the errors for a unit of one coefficient."""
        entry, j = task
        size = float(np.sqrt(np.mean(entry.shape.columns[j] ** 2)))
        spread = float(np.std(entry.shape.columns[j]))
        varies = spread > _CONSTANT * size
        target = force if entry.rows is not None else spread if varies else signal
        if not size:
            return np.zeros(settled.errors.size)
        unit = np.zeros(entry.numbers)
        unit[j] = _TINY * target / size
        extended = settled.model.with_effect(entry.kind, entry.at, entry.shape.values(unit))
        run = prepared.runner(extended, residuals.runner).run(extended)
        pieces = prepared.with_propagated_memory(run, settled.pieces)
        change = (run.all_errors(pieces) - settled.errors) / settled.sigma / unit[j]
        known = np.nan_to_num(change.ravel(), nan=0.0, posinf=0.0, neginf=0.0)
        return known if np.max(np.abs(known)) < _DIVERGED else np.zeros(known.size)

    tasks = [(entry, j) for entry in entries for j in range(entry.numbers)]
    X = np.array(parallel_map(column, tasks)).reshape(len(tasks), -1).T
    e, noise = settled.errors / settled.sigma, prepared.scales.noise / settled.sigma
    return SetProblem(entries, X, normal.without_nuisance, e, noise)


def problem_along_motion(
    seen: screening.FilteredRecord, entries: Sequence[screening.CandidateColumns]
) -> SetProblem | None:
    """Return the problem about the linear model's run along the measured motion."""
    # a scale of a sensor makes the data smaller, and every error with them
    entries = [e for e in entries if e.kind.domain != "output" or e.kind.family == CONSTANT]
    X = seen.columns(entries).T
    if not (entries and np.isfinite(X).all()):
        return None

    def project(of: Array) -> Array:
        return of - seen.N.T @ (seen.factor @ (seen.N @ of))

    e = seen.e.reshape(seen.errors.shape)
    return SetProblem(entries, -X, project, e, seen.noise / seen.sigma)


def coefficients(gram: Array, target: Array, signs: Array) -> Array:
    """Return the coefficients of the required signs that take away most; 0 where a sign is wrong.

    What a friction has more at rest than in motion may pull the wrong way while there is no
    friction at all, or while its corners are too sharp; beside the other coefficients its kind may
    be the right one all the same.

    Parameters
    ----------
    gram : ndarray, shape (n, n)
    target : ndarray, shape (n,)
    signs : ndarray of int, shape (n,)
        +1, -1, or 0 for either.
    """
    size = np.sqrt(np.diag(gram))
    scaled = gram / np.outer(size, size)
    c = np.linalg.lstsq(scaled, target / size, rcond=1e-6)[0]
    if np.any(signs * c < 0):
        values, vectors = np.linalg.eigh(scaled)
        kept = values > 1e-6 * values[-1]
        root = np.sqrt(values[kept])[:, None] * vectors[:, kept].T
        bounds = [(0.0 if s > 0 else -np.inf, 0.0 if s < 0 else np.inf) for s in signs]
        right = (vectors[:, kept].T @ (target / size)) / np.sqrt(values[kept])
        c = lsq_linear(root, right, bounds=tuple(np.transpose(bounds)), method="bvls").x
    return c / size
