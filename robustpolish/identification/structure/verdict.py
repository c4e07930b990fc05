"""The verdict on what a search found."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.identification.diagnosis.findings import (
    Entry,
    FoundEffect,
    IndistinguishablePair,
    Ledger,
    Value,
    indistinguishable_pair,
)
from robustpolish.identification.diagnosis.result import Diagnosis
from robustpolish.identification.fit.least_squares import (
    EvaluatedFit,
    Fit,
    covariance_of,
    effective_samples,
    free_run_rms,
    free_run_rms_checked,
    homotopy,
    log_odds,
)
from robustpolish.identification.fit.parameters import has_smoothing
from robustpolish.identification.fit.result import stderr_from_covariance
from robustpolish.identification.observer.kalman import force_sites
from robustpolish.identification.policy import Policy
from robustpolish.identification.refit import with_reselected_holds
from robustpolish.identification.residual_tests import force_maps
from robustpolish.identification.structure.decays import split_decays
from robustpolish.identification.structure.moves_replace import (
    close_force_equivalents,
    fits_of_simpler_kinds,
    lower_error_kinds,
    makes_others_implausible,
    smoothing_is_determined,
    with_smoothing_velocity,
)
from robustpolish.identification.structure.score import (
    improves_fitted_pieces,
    log_error_ratio,
    undetermined_parameter,
)
from robustpolish.identification.structure.screening import screen
from robustpolish.identification.structure.spline_laws import (
    CURVES,
    KINDS,
    LEARNING,
    OVER_TIME,
    SINGLE_CURVE,
    LawKinds,
    Learned,
    better_shape,
    learn,
)
from robustpolish.identification.structure.state import Search
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.mechanical.data import effect_unit, unit_of
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import FORCE

# Final fit to the whole record, with backward elimination of effects.


class FinalFit(NamedTuple):
    """A model fitted to the whole record, and its free-run error there, shape (ny,).

    A model that is not `predictable`, whose long runs are not reproducible, is run in windows.
    """

    fit: Fit
    error: Array
    predictable: bool


def final_fit(search: Search) -> FinalFit:
    """Fit what a search found to the whole record, without what that leaves open.

    The steps and the confusions of the search follow.
    """
    final = _drop_undetermined(
        search, fit_whole_record(search, search.stage, free_runs_predictable(search))
    )
    final = _select_by_likelihood(search, final)
    gentle = _smooth_frictions(search, final)
    # what stood in for the turn has nothing left to do
    return final if gentle is final else _drop_undetermined(search, gentle)


def free_runs_predictable(search: Search) -> bool:
    """Return whether free runs over the whole record judge what was found; windows do otherwise."""
    stage, prepared = search.stage, search.prepared
    return (
        stage.reproducible and free_run_rms_checked(stage.model, prepared, prepared.everything)[1]
    )


def fit_whole_record(search: Search, stage: EvaluatedFit, predictable: bool) -> FinalFit:
    """Fit the model of a stage to the whole record, and judge it there."""
    prepared = search.prepared
    pieces = prepared.everything
    spans = prepared.spans(pieces, search.policy.growth)
    if not predictable:
        spans = [span for span in spans if span < prepared.short] + [prepared.short]
    before = whole_record_error(stage.model, search, predictable)
    if predictable and np.all(before < search.policy.lost * stage.error):
        spans = spans[-2:]  # what follows the whole record already is not lost on long windows
    last = search.policy.follows(prepared.record.Y.size)
    fits = homotopy(
        stage.model, prepared, pieces, search.reference, spans, prepared.steps,
        last=last, known=True,
    )  # fmt: skip
    if not fits:
        return FinalFit(stage.fit, before, predictable)
    error = whole_record_error(fits[-1].model, search, predictable)
    if np.mean(np.log(error)) > np.mean(np.log(before)):
        return FinalFit(stage.fit, before, predictable)
    return FinalFit(fits[-1], error, predictable)


def whole_record_error(model: MechanicalModel, search: Search, predictable: bool) -> Array:
    """Return the free-run error of each output over the whole record.

    A model whose long runs are not reproducible is run in windows.
    """
    prepared = search.prepared
    return free_run_rms(model, prepared, prepared.everything if predictable else prepared.windows)


def _drop_undetermined(search: Search, final: FinalFit) -> FinalFit:
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
        if len(effects) > first + 1 and undetermined_parameter(final.fit, at, policy):
            shorter = _accept_if_no_worse(search, search.fit_without(final.fit.model, at), final)
            if shorter is not None:
                final = shorter
                del search.steps[2 + at - first]
                search.reasons.append(f"{effect} was not kept: the others explain as much.")
                continue
        absurd = effect.definition.implausible(effect.values)
        if not absurd and not undetermined_parameter(final.fit, at, policy, every=True):
            continue
        for instead in fits_of_simpler_kinds(search, final.fit.model, at):
            shorter = _accept_if_no_worse(search, instead, final)
            if shorter is not None:
                final = shorter
                last = final.fit.model.effects[-1]
                del search.steps[2 + at - first]
                search.steps.append((last.kind, final.fit.model))
                alike = {each.kind: each for each in (*lower_error_kinds(search), effect)}
                search.indistinguishable_pairs += [
                    indistinguishable_pair(last, other) for other in alike.values()
                ]
                break
    return final


def _select_by_likelihood(search: Search, whole: FinalFit) -> FinalFit:
    """Return the final fit with the kinds of friction with memory that the whole record prefers.

    A part of the record may leave numbers of one kind more open than those of another, and held-out
    blocks judge kinds with such numbers. Where little more than noise is left, likelihood over all
    decides, each kind begun with the force that the one found makes. What comes near is told alike.
    """
    first, policy = len(search.reference.effects), search.policy
    final, error, predictable = whole
    over_all = predictable and len(final.errors) == search.prepared.record.samples
    found = [e for e in final.model.effects[first:] if e.definition.family]
    remembering = [(e.kind, e.at) for e in found if e.definition.has_memory]
    if not (over_all and remembering) or np.any(
        error > policy.shape_above * search.residual_noise_floor(final.model, predictable)
    ):
        return whole
    for place in remembering:
        here = [p for p in search.indistinguishable_pairs if (p.first.kind, p.first.at) == place]
        began = at = [(e.kind, e.at) for e in final.model.effects].index(place)
        others, passed = list(_replacement_kind_fits(search, final, at)), []
        while likelier := _more_likely_fits(others, final, policy):
            effect = final.model.effects[at]
            passed += [(effect, final), *((f.model.effects[-1], f) for f in others)]
            odds, final = max(likelier, key=lambda pair: pair[0])
            said = f"{effect} is less likely over the whole record, by log odds of {odds:.1f}."
            search.reasons.append(said)
            at = len(final.model.effects) - 1
            others = list(
                _replacement_kind_fits(search, final, at)
            )  # begun with the force of this one
        now = final.model.effects[at]
        if now.kind != place[0]:
            error = whole_record_error(final.model, search, predictable)
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
        search.indistinguishable_pairs[:] = [
            p for p in search.indistinguishable_pairs if p not in here
        ]
        search.indistinguishable_pairs += [indistinguishable_pair(now, other) for other in alike]
    return FinalFit(final, error, predictable)


def _more_likely_fits(others: Sequence[Fit], final: Fit, policy: Policy) -> list[tuple[float, Fit]]:
    """Return the fits that the whole record prefers, with their log odds.

    One with more numbers needs more evidence than they cost.
    """
    judged = [
        (log_odds(other, final) - _parameter_penalty(other, final), other) for other in others
    ]
    return [
        (odds, other)
        for odds, other in judged
        if odds > (policy.least_odds if len(other.free) > len(final.free) else 0.0)
    ]


def _replacement_kind_fits(search: Search, final: Fit, at: int) -> Iterator[Fit]:
    """Yield fits to the whole record with other kinds in place of an effect, at the end of all.

    Those whose numbers are physical, and determined. Friction that jumps comes rounded, too: what a
    jump leaves at every reversal is no evidence of memory.
    """
    effects, last = final.model.effects, len(final.model.effects) - 1
    for instead in close_force_equivalents(search, final.model, at):
        model = replace(final.model, effects=(*effects[:at], *effects[at + 1 :], instead))
        for fitted in _fit_long_windows(model, search, predictable=True):
            for tried in (fitted, *_smoothed_whole_fit(fitted, last, search, predictable=True)):
                other = tried.model.effects[-1]
                if not (
                    other.definition.implausible(other.values)
                    or undetermined_parameter(tried, last, search.policy)
                ):
                    yield tried


def _parameter_penalty(one: Fit, other: Fit) -> float:
    """Return the log odds that the numbers which one fit has more than another cost it."""
    return 0.5 * (len(one.free) - len(other.free)) * float(np.log(np.sum(effective_samples(other))))


def _fit_long_windows(model: MechanicalModel, search: Search, predictable: bool) -> list[Fit]:
    """Return a model fitted to the whole record from its numbers; none if that did not end well."""
    prepared = search.prepared
    pieces = prepared.everything if predictable else prepared.windows
    spans = prepared.spans(pieces)[-1:]
    last = search.policy.follows(prepared.record.Y.size)
    return homotopy(
        model, prepared, pieces, search.reference, spans, prepared.steps, last=last, known=True
    )


def _smooth_frictions(search: Search, final: FinalFit) -> FinalFit:
    """Return the final fit with those jumps of friction rounded that the data know to be none.

    What a jump leaves at every reversal may be less than the noise and yet move all other numbers
    by more than their standard errors. So likelihood decides, not a visible fall.
    """
    for at in range(len(search.reference.effects), len(final.fit.model.effects)):
        for fitted in _smoothed_whole_fit(final.fit, at, search, final.predictable):
            left = whole_record_error(fitted.model, search, final.predictable)
            odds = search.prepared.record.samples * float(np.sum(np.log(final.error / left)))
            if odds > search.policy.least_odds:
                final = FinalFit(fitted, left, final.predictable)
    return final


def _smoothed_whole_fit(jumping: Fit, at: int, search: Search, predictable: bool) -> list[Fit]:
    """Return a fit to the whole record with a jump of friction rounded.

    None where nothing jumps, or the data leave the speed of the turn open.
    """
    effects = jumping.model.effects
    if not effects[at].definition.turns_over or has_smoothing(effects[at]):
        return []
    gentle = with_smoothing_velocity(jumping.model, at, search)
    if gentle is None:
        return []
    model = replace(jumping.model, effects=(*effects[:at], gentle, *effects[at + 1 :]))
    return [
        fitted
        for fitted in _fit_long_windows(model, search, predictable)
        if smoothing_is_determined(fitted, at, search)
    ]


def _accept_if_no_worse(
    search: Search, instead: EvaluatedFit | None, final: FinalFit
) -> FinalFit | None:
    """Go on with a model, and return its final fit, if that leaves little more than another.

    No effect may have become absurd for that.
    """
    if instead is None:
        return None
    fitted = fit_whole_record(search, instead, final.predictable)
    little = np.log(1 + search.policy.together)
    if not np.mean(np.log(fitted.error / final.error)) < little:
        return None
    if makes_others_implausible(search, final.fit.model, fitted.fit.model):
        return None
    search.stage = instead
    return fitted


NO_EFFECT = "No effect of the catalogue makes the error fall visibly."


class Verdict(NamedTuple):
    """The verdict, its reasons, and the noise floor of each output in its unit."""

    word: str
    reasons: list[str]
    floor: Array


def verdict_on(search: Search, final: FinalFit, base: Array, refitted: Array) -> Verdict:
    """Choose the verdict.

    Parameters
    ----------
    search : Search
    final : FinalFit
    base, refitted : ndarray, shape (ny,)
        Errors of the model as it was, and refitted; of windows where `final` is not calm.
    """
    policy, error = search.policy, final.error
    size = np.std(search.prepared.record.Y, axis=0)
    floor = search.residual_noise_floor(final.fit.model, final.predictable)
    at_noise_floor, into = bool(np.all(error < policy.shape_above * floor)), []
    if not at_noise_floor and _noise_on_inputs(search) and np.all(error < policy.loudest * size):
        times = float(np.max(error / floor))
        into = [f"What is left is {times:.3g} times the noise of the sensors, "
                "and like a noise on the inputs."]  # fmt: skip
        at_noise_floor, floor = True, error
    if search.added_to(final.fit.model):
        share = _explained(refitted, error, floor)
        told = [*into, f"The effects explain {100 * share:.0f} % of the error above the noise."]
        times = float(np.max(error / floor))
        if times > policy.far:
            told.insert(0, f"What is left is {times:.3g} times the noise.")
        if at_noise_floor or share > policy.explained or not final.predictable:
            return Verdict("missing_effect", told if share > 0 else [], floor)
        told[-1] += f" {100 * (1 - share):.0f} % is left."
        return Verdict("partly_explained", told, floor)
    if not at_noise_floor:
        return Verdict("unexplained", [NO_EFFECT], floor)
    wrong = np.any(base > policy.improved * error)
    return Verdict("parameters" if wrong else "adequate", into, floor)


def residual_exceeds_noise(search: Search, final: FinalFit, verdict: Verdict) -> bool:
    """Return whether more than noise is left."""
    return bool(np.any(final.error > search.policy.shape_above * verdict.floor))


def misidentification_reason(
    search: Search, final: FinalFit, refitted: Array, verdict: Verdict
) -> str | None:
    """Say why the effects that were found are no names of what is missing.

    None if they are, or if there are none.
    """
    if not search.added_to(final.fit.model):
        return None
    if residual_exceeds_noise(search, final, verdict):
        shape = better_shape(final.fit.model, search.prepared)
        if shape is not None:
            return shape
    if verdict.word != "partly_explained":
        return None
    fall = float(np.max(1 - final.error / refitted))
    if fall < search.policy.visible_fall or _explained(refitted, final.error, verdict.floor) <= 0:
        return NO_EFFECT  # a fit to all may leave nothing of what helped on some blocks
    effects = range(len(search.reference.effects), len(final.fit.model.effects))
    if all(undetermined_parameter(final.fit, at, search.policy) for at in effects):
        # a size that stands for others is a finding where all is explained, and only there
        return "What helps has no size that the data determine."
    return None


def many_effects_at_one_place(search: Search, model: MechanicalModel) -> bool:
    """Return whether three effects or more were added at one place: one curve may be all that."""
    effects = search.added_to(model)
    added = [frozenset(e.at) for e in effects if e.definition.domain == "pair"]
    return any(added.count(at) > 2 for at in added)


def _noise_on_inputs(search: Search) -> bool:
    """Return whether the last screening saw noise on the inputs, and no missing force.

    It is none if anything that was tried in the end, though refused, leaves visibly less, be it of
    what it was fitted to: with thousands of samples for each number no fit bends itself to noise.
    Nor is it while so many effects share a place that one curve may be all of them, and more.
    """
    stage, policy = search.stage, search.policy
    if search.screening is None or many_effects_at_one_place(search, stage.model):
        return False
    tried = [
        item.fitted for turn in search.selection_steps if not turn.added for item in turn.tried
    ]
    visible = np.log(1 - policy.visible_fall)
    if any(
        log_error_ratio(f, stage) < visible or improves_fitted_pieces(stage, f, policy)
        for f in tried
    ):
        return False
    level = search.screening.level
    return level.force <= search.policy.silent and level.input_noise > 0


def _explained(before: Array, after: Array, noise: Array) -> float:
    """Return the share of the error's power above the noise that went away."""
    excess = float(np.sum((before**2 - noise**2) / noise**2))
    left = float(np.sum(np.maximum(after**2 - noise**2, 0) / noise**2))
    return 1 - left / excess if excess > 0 else 1.0


