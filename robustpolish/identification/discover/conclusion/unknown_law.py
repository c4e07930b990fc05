"""A law that no catalogue holds, in place of the effects that a search found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from robustpolish.arrays import Array
from robustpolish.identification.decays.cut import cut_decays
from robustpolish.identification.discover.conclusion.final_fit import Final, is_calm, whole_error
from robustpolish.identification.discover.conclusion.verdict import Verdict, crowded, more_is_left
from robustpolish.identification.discover.judge import more_left
from robustpolish.identification.discover.search import Search
from robustpolish.identification.laws.law_fit import LEARNING
from robustpolish.identification.laws.learn import (
    CURVES,
    KINDS,
    ONE_CURVE,
    OVER_TIME,
    LawKinds,
    Learned,
    learn,
)
from robustpolish.identification.numbers.own_numbers import with_other_holds
from robustpolish.identification.screening.screen import screen
from robustpolish.models.mechanical import MechanicalModel


class LawFound(NamedTuple):
    """A law, and beside what it was learned.

    Attributes
    ----------
    search : Search
        Beside whose own numbers, and holds of the inputs, it was learned.
    learned : Learned
    """

    search: Search
    learned: Learned


def one_curve(search: Search) -> LawFound | None:
    """Return a curve that explains all of which the effects that were found leave visibly more.

    Each kind of the catalogue has been tried at its place by then, alone and beside others. What
    two or three of them are together, one curve over one signal hardly is, with dry friction or
    without, so nothing is gained by following what else came near them. A curve over time is asked
    for where more than noise of any colour is left. Of a decay names are not complete yet: its
    damping is settled later.
    """
    stage, more = search.stage, not search.noise_alone(search.policy.shape_above)
    if search.at_floor(stage) or _is_decay(search) or not (search.added or more):
        return None
    search.say("one curve that explains all")
    floor = search.floor_beside(stage.model, is_calm(search))
    for kinds in _kinds(search, ONE_CURVE, over_time=more):
        law = _found(search, floor, kinds)
        if law is None or not law.learned.explains:
            continue
        if more_left(law.learned.fitted, stage) < _visibly(search):
            return law
    return None


def unknown_law(
    search: Search, names: Final, verdict: Verdict, wrong: str | None
) -> LawFound | None:
    """Return a law in place of all that was added, if it explains all or they are far from it.

    Whatever several named forces are, a surface is too, and much may look like a drift: a surface
    takes the place of names that failed, a drift that of names that explain a part. Curves do so of
    any names if they leave visibly less, and one alone where names leave what may be noise of some
    colour. One curve that does not explain all does so, too, if names leave several times as much;
    then something else is missing beside it. The reasons tell of a law that explains and leaves
    less, but not visibly.

    A law that leaves less, if not visibly, is taken where more shows beside the names while nothing
    does beside it: of a machine whose names are right, but not quite, as of a real drive's dry
    friction, no curve explains all, and more shows beside that, too.

    Nothing takes the place of names that leave white noise alone, for nothing leaves less.

    Parameters
    ----------
    search : Search
    names : Final
        The model with the effects that were found.
    verdict : Verdict
        On that.
    wrong : str, optional
        Why they are no names of what is missing.
    """
    if np.all(names.error <= LEARNING.rest * search.prepared.scales.noise):
        return None
    more = more_is_left(search, names, verdict)
    hint = not more and search.added > 0 and _more_shows(names.fit.model, search)
    if not more and not (search.added and (hint or not search.at_floor(search.stage))):
        return None
    partly = verdict.word == "partly_explained"
    failed = more and (
        wrong is not None or not search.added or (partly and crowded(search, names.fit.model))
    )
    search.say("a law that no catalogue holds")
    floor = search.floor_beside(names.fit.model, names.calm)
    curves = KINDS if failed else CURVES if more else ONE_CURVE
    best, far, told = None, -float(np.log(search.policy.far)), []
    for kinds in _kinds(search, curves, over_time=failed or partly or hint):
        law = _found(search, floor, kinds)
        if law is None:
            continue
        left = _over_names(law, names)
        if law.learned.explains and (failed or replaces(law, names)):
            return law
        if law.learned.explains and left < -LEARNING.better:
            told.append(
                f"A {law.learned.what}, learned, was not taken: it leaves {-np.expm1(left):.0%} "
                f"less than the effects that have names. Under {search.policy.visible_fall:.0%} "
                "they stay, unless more shows beside them and nothing beside the law."
            )
        if left < far and _is_one_curve(law):
            best, far = law, left
    if best is None:
        search.reasons += told
    return best


def _kinds(
    search: Search, curves: tuple[LawKinds, ...], over_time: bool
) -> list[tuple[LawKinds, ...]]:
    """Return what is tried, one after the other, until it explains.

    In a decay what depends on the amplitude changes with time too, and the record does not tell the
    two apart.
    """
    return [curves, OVER_TIME] if over_time and not _is_decay(search) else [curves]


def _is_decay(search: Search) -> bool:
    """Return whether the machine is left to itself while its motion dies, in all records."""
    return cut_decays(search.reference, search.prepared.record) is not None


def error_left(law: LawFound, names: Final) -> Array:
    """Return the free-run error of a law over the whole record, as it was taken of the names."""
    return whole_error(law.learned.model, law.search, names.calm)


def replaces(law: LawFound, names: Final) -> bool:
    """Return whether a law that explains leaves visibly less than names, or less and nothing shows.

    Nothing that the catalogue holds shows beside the law then, while something does beside names.
    """
    left = _over_names(law, names)
    if left >= -LEARNING.better:
        return False
    return left < _visibly(law.search) or (
        not _more_shows(law.learned.model, law.search) and _more_shows(names.fit.model, law.search)
    )


def _over_names(law: LawFound, names: Final) -> float:
    """Return the mean log of the errors that a law leaves over those that names leave."""
    return float(np.mean(np.log(error_left(law, names) / names.error)))


def _more_shows(model: MechanicalModel, search: Search) -> bool:
    """Return whether any effect is worth a refit beside a model."""
    return screen(model, search.prepared).shows(search.policy.least_odds)


def _is_one_curve(law: LawFound) -> bool:
    """Return whether a law is a curve over one signal, with nothing beside it."""
    added = law.search.added_to(law.learned.model)
    return len(added) == 1 and len(added[0].definition.over) == 1


def _found(search: Search, floor: Array, kinds: Sequence[LawKinds]) -> LawFound | None:
    """Return the law that explains most, beside the model's own numbers; None if none helps.

    Beside names that do not explain what is missing a hold of the inputs may have been believed, or
    refused, that is wrong beside a law that does.
    """
    found = _learned(search, floor, kinds)
    if found is None:
        return None
    law = LawFound(search, found)
    if search.begin is not None:
        held = with_other_holds(found.model, search.reference, search.prepared)
        if held is not None:
            beside = search.begin(held)
            other = _learned(beside, floor, kinds)
            if other is not None and more_left(other.fitted, found.fitted) < 0:
                law = LawFound(beside, other)
    return law


def _learned(search: Search, floor: Array, kinds: Sequence[LawKinds]) -> Learned | None:
    white = search.prepared.scales.noise
    scales = replace(search.prepared.scales, noise=floor)
    prepared = replace(search.prepared, scales=scales)
    return learn(search.linear.model, prepared, search.reference, kinds, white)


def _visibly(search: Search) -> float:
    """Return the log of the share of all errors that a law leaves at most of what names leave."""
    return float(np.log(1 - search.policy.visible_fall))
