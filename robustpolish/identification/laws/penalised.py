"""Penalised splines in the innovations of an observer: a missing force as a smooth curve.

The columns of B-splines along the smoothed motion go through the same filter as every candidate of
a screening. Their second differences are expected to be normal; how large they are is what makes
the innovations likeliest (restricted maximum likelihood, as for the variances of a mixed model:
Ruppert, Wand, Carroll 2003, Semiparametric Regression, chapter 4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import Array
from robustpolish.effects import Effect
from robustpolish.effects.learned import (
    Over,
    coefficients_of,
    learned_name,
    smoothness,
    spline_basis,
    spline_centres,
)
from robustpolish.identification.observer.missing_force import Smoothed
from robustpolish.identification.record import Record
from robustpolish.identification.screening.filtered import FilteredRecord
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import port_row

_STIFFER = np.geomspace(1e-9, 1e3, 37)
"""What is tried for the price of bending, in units in which data and bending weigh alike."""
DRY = "coulomb_friction"
_TURNS_OVER = 0.02
"""Share of the speed over which dry friction turns over, as screening has it."""
_HOLD = 1e-9
"""Share of the information that holds what neither data nor bending determines."""


@dataclass(frozen=True, eq=False)
class Block:
    """The splines of one law along a motion.

    Attributes
    ----------
    effect : Effect
        With its knots, and a coefficient of 0 for every spline.
    columns : ndarray, shape (coefficients, 1, samples)
        Force on the first coordinate for a unit of each coefficient.
    bending : ndarray, shape (rows, coefficients)
    """

    effect: Effect
    columns: Array
    bending: Array


@dataclass(frozen=True, eq=False)
class CurveFit:
    """Laws at one place, as the innovations of one level show them.

    Attributes
    ----------
    effects : tuple of Effect
    score : float
        The information criterion; every coefficient counts as far as the data determine it.
    freedom : float
        How many coefficients that are.
    fall : float
        Share by which the innovations fell.
    """

    effects: tuple[Effect, ...]
    score: float
    freedom: float
    fall: float

    @property
    def at(self) -> tuple[str, ...]:
        """The place."""
        return self.effects[0].at

    @property
    def laws(self) -> tuple[Effect, ...]:
        """Those that are curves."""
        return tuple(e for e in self.effects if e.kind != DRY)

    @property
    def others(self) -> tuple[Effect, ...]:
        """Dry friction beside them, if any."""
        return tuple(e for e in self.effects if e.kind == DRY)

    def within(self, other: CurveFit) -> bool:
        """Return whether the laws of another one at the same place are these, and more."""
        these, those = ({e.definition.over for e in each.effects} for each in (self, other))
        return self.at == other.at and these < those

    @property
    def sensible(self) -> bool:
        """Whether dry friction does not push."""
        return all(e.values["force"] > 0 for e in self.others)


def dry_block(model: MechanicalModel, at: tuple[str, ...], motion: Smoothed) -> Block | None:
    """Return dry friction at a place as a law with one coefficient, None if nothing moves there.

    Parameters
    ----------
    model : MechanicalModel
    at : tuple of str
    motion : Smoothed
    """
    v = port_row(model, at) @ motion.v
    width = _TURNS_OVER * float(np.percentile(np.abs(v), 95))
    if not (width > 0 and np.isfinite(width)):
        return None
    effect = Effect(DRY, at, {"force": 0.0, "width": width})
    return Block(effect, -np.tanh(v / width)[None, None], np.zeros((0, 1)))


def block(
    model: MechanicalModel,
    at: tuple[str, ...],
    over: Over,
    count: int,
    motion: Smoothed,
    record: Record,
) -> Block | None:
    """Return the splines of a law at a place, None if nothing moves there.

    Parameters
    ----------
    model : MechanicalModel
    at : tuple of str
    over : {"stiffness", "damping", "force", "varying_stiffness", "varying_damping"}
    count : int
        Of coefficients, in each direction.
    motion : Smoothed
    record : Record
        The part that moved so: what changes along the record does so over the whole of it.
    """
    row = port_row(model, at)
    q, v = row @ motion.q, row @ motion.v
    if not (np.ptp(q) > 0 and np.ptp(v) > 0 and np.isfinite(q + v).all()):
        return None
    varies = over in ("varying_stiffness", "varying_damping")
    x = record.time if varies else v if over == "damping" else q
    seen = record.times if varies else x
    knots = {"low": float(seen.min()), "high": float(seen.max())}
    basis = spline_basis(x, knots["low"], knots["high"], count, over not in ("stiffness", "force"))
    if over == "force":
        knots |= {"slow": float(v.min()), "fast": float(v.max())}
        across = spline_basis(v, knots["slow"], knots["fast"], count, True)
        basis = (basis[:, None] * across).reshape(count * count, -1)
    elif over == "varying_stiffness":
        basis = basis * q
    elif over == "varying_damping":
        basis = basis * v
    effect = Effect(learned_name(over, count), at, knots)
    bending = smoothness({**effect.values, "roughness": 1.0})
    return Block(effect, -basis[:, None, :], bending)


def fit_curves(f: FilteredRecord, row: Array, blocks: Sequence[Block]) -> CurveFit:
    """Fit laws at one place to the innovations of one level.

    Parameters
    ----------
    f : FilteredRecord
    row : ndarray, shape (coordinates,)
        Of the place.
    blocks : sequence of Block
    """
    columns = np.concatenate([b.columns for b in blocks])
    at = blocks[0].effect.at
    X = f.weighted(f.observer.respond(row[None], [at], columns))
    NX = f.N @ X.T
    A = X @ X.T - NX.T @ f.factor @ NX
    b = X @ f.e - NX.T @ f.factor @ f.Ne
    total = float(f.e @ f.e - f.Ne @ f.factor @ f.Ne)
    priced = _priced(A, b, total, len(f.e), [block.bending for block in blocks])
    V = np.linalg.inv(A + priced.price)
    c = V @ b
    freedom = float(np.trace(V @ A))
    rest = f.e - f.N.T @ (f.factor @ (f.Ne - NX @ c)) - X.T @ c
    rest = rest.reshape(f.errors.shape) * f.sigma
    before = f.residual(None)[0]
    scores = f.scores(rest, 0, f.policy.noise_orders)
    score = min(scores.values()) + freedom * np.log(len(rest))
    fall = 1 - float(np.min(np.std(rest, axis=0) / np.std(before, axis=0)))
    variance = float(np.mean((rest / f.sigma) ** 2))
    effects, first = [], 0
    for item, weight in zip(blocks, priced.weights, strict=True):
        last = first + item.bending.shape[1]
        law = with_numbers(item.effect, c[first:last])
        if len(item.bending):
            law = law.with_parameters(roughness=float(np.sqrt(variance / weight)))
        effects.append(law)
        first = last
    return CurveFit(tuple(effects), float(score), freedom, fall)


@dataclass(frozen=True, eq=False)
class _Priced:
    weights: tuple[float, ...]
    price: Array


def _priced(A: Array, b: Array, total: float, samples: int, bending: Sequence[Array]) -> _Priced:
    """Return the price of bending that makes the data likeliest, one weight for each law."""
    n = len(b)
    hold = _HOLD * float(np.trace(A)) / n * np.eye(n)
    grams, ranks, units, first = [], [], [], 0
    for rows in bending:
        here = slice(first, first + rows.shape[1])
        gram = np.zeros((n, n))
        gram[here, here] = rows.T @ rows
        grams.append(gram)
        ranks.append(int(np.linalg.matrix_rank(rows)) if rows.size else 0)
        units.append(float(np.trace(A[here, here]) / (np.trace(gram) or 1.0)))
        first += rows.shape[1]

    def price(weights: Sequence[float]) -> Array:
        return hold + sum(w * gram for w, gram in zip(weights, grams, strict=True))

    def unlikely(weights: Sequence[float]) -> float:
        V = A + price(weights)
        left = max(total - float(b @ np.linalg.solve(V, b)), 1e-300)
        known = sum(r * np.log(w) for r, w in zip(ranks, weights, strict=True))
        return samples * np.log(left) + float(np.linalg.slogdet(V)[1]) - known

    weights = [unit * _STIFFER[-1] for unit in units]  # straight lines to begin with
    for _ in range(3 if len(grams) > 1 else 1):
        for k, unit in ((k, unit) for k, unit in enumerate(units) if ranks[k]):
            tried = [[*weights[:k], unit * share, *weights[k + 1 :]] for share in _STIFFER]
            weights = min(tried, key=unlikely)
    return _Priced(tuple(weights), price(weights))


def with_numbers_of(
    effects: Sequence[Effect], model: MechanicalModel, reference: MechanicalModel
) -> tuple[MechanicalModel, tuple[Effect, ...]]:
    """Return a model whose springs and dampers at the place of laws are as they were, and the laws.

    What a fit has made of these numbers moves into the laws: the force stays the same, and the
    curves tell what the model as it was given lacks.

    Parameters
    ----------
    effects : sequence of Effect
        Learned laws at one place.
    model, reference : MechanicalModel
        Fitted, and before any fit.
    """
    known, changes, moved = reference.parameters, {}, []
    for effect in effects:
        contains, place = effect.definition.contains, set(effect.at)
        springs = {
            f"spring[{i}].stiffness": s.stiffness
            for i, s in enumerate(model.springs)
            if "spring" in contains and set(s.between) == place
        }
        dampers = {
            f"damper[{i}].damping": d.damping
            for i, d in enumerate(model.dampers)
            if "damper" in contains and set(d.between) == place
        }
        k, c = (sum(v - known.get(key, v) for key, v in m.items()) for m in (springs, dampers))
        changes |= {key: known[key] for key in (*springs, *dampers) if key in known}
        moved.append(_steeper(effect, k, c))
    return model.with_parameters(changes), tuple(moved)


def _steeper(effect: Effect, stiffness: float, damping: float) -> Effect:
    """Return a law with the force of a spring and of a damper added."""
    values, kind = effect.values, effect.definition
    ends = list(values.values())
    c = coefficients_of(values)
    if c.ndim == 2:
        along, across = (spline_centres(ends[n], ends[n + 1], len(c)) for n in (0, 2))
        added = c + stiffness * along[:, None] + damping * across
    else:
        slope = stiffness if "spring" in kind.contains else damping
        varies = kind.over == ("time",)
        added = c + slope * (1.0 if varies else spline_centres(ends[0], ends[1], len(c)))
    return with_numbers(effect, added.ravel())


def with_numbers(effect: Effect, c: Array) -> Effect:
    """Return a law with other fitted numbers."""
    names = [p.name for p in effect.definition.parameters if p.fitted]
    return effect.with_parameters(**dict(zip(names, c.tolist(), strict=True)))