# A nonparametric (spline) law in place of the effects that a search found.


class NonparametricLaw(NamedTuple):
    """A law, and beside what it was learned.

    Attributes
    ----------
    search : Search
        Beside whose own numbers, and holds of the inputs, it was learned.
    learned : Learned
    """

    search: Search
    learned: Learned


def single_curve_law(search: Search) -> NonparametricLaw | None:
    """Return a curve that explains all of which the effects that were found leave visibly more.

    Each kind of the catalogue has been tried at its place by then, alone and beside others. What
    two or three of them are together, one curve over one signal hardly is, with dry friction or
    without, so nothing is gained by following what else came near them. A curve over time is asked
    for where more than noise of any colour is left. Of a decay names are not complete yet: its
    damping is settled later.
    """
    stage, more = search.stage, not search.residual_is_noise(search.policy.shape_above)
    if search.at_noise_floor(stage) or _is_free_decay(search) or not (search.added or more):
        return None
    search.say("one curve that explains all")
    floor = search.residual_noise_floor(stage.model, free_runs_predictable(search))
    for kinds in _law_kinds_to_try(search, SINGLE_CURVE, over_time=more):
        law = _best_law(search, floor, kinds)
        if law is None or not law.learned.explains:
            continue
        if log_error_ratio(law.learned.fitted, stage) < _significant_log_ratio(search):
            return law
    return None


