"""Learn the force that no catalogue holds: where it acts, what it depends on, and its curve.

At every place a curve over the displacement, one over the velocity, both, and a surface over the
two are fitted to the innovations (`penalised.py`), or a stiffness and a damping that vary with
time; the information criterion says which explains best what is left, beside the numbers of the
refitted model or beside those that were given. The best few go into the model as effects like any
other and are refitted by free runs that grow longer; the held-out error judges, as it judges every
named effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
import xarray as xr

from robustpolish.arrays import Array
from robustpolish.effects import LearnedLaw, lookup
from robustpolish.effects.learned import Over
from robustpolish.identification.findings.laws import laws_of
from robustpolish.identification.fit.homotopy import JudgedFit
from robustpolish.identification.fit.least_squares import Fit, covariance_of
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.laws.law_fit import (
    LEARNING,
    fitted_to_all,
    held_out,
    log_size,
    over_own_motion,
    with_closer_knots,
    with_laws,
)
from robustpolish.identification.laws.penalised import (
    DRY,
    Block,
    CurveFit,
    block,
    dry_block,
    fit_curves,
)
from robustpolish.identification.observer.missing_force import Smoothed
from robustpolish.identification.record import Record
from robustpolish.identification.residuals.noise_floor import floor_beside
from robustpolish.identification.screening.candidates import places
from robustpolish.identification.screening.filtered import FilteredRecord
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import port_row

LawKinds = tuple[Over | Literal["dry"], ...]

ONE_CURVE: tuple[LawKinds, ...] = (("stiffness",), ("damping",), ("stiffness", "dry"))
"""What is tried at every place first: one curve. Dry friction stands beside one over the
displacement because no smooth curve jumps as it does."""
CURVES: tuple[LawKinds, ...] = (*ONE_CURVE, ("stiffness", "damping"))
"""The same, and two curves."""
KINDS: tuple[LawKinds, ...] = (*CURVES, ("force",))
"""All of these, and a force over displacement and velocity at once, which can be anything."""
OVER_TIME: tuple[LawKinds, ...] = (("varying_stiffness",), ("varying_damping",))
"""What is tried where no law of the motion explains what is left."""


@dataclass(frozen=True, eq=False)
class Tried:
    """A law that was tried.

    Attributes
    ----------
    at : tuple of str
    over : str
        What the laws are curves over.
    odds : float
        Log odds against no law, from the innovations.
    fall : float
        Share by which the innovations fell.
    ratio : float
        Held-out error over the noise after the refit; infinite if there was none.
    helps : bool
        Whether that error fell.
    """

    at: tuple[str, ...]
    over: str
    odds: float
    fall: float
    ratio: float = np.inf
    helps: bool = False


@dataclass(frozen=True, eq=False)
class Learned:
    """What was learned.

    Attributes
    ----------
    fitted : JudgedFit
        The model with the laws, fitted to parts of the record and judged on the others.
    final : Fit
        The same, fitted to the whole of it.
    laws : tuple of LearnedLaw
        Those that were added, one or two at one place.
    covariance : xarray.DataArray
        Of the fitted numbers.
    before, after : ndarray, shape (ny,)
        Held-out errors over the noise, without and with the laws.
    tried : tuple of Tried
        What was added first, then the best.
    explains : bool
        Whether the held-out error is as good as the noise now. If not, what is missing is no such
        law, or not that alone: it may depend on time, on the past, or on more than one place.
    """

    fitted: JudgedFit
    final: Fit
    laws: tuple[LearnedLaw, ...]
    covariance: xr.DataArray
    before: Array
    after: Array
    tried: tuple[Tried, ...]
    explains: bool

    @property
    def model(self) -> MechanicalModel:
        """The model with the laws, fitted."""
        return self.final.model

    @property
    def what(self) -> str:
        """What they are, over what and where, as in "force over velocity at arm, ground"."""
        best = self.tried[0]
        return f"{self.laws[0].quantity} over {best.over} at {', '.join(best.at)}"

    def evidence(self) -> str:
        """Say in a sentence what the laws explain.

        Returns
        -------
        str
        """
        before, after = float(np.max(self.before)), float(np.max(self.after))
        told = (
            f"A {self.what} takes the held-out error from {before:.3g} to {after:.3g} times the "
            f"noise (log odds {self.tried[0].odds:.0f})"
        )
        if self.explains:
            return f"{told}: such a law explains what was left."
        return (
            f"{told}: it does not explain what is left, which may depend on time, on the past, "
            "or on more than this place."
        )


def learn(
    model: MechanicalModel,
    prepared: PreparedRecord,
    reference: MechanicalModel,
    kinds: Sequence[LawKinds] = KINDS,
    white: Array | None = None,
) -> Learned | None:
    """Learn the law that explains best what a model leaves, and add it to the model.

    Parameters
    ----------
    model : MechanicalModel
        Fitted, with the effects that were found.
    prepared : PreparedRecord
    reference : MechanicalModel
        The model before any fit: its springs and dampers stay where a law contains them, and laws
        are looked for beside its numbers, too. Without the law, a fit may have bent them far off.
    kinds : sequence of tuple, optional
        What is tried at every place: `KINDS`, `CURVES` or `OVER_TIME`.
    white : ndarray, shape (ny,), optional
        Noise of the sensors if it has no colour; if not given, the noise as prepared has none.

    Returns
    -------
    Learned or None
        None if no law makes the held-out error fall.
    """
    before = held_out(model, prepared)
    given = replace(reference, effects=model.effects)
    ranked = _ranked([model] if given == model else [model, given], prepared, kinds)
    least = max(LEARNING.odds, LEARNING.near * ranked[0].odds) if ranked else np.inf
    likely = [(i, law) for i, law in enumerate(ranked) if law.odds >= least]
    enough = prepared.policy.at_floor * prepared.scales.noise
    refits: dict[int, JudgedFit] = {}
    stood: int | None = None
    for i, law in likely:
        if len(refits) == LEARNING.refits:
            break
        # a law that is less likely than one that helps there is none beside it
        here = [fitted for j, fitted in refits.items() if ranked[j].curves.at == law.curves.at]
        if any(_helps(fitted.error, before) for fitted in here):
            continue
        fitted = with_laws(law.beside, law.curves, prepared, reference)
        if fitted is None:
            continue
        refits[i] = fitted
        if stood is None or _better(fitted, refits[stood]):
            stood = i
        if np.all(refits[stood].error < enough):
            break
    if stood is None or not _helps(refits[stood].error, before):
        return None
    for i, law in likely:  # a second law at a place has to earn it
        if law.curves.within(ranked[stood].curves) and i not in refits:
            fitted = with_laws(law.beside, law.curves, prepared, reference)
            if fitted is not None and not _better(refits[stood], fitted):
                refits[i], stood = fitted, i
                break
    best = over_own_motion(refits[stood], len(model.effects), prepared, reference)
    least_noise = prepared.scales.noise if white is None else white
    best = with_closer_knots(best, len(model.effects), prepared, reference, least_noise)
    final = fitted_to_all(best, prepared, reference)
    covariance = covariance_of(final)
    noise = floor_beside(final.model, prepared, best.reproducible)
    old = sum(bool(e.definition.over) for e in model.effects)
    told = [
        (i != stood, _told(law, refits.get(i), before, prepared)) for i, law in enumerate(ranked)
    ]
    told.sort(key=lambda item: (item[0], item[1].ratio, -item[1].odds))
    return Learned(
        best,
        final,
        laws_of(final.model, covariance)[old:],
        covariance,
        before / noise,
        best.error / noise,
        tuple(tried for _, tried in told),
        bool(np.all(best.error <= LEARNING.explains * noise)),
    )


def _better(one: JudgedFit, other: JudgedFit) -> bool:
    return log_size(one.error) < log_size(other.error) - LEARNING.better


def _told(law: _Likely, fitted: JudgedFit | None, before: Array, prepared: PreparedRecord) -> Tried:
    curves = law.curves
    over = " and ".join(
        name for e in curves.effects for name in e.definition.over or [e.definition.title]
    )
    ratio, helps = np.inf, False
    if fitted is not None:
        ratio = float(np.max(fitted.error / prepared.scales.noise))
        helps = _helps(fitted.error, before)
    return Tried(curves.at, over, law.odds, curves.fall, ratio, helps)


def _helps(error: Array, before: Array) -> bool:
    return log_size(error) <= log_size(before) + np.log(1 - LEARNING.fall)


class _Look(NamedTuple):
    """A model and what it makes of the record: its motion, and its innovations at some levels."""

    model: MechanicalModel
    motion: Smoothed
    seen: list[FilteredRecord]


class _Likely(NamedTuple):
    """Laws at a place, their log odds, and the model beside which they are likeliest."""

    odds: float
    curves: CurveFit
    beside: MechanicalModel


def _ranked(
    models: Sequence[MechanicalModel], prepared: PreparedRecord, tried: Sequence[LawKinds]
) -> list[_Likely]:
    """Return laws by their log odds, the best of each place and kind, the best first."""
    policy, record = prepared.policy, prepared.screened
    looks = []
    for model in models:
        motion = prepared.motion(model, record)
        seen = [FilteredRecord(model, prepared, record, n, motion) for n in policy.shape_levels]
        looks.append(_Look(model, motion, seen))
    null = min(
        min(f.null_scores(policy.noise_orders).values()) for look in looks for f in look.seen
    )
    rough = []
    for at in places(models[0], lookup("cubic_stiffness")):
        for kinds in tried:
            found = [(_best(look, at, kinds, LEARNING.first, record), look) for look in looks]
            known = [(fit, look) for fit, look in found if fit is not None]
            if known:
                fit, look = min(known, key=lambda item: item[0].score)
                rough.append((_Likely(float(null - fit.score) / 2, fit, look.model), look, kinds))
    rough.sort(key=lambda item: -item[0].odds)
    ranked = [law for law, _, _ in rough]
    for i, (law, look, kinds) in enumerate(rough[: LEARNING.refits]):
        for count in LEARNING.counts if kinds != ("force",) else ():
            if count * LEARNING.samples > record.samples:
                continue
            finer = _best(look, law.curves.at, kinds, count, record)
            if finer is None:
                continue
            odds = float(null - finer.score) / 2
            if odds > ranked[i].odds + LEARNING.simpler:
                ranked[i] = _Likely(odds, finer, law.beside)
    return sorted(ranked, key=lambda law: -law.odds)


def _best(
    look: _Look,
    at: tuple[str, ...],
    kinds: Sequence[Over | Literal["dry"]],
    count: int,
    record: Record,
) -> CurveFit | None:
    """Return laws at a place at the level where they are likeliest."""
    model, motion = look.model, look.motion
    here = {name for e in model.effects if set(e.at) == set(at) for name in e.definition.over}
    blocks: list[Block] = []
    if "dry" in kinds and any(e.kind == DRY and set(e.at) == set(at) for e in model.effects):
        return None
    for over in kinds:
        size = LEARNING.across[0] if over == "force" else count
        made = (
            dry_block(model, at, motion)
            if over == "dry"
            else block(model, at, over, size, motion, record)
        )
        if made is None or here & {*made.effect.definition.over}:
            return None
        blocks.append(made)
    row = port_row(model, at)
    found = [fit_curves(f, row, blocks) for f in look.seen]
    found = [f for f in found if np.isfinite(f.score) and f.sensible]
    return min(found, key=lambda f: f.score, default=None)
