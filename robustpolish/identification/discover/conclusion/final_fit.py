"""The final fit of what a search found: to the whole record, each effect asked for once more."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from robustpolish.arrays import Array
from robustpolish.identification.discover.judge import undetermined
from robustpolish.identification.discover.reconsider import (
    bends_others,
    closer_kinds,
    gently,
    knows_turn,
    nearly_the_same,
    simpler,
)
from robustpolish.identification.discover.search import Search
from robustpolish.identification.findings.confused import confused
from robustpolish.identification.fit.homotopy import JudgedFit, free_rms, homotopy, rms_over
from robustpolish.identification.fit.least_squares import Fit, independent, log_odds
from robustpolish.identification.fit.parameters import turns_over_gently
from robustpolish.identification.policy import Policy
from robustpolish.models.mechanical import MechanicalModel


class Final(NamedTuple):
    """A model fitted to the whole record, and its free-run error there, shape (ny,).

    A model that is not `calm`, whose long runs are not reproducible, is run in windows.
    """

    fit: Fit
    error: Array
    calm: bool


def final_fit(search: Search) -> Final:
    """Fit what a search found to the whole record, without what that leaves open.

    The steps and the confusions of the search follow.
    """
    final = _without_idle(search, fit_to_all(search, search.stage, is_calm(search)))
    final = _likeliest_kinds(search, final)
    gentle = _gently(search, final)
    # what stood in for the turn has nothing left to do
    return final if gentle is final else _without_idle(search, gentle)


def is_calm(search: Search) -> bool:
    """Return whether free runs over the whole record judge what was found; windows do otherwise."""
    stage, prepared = search.stage, search.prepared
    return stage.reproducible and free_rms(stage.model, prepared, prepared.everything)[1]


def fit_to_all(search: Search, stage: JudgedFit, calm: bool) -> Final:
    """Fit the model of a stage to the whole record, and judge it there."""
    prepared = search.prepared
    pieces = prepared.everything
    spans = prepared.spans(pieces, search.policy.growth)
    if not calm:
        spans = [span for span in spans if span < prepared.short] + [prepared.short]
    before = whole_error(stage.model, search, calm)
    if calm and np.all(before < search.policy.lost * stage.error):
        spans = spans[-2:]  # what follows the whole record already is not lost on long windows
    last = search.policy.follows(prepared.record.Y.size)
    fits = homotopy(
        stage.model, prepared, pieces, search.reference, spans, prepared.steps,
        last=last, known=True,
    )  # fmt: skip
    if not fits:
        return Final(stage.fit, before, calm)
    error = whole_error(fits[-1].model, search, calm)
    if np.mean(np.log(error)) > np.mean(np.log(before)):
        return Final(stage.fit, before, calm)
    return Final(fits[-1], error, calm)


def whole_error(model: MechanicalModel, search: Search, calm: bool) -> Array:
    """Return the free-run error of each output over the whole record.

    A model whose long runs are not reproducible is run in windows.
    """
    prepared = search.prepared
    return rms_over(model, prepared, prepared.everything if calm else prepared.windows)


def _without_idle(search: Search, final: Final) -> Final:
    """Return the final fit without effects or numbers that the whole record leaves open.

    An effect that was added early may have nothing left to do beside those that came after it, and
    of a family at one place a kind with fewer numbers may nearly do the same; so it is asked where
    numbers are open, or absurd on the whole record. What is told alike then need not be: the error
    may rise by more than chance, but not by what the record would have to show to add an effect.
    """
    first, policy = len(search.reference.effects), search.policy
    for at in reversed(range(first, len(final.fit.model.effects))):
        effects = final.fit.model.effects
        effect = effects[at]
        if len(effects) > first + 1 and undetermined(final.fit, at, policy):
            shorter = _no_worse(search, search.fitted_without(final.fit.model, at), final)
            if shorter is not None:
                final = shorter
                del search.steps[2 + at - first]
                search.reasons.append(f"{effect} was not kept: the others explain as much.")
                continue
        absurd = effect.definition.implausible(effect.values)
        if not absurd and not undetermined(final.fit, at, policy, every=True):
            continue
        for instead in simpler(search, final.fit.model, at):
            shorter = _no_worse(search, instead, final)
            if shorter is not None:
                final = shorter
                last = final.fit.model.effects[-1]
                del search.steps[2 + at - first]
                search.steps.append((last.kind, final.fit.model))
                alike = {each.kind: each for each in (*closer_kinds(search), effect)}
                search.confusions += [confused(last, other) for other in alike.values()]
                break
    return final


def _likeliest_kinds(search: Search, whole: Final) -> Final:
    """Return the final fit with the kinds of friction with memory that the whole record prefers.

    A part of the record may leave numbers of one kind more open than those of another, and held-out
    blocks judge kinds with such numbers. Where little more than noise is left, likelihood over all
    decides, each kind begun with the force that the one found makes. What comes near is told alike.
    """
    first, policy = len(search.reference.effects), search.policy
    final, error, calm = whole
    over_all = calm and len(final.errors) == search.prepared.record.samples
    found = [e for e in final.model.effects[first:] if e.definition.family]
    remembering = [(e.kind, e.at) for e in found if e.definition.has_memory]
    if not (over_all and remembering) or np.any(
        error > policy.shape_above * search.floor_beside(final.model, calm)
    ):
        return whole
    for place in remembering:
        here = [p for p in search.confusions if (p.first.kind, p.first.at) == place]
        began = at = [(e.kind, e.at) for e in final.model.effects].index(place)
        others, passed = list(_kinds_instead(search, final, at)), []
        while likelier := _likelier(others, final, policy):
            effect = final.model.effects[at]
            passed += [(effect, final), *((f.model.effects[-1], f) for f in others)]
            odds, final = max(likelier, key=lambda pair: pair[0])
            said = f"{effect} is less likely over the whole record, by log odds of {odds:.1f}."
            search.reasons.append(said)
            at = len(final.model.effects) - 1
            others = list(_kinds_instead(search, final, at))  # begun with the force of this one
        now = final.model.effects[at]
        if now.kind != place[0]:
            error = whole_error(final.model, search, calm)
            del search.steps[2 + began - first]
            search.steps.append((now.kind, final.model))
        # begun with the force of this one, a kind may end farther from it than it came before
        tried = [(effect, fitted) for effect, fitted in passed if effect.kind != now.kind]
        tried += [(fitted.model.effects[-1], fitted) for fitted in others]
        # numbers that do nothing cost nothing here: they do not tell two kinds apart
        odds_of = [(effect, log_odds(fitted, final)) for effect, fitted in tried]
        judged = {now.kind, *(e.kind for e, _ in odds_of)}
        near = {e.kind: e for e, odds in odds_of if odds > -policy.strong_odds}
        alike = list(near.values())
        alike += [p.second for p in here if p.second.at != now.at or p.second.kind not in judged]
        search.confusions[:] = [p for p in search.confusions if p not in here]
        search.confusions += [confused(now, other) for other in alike]
    return Final(final, error, calm)


def _likelier(others: Sequence[Fit], final: Fit, policy: Policy) -> list[tuple[float, Fit]]:
    """Return the fits that the whole record prefers, with their log odds.

    One with more numbers needs more evidence than they cost.
    """
    judged = [(log_odds(other, final) - _cost(other, final), other) for other in others]
    return [
        (odds, other)
        for odds, other in judged
        if odds > (policy.least_odds if len(other.free) > len(final.free) else 0.0)
    ]


def _kinds_instead(search: Search, final: Fit, at: int) -> Iterator[Fit]:
    """Yield fits to the whole record with other kinds in place of an effect, at the end of all.

    Those whose numbers are physical, and determined. Friction that jumps comes rounded, too: what a
    jump leaves at every reversal is no evidence of memory.
    """
    effects, last = final.model.effects, len(final.model.effects) - 1
    for instead in nearly_the_same(search, final.model, at):
        model = replace(final.model, effects=(*effects[:at], *effects[at + 1 :], instead))
        for fitted in _over_all(model, search, calm=True):
            for tried in (fitted, *_rounded(fitted, last, search, calm=True)):
                other = tried.model.effects[-1]
                if not (
                    other.definition.implausible(other.values)
                    or undetermined(tried, last, search.policy)
                ):
                    yield tried


def _cost(one: Fit, other: Fit) -> float:
    """Return the log odds that the numbers which one fit has more than another cost it."""
    return 0.5 * (len(one.free) - len(other.free)) * float(np.log(np.sum(independent(other))))


def _over_all(model: MechanicalModel, search: Search, calm: bool) -> list[Fit]:
    """Return a model fitted to the whole record from its numbers; none if that did not end well."""
    prepared = search.prepared
    pieces = prepared.everything if calm else prepared.windows
    spans = prepared.spans(pieces)[-1:]
    last = search.policy.follows(prepared.record.Y.size)
    return homotopy(
        model, prepared, pieces, search.reference, spans, prepared.steps, last=last, known=True
    )


def _gently(search: Search, final: Final) -> Final:
    """Return the final fit with those jumps of friction rounded that the data know to be none.

    What a jump leaves at every reversal may be less than the noise and yet move all other numbers
    by more than their standard errors. So likelihood decides, not a visible fall.
    """
    for at in range(len(search.reference.effects), len(final.fit.model.effects)):
        for fitted in _rounded(final.fit, at, search, final.calm):
            left = whole_error(fitted.model, search, final.calm)
            odds = search.prepared.record.samples * float(np.sum(np.log(final.error / left)))
            if odds > search.policy.least_odds:
                final = Final(fitted, left, final.calm)
    return final


def _rounded(jumping: Fit, at: int, search: Search, calm: bool) -> list[Fit]:
    """Return a fit to the whole record with a jump of friction rounded.

    None where nothing jumps, or the data leave the speed of the turn open.
    """
    effects = jumping.model.effects
    if not effects[at].definition.turns_over or turns_over_gently(effects[at]):
        return []
    gentle = gently(jumping.model, at, search)
    if gentle is None:
        return []
    model = replace(jumping.model, effects=(*effects[:at], gentle, *effects[at + 1 :]))
    return [fitted for fitted in _over_all(model, search, calm) if knows_turn(fitted, at, search)]


def _no_worse(search: Search, instead: JudgedFit | None, final: Final) -> Final | None:
    """Go on with a model, and return its final fit, if that leaves little more than another.

    No effect may have become absurd for that.
    """
    if instead is None:
        return None
    fitted = fit_to_all(search, instead, final.calm)
    little = np.log(1 + search.policy.together)
    if not np.mean(np.log(fitted.error / final.error)) < little:
        return None
    if bends_others(search, final.fit.model, fitted.fit.model):
        return None
    search.stage = instead
    return fitted