def unknown_law(
    search: Search, names: FinalFit, verdict: Verdict, wrong: str | None
) -> NonparametricLaw | None:
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
    names : FinalFit
        The model with the effects that were found.
    verdict : Verdict
        On that.
    wrong : str, optional
        Why they are no names of what is missing.
    """
    if np.all(names.error <= LEARNING.rest * search.prepared.scales.noise):
        return None
    more = residual_exceeds_noise(search, names, verdict)
    hint = not more and search.added > 0 and _screening_finds_more(names.fit.model, search)
    if not more and not (search.added and (hint or not search.at_noise_floor(search.stage))):
        return None
    partly = verdict.word == "partly_explained"
    failed = more and (
        wrong is not None
        or not search.added
        or (partly and many_effects_at_one_place(search, names.fit.model))
    )
    search.say("a law that no catalogue holds")
    floor = search.residual_noise_floor(names.fit.model, names.predictable)
    curves = KINDS if failed else CURVES if more else SINGLE_CURVE
    best, far, told = None, -float(np.log(search.policy.far)), []
    for kinds in _law_kinds_to_try(search, curves, over_time=failed or partly or hint):
        law = _best_law(search, floor, kinds)
        if law is None:
            continue
        left = _law_log_error_ratio(law, names)
        if law.learned.explains and (failed or law_is_better(law, names)):
            return law
        if law.learned.explains and left < -LEARNING.better:
            told.append(
                f"A {law.learned.what}, learned, was not taken: it leaves {-np.expm1(left):.0%} "
                f"less than the effects that have names. Under {search.policy.visible_fall:.0%} "
                "they stay, unless more shows beside them and nothing beside the law."
            )
        if left < far and _is_single_curve(law):
            best, far = law, left
    if best is None:
        search.reasons += told
    return best


def _law_kinds_to_try(
    search: Search, curves: tuple[LawKinds, ...], over_time: bool
) -> list[tuple[LawKinds, ...]]:
    """Return what is tried, one after the other, until it explains.

    In a decay what depends on the amplitude changes with time too, and the record does not tell the
    two apart.
    """
    return [curves, OVER_TIME] if over_time and not _is_free_decay(search) else [curves]


def _is_free_decay(search: Search) -> bool:
    """Return whether the machine is left to itself while its motion dies, in all records."""
    return split_decays(search.reference, search.prepared.record) is not None


def law_error(law: NonparametricLaw, names: FinalFit) -> Array:
    """Return the free-run error of a law over the whole record, as it was taken of the names."""
    return whole_record_error(law.learned.model, law.search, names.predictable)


def law_is_better(law: NonparametricLaw, names: FinalFit) -> bool:
    """Return whether a law that explains leaves visibly less than names, or less and nothing shows.

    Nothing that the catalogue holds shows beside the law then, while something does beside names.
    """
    left = _law_log_error_ratio(law, names)
    if left >= -LEARNING.better:
        return False
    return left < _significant_log_ratio(law.search) or (
        not _screening_finds_more(law.learned.model, law.search)
        and _screening_finds_more(names.fit.model, law.search)
    )


def _law_log_error_ratio(law: NonparametricLaw, names: FinalFit) -> float:
    """Return the mean log of the errors that a law leaves over those that names leave."""
    return float(np.mean(np.log(law_error(law, names) / names.error)))


def _screening_finds_more(model: MechanicalModel, search: Search) -> bool:
    """Return whether any effect is worth a refit beside a model."""
    return screen(model, search.prepared).has_candidate(search.policy.least_odds)


def _is_single_curve(law: NonparametricLaw) -> bool:
    """Return whether a law is a curve over one signal, with nothing beside it."""
    added = law.search.added_to(law.learned.model)
    return len(added) == 1 and len(added[0].definition.over) == 1


def _best_law(search: Search, floor: Array, kinds: Sequence[LawKinds]) -> NonparametricLaw | None:
    """Return the law that explains most, beside the model's own numbers; None if none helps.

    Beside names that do not explain what is missing a hold of the inputs may have been believed, or
    refused, that is wrong beside a law that does.
    """
    found = _learned(search, floor, kinds)
    if found is None:
        return None
    law = NonparametricLaw(search, found)
    if search.begin is not None:
        held = with_reselected_holds(found.model, search.reference, search.prepared)
        if held is not None:
            beside = search.begin(held)
            other = _learned(beside, floor, kinds)
            if other is not None and log_error_ratio(other.fitted, found.fitted) < 0:
                law = NonparametricLaw(beside, other)
    return law


def _learned(search: Search, floor: Array, kinds: Sequence[LawKinds]) -> Learned | None:
    white = search.prepared.scales.noise
    scales = replace(search.prepared.scales, noise=floor)
    prepared = replace(search.prepared, scales=scales)
    return learn(search.linear.model, prepared, search.reference, kinds, white)


def _significant_log_ratio(search: Search) -> float:
    """Return the log of the share of all errors that a law leaves at most of what names leave."""
    return float(np.log(1 - search.policy.visible_fall))


# Conclusion of a diagnosis: final fit, verdict, result.

_NOT_ALL_TRIED = (
    "The search was ended by its limit of work before all was tried: "
    "other effects may explain the data better."
)
_DRY = ("coulomb_friction", "stribeck_friction")


def conclude(search: Search, model: MechanicalModel) -> Diagnosis:
    """Fit the final model to the whole record and choose the verdict.

    Parameters
    ----------
    search : Search
    model : MechanicalModel
        The model as the user gave it.
    """
    search.say("final fit")
    names = final_fit(search)
    before = _step_errors(search, names.predictable)
    base, refitted = before[0], [*before, names.error][1]
    if search.reference is not model:
        # how an input acts between its samples is no number of the model
        base = whole_record_error(search.reference, search, names.predictable)
    verdict = verdict_on(search, names, base, refitted)
    wrong = misidentification_reason(search, names, refitted, verdict)
    law = unknown_law(search, names, verdict, wrong)
    if law is not None:
        return _conclude_with_law(search, names, law, wrong)
    if wrong is not None:
        return _conclude_unexplained(search, names, before, wrong)
    return _diagnosis(search, names, before, verdict)


def conclude_with_single_curve(search: Search) -> Diagnosis | None:
    """Conclude with a curve that explains all of which the effects found leave visibly more.

    None if there is no such curve. The search stays as it is.
    """
    law = single_curve_law(search)
    if law is None:
        return None
    search.say("final fit")
    beside = search.copy()
    names = final_fit(beside)
    return _conclude_with_law(beside, names, law) if law_is_better(law, names) else None


def _step_errors(search: Search, predictable: bool) -> list[Array]:
    """Return the errors of every step but the last."""
    search.say("errors of every step")
    return [whole_record_error(model, search, predictable) for _, model in search.steps[:-1]]


def _conclude_with_law(
    search: Search, names: FinalFit, law: NonparametricLaw, wrong: str | None = None
) -> Diagnosis:
    """Conclude with a law in place of the effects that were found."""
    learned, error = law.learned, law_error(law, names)
    reasons = [*([wrong] if wrong else []), learned.evidence()]
    found = search.added_to(names.fit.model)
    if found:
        times = float(np.exp(np.mean(np.log(names.error / error))))
        named = " and ".join(map(str, found))
        reasons.append(f"Not kept, with {times:.3g} times the error: {named}.")
    last = law.learned.laws[0].effect.kind, learned.model
    # what was asked of names was asked in this search, what the law stands beside is of its own
    told = replace(
        search,
        reference=law.search.reference,
        linear=law.search.linear,
        stage=learned.fitted,
        steps=[*law.search.steps[:2], last],
        indistinguishable_pairs=[],
    )
    floor = told.residual_noise_floor(learned.model, names.predictable)
    verdict = Verdict("unknown_law", reasons, np.minimum(floor, error))
    final = FinalFit(learned.final, error, names.predictable)
    return _diagnosis(told, final, _step_errors(told, names.predictable), verdict)


def _conclude_unexplained(
    search: Search, names: FinalFit, before: list[Array], wrong: str
) -> Diagnosis:
    """Conclude with the model's own numbers; what was found is reported, not kept."""
    named = " and ".join(map(str, search.added_to(names.fit.model)))
    floor = search.residual_noise_floor(names.fit.model, names.predictable)
    own = fit_whole_record(search, search.linear, search.linear.reproducible)
    reasons = [wrong, f"The nearest of the catalogue, not kept: {named}."]
    verdict = Verdict("unexplained", reasons, np.minimum(floor, own.error))
    told = replace(search, stage=search.linear, steps=search.steps[:2], indistinguishable_pairs=[])
    return _diagnosis(told, own._replace(predictable=names.predictable), before[:1], verdict)


