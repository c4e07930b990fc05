"""What was found, looked at again beside what was found later.

An effect that was added early was chosen while the others were missing. It may have nothing left to
do beside them, or another kind of its family may do it better.
"""

from __future__ import annotations

from dataclasses import replace

from robustpolish.effects import CONSTANT
from robustpolish.identification.discover.hopeful import rivals_of
from robustpolish.identification.discover.judge import (
    judgement,
    objection,
    tolerance,
    visibly_less,
)
from robustpolish.identification.discover.search import RefittedEffect, Search
from robustpolish.identification.discover.turnover import rounded_friction
from robustpolish.identification.findings.confused import confused
from robustpolish.identification.fit.homotopy import JudgedFit


def without_the_needless(search: Search, last: bool = False) -> Search:
    """Return the search without effects that do not earn their place beside the others.

    Parameters
    ----------
    search : Search
    last : bool, optional
        Whether the last effect is asked too; it has just earned its place, unless it was added on
        trial.
    """
    first = len(search.reference.effects)
    for at in reversed(range(first, len(search.stage.model.effects) - (not last))):
        without = search.fitted_without(search.stage.model, at)
        if without is not None and _as_good(without, search):
            effect = search.stage.model.effects[at]
            search = search.copy()
            search.stage = without
            search.reasons.append(f"{effect} was not kept: the others explain as much.")
    return search


def renamed(search: Search) -> Search:
    """Return the search with the kinds of each family that are best beside all other effects.

    The rivals of the last effect have been tried beside all others when it was added.
    """
    first, count = len(search.reference.effects), len(search.stage.model.effects)
    for at in reversed(range(first, count - 1)):
        effect = search.stage.model.effects[at]
        kind = effect.definition
        if not kind.family or kind.family == CONSTANT:
            continue
        without = search.fitted_without(search.stage.model, at)
        rivals = [] if without is None else _rivals(search, without, at)
        ranked = sorted(rivals, key=lambda item: judgement(item.fitted, rivals))
        for item in ranked:
            apart = judgement(item.fitted, ranked) - judgement(search.stage, ranked)
            if apart < -tolerance(search) and not objection(
                search.linear, item.fitted, search.prepared
            ):
                search = search.copy()
                search.stage = item.fitted
                break
            if apart < tolerance(search):
                search.confusions.append(confused(effect, item.fitted.model.effects[-1]))
    return search


def _rivals(search: Search, without: JudgedFit, at: int) -> list[RefittedEffect]:
    """Refit the other kinds that free runs find nearly as good, beside all other effects."""
    prepared, screening = search.prepared, search.screening
    assert screening is not None  # effects have been added
    found = rivals_of(search.stage.model.effects[at], without.fit, prepared, screening)
    most = search.policy.near_error * (1 - max((c.fall for c in found), default=0.0))
    tried = []
    for candidate in found:
        if 1 - candidate.fall < most:
            search.say(f"refit with {candidate.effect} instead")
            fitted = search.fitted_with(without.model, candidate.effect)
            if fitted is not None:
                tried.append(RefittedEffect(candidate, fitted))
    return tried + rounded_friction(tried, without.model, search)


def retold(search: Search) -> Search:
    """Return the search with the steps that lead to the effects it has now, one after the other."""
    if search.steps[-1][1] is search.stage.model:
        return search
    effects = search.stage.model.effects[len(search.reference.effects) :]
    steps = search.steps[:2]
    for k in range(1, len(effects)):
        fitted = search.fitted_with(search.linear.model, *effects[:k])
        steps.append((effects[k - 1].kind, (fitted or search.stage).model))
    if effects:
        steps.append((effects[-1].kind, search.stage.model))
    places = {(e.kind, e.at) for e in effects}
    confusions = [c for c in search.confusions if (c.first.kind, c.first.at) in places]
    return replace(search, steps=steps, confusions=confusions)


def _as_good(without: JudgedFit, search: Search) -> bool:
    """Return whether a model leaves no output visibly more than that of the search."""
    return not visibly_less(without, search.stage, search.policy)