def _diagnosis(search: Search, final: FinalFit, before: list[Array], verdict: Verdict) -> Diagnosis:
    """Put the findings together; `before` are the errors of all steps but the last."""
    fit, errors = final.fit, [*before, final.error]
    model, record, reference = fit.model, search.prepared.record, search.reference
    size = np.std(record.Y, axis=0)

    def by_output(values: Array) -> dict[str, float]:
        return dict(zip(model.output_names, (values / size).tolist(), strict=True))

    steps = [*search.steps[:-1], (search.steps[-1][0], model)]  # the last one as fitted in the end
    entries = tuple(
        Entry(step, by_output(error), then)
        for (step, then), error in zip(steps, errors, strict=True)
    )
    left = search.prepared.motion(model, record)
    covariance = covariance_of(fit)
    deviations = stderr_from_covariance(covariance)
    numbers = model.parameters
    added = range(len(reference.effects), len(model.effects))
    limited = [_NOT_ALL_TRIED] if search.prepared.work.refused else []
    found = tuple(_found_effect(model, index, deviations) for index in added)
    return Diagnosis(
        verdict=verdict.word,
        model=model,
        effects=found,
        candidates=tuple(search.candidates),
        indistinguishable=(
            *search.indistinguishable_pairs,
            *_friction_asymmetries(reference, found),
        ),
        ledger=Ledger(entries, by_output(verdict.floor)),
        missing_force=left.force,
        maps=force_maps(model, left),
        sites=tuple(force_sites(reference)[1]),
        parameters={k: Value(numbers[k], e, unit_of(model, k)) for k, e in deviations.items()},
        covariance=covariance,
        reasons=(
            *search.reasons,
            *limited,
            *_undetermined_effects(fit, added, search),
            *verdict.reasons,
        ),
        reproducible=final.predictable,
        time=record.axis,
    )


def _undetermined_effects(final: Fit, added: Sequence[int], search: Search) -> list[str]:
    """Say of which effects the first number is not determined, though they are there."""
    leads = {i: undetermined_parameter(final, i, search.policy) for i in added}
    effects = final.model.effects
    return [
        f"{effects[i]} is there, but the data leave its {lead} open."
        for i, lead in leads.items()
        if lead
    ]


def _found_effect(model: MechanicalModel, index: int, errors: dict[str, float]) -> FoundEffect:
    effect = model.effects[index]
    parameters = {}
    for p in effect.definition.parameters:
        if not p.fitted and effect.values[p.name] == p.default:
            continue
        unit = effect_unit(model, effect, p.name)
        error = errors.get(f"effect[{index}].{p.name}", 0.0)
        parameters[p.name] = Value(effect.values[p.name], error, unit)
    return FoundEffect(effect.kind, effect.at, parameters, effect.own)


def _friction_asymmetries(
    model: MechanicalModel, found: Sequence[FoundEffect]
) -> list[IndistinguishablePair]:
    """Return the constants that friction of unlike size in the two directions would be.

    Only the friction in each direction plus or minus the constant shows while something slides.
    """
    pairs = []
    for constant in found:
        end = _loaded_coordinate(model, constant)
        for friction in found:
            if end is None or friction.kind not in _DRY or end not in friction.at:
                continue
            size = next(iter(constant.parameters.values())).value
            name = next(iter(constant.parameters))
            lopsided = Effect("coulomb_friction", friction.at, {"asymmetry": -size})
            here = Effect(constant.kind, constant.at, {name: size})
            pairs.append(indistinguishable_pair(here, lopsided))
    return pairs


def _loaded_coordinate(model: MechanicalModel, constant: FoundEffect) -> str | None:
    """Return the coordinate on which a constant force acts, or seems to act by an offset."""
    if constant.kind == "constant_force":
        return constant.at[0]
    if constant.kind == "sensor_offset":
        output = next(o for o in model.outputs if o.name == constant.at[0])
        return output.of[0] if output.quantity == FORCE else None
    return None
