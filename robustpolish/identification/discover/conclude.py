"""The end of a diagnosis: final fit, verdict, result."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from robustpolish.arrays import Array
from robustpolish.effects import Effect
from robustpolish.identification.discover.judge import (
    falls_where_fitted,
    more_left,
    undetermined,
)
from robustpolish.identification.discover.reconsider import (
    closer_kinds,
    gently,
    knows_turn,
    nearly_the_same,
    simpler,
)
from robustpolish.identification.discover.search import Search
from robustpolish.identification.findings.confused import confused
from robustpolish.identification.findings.diagnosis import Diagnosis
from robustpolish.identification.findings.findings import Confusion, FoundEffect, Value
from robustpolish.identification.findings.ledger import Entry, Ledger
from robustpolish.identification.fit.homotopy import JudgedFit, free_rms, homotopy, rms_over
from robustpolish.identification.fit.least_squares import (
    Fit,
    covariance_of,
    errors_from,
    independent,
    log_odds,
)
from robustpolish.identification.fit.parameters import (
    turns_over_gently,
)
from robustpolish.identification.laws.free_shape import better_shape
from robustpolish.identification.laws.learn import (
    CURVES,
    KINDS,
    OVER_TIME,
    LawKinds,
    Learned,
    learn,
)
from robustpolish.identification.observer.kalman import force_sites
from robustpolish.identification.policy import Policy
from robustpolish.identification.residuals.force_maps import force_maps
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.data import effect_unit, unit_of
from robustpolish.models.mechanical.parts import FORCE

_DRY = ("coulomb_friction", "stribeck_friction")


class Verdict(NamedTuple):
    """The verdict, its reasons, and the noise floor of each output in its unit."""

    word: str
    reasons: list[str]
    floor: Array


def conclude(search: Search, model: MechanicalModel) -> Diagnosis:
    """Fit the final model to the whole record and choose the verdict.

    Parameters
    ----------
    search : Search
    model : MechanicalModel
        The model as the user gave it.
    """
    prepared, reference = search.prepared, search.reference
    search.say("final fit")
    best = search.stage
    calm = best.reproducible and free_rms(best.model, prepared, prepared.everything)[1]
    final, error = _final_fit(search, best, calm)
    final, error = _without_idle(search, final, error, calm)
    final, error = _likeliest_kinds(search, final, error, calm)
    jumping = final
    final, error = _gently(search, final, error, calm)
    if final is not jumping:  # what stood in for the turn has nothing left to do
        final, error = _without_idle(search, final, error, calm)
    added = len(final.model.effects) > len(reference.effects)
    search.say("errors of every step")
    errors = [_whole_error(m, search, calm) for _, m in search.steps[:-1]] + [error]
    base, refitted = errors[0], errors[min(1, len(errors) - 1)]
    # how an input acts between its samples is no number of the model
    as_it_was = _whole_error(reference, search, calm) if reference is not model else base
    floor = search.floor_beside(final.model, calm)
    verdict = _verdict(search, calm, as_it_was, refitted, error, added, floor)
    above = np.any(error > search.policy.shape_above * verdict.floor)
    wrong_name = better_shape(final.model, prepared) if added and above else None
    if added and verdict.word == "partly_explained":
        fall = float(np.max(1 - error / refitted))
        if fall < search.policy.visible_fall or _explained(refitted, error, verdict.floor) <= 0:
            # a fit to the whole record may leave nothing of what helped on some blocks
            wrong_name = wrong_name or "No effect of the catalogue makes the error fall visibly."
        effects = range(len(reference.effects), len(final.model.effects))
        if all(undetermined(final, at, search.policy) for at in effects):
            # a size that stands for others is a finding where all is explained, and only there
            wrong_name = wrong_name or "What helps has no size that the data determine."
    if above:
        partly = verdict.word == "partly_explained"
        crowded = _crowded(final.model, len(reference.effects))
        failed = wrong_name is not None or not added or (partly and crowded)
        tried = [KINDS if failed else CURVES]
        if (failed or partly) and not search.prepared.fades:
            tried.append(OVER_TIME)
        found = _unknown_law(search, floor, tried, None if failed else error, calm)
        if found is not None:
            learned, error = found
            final = learned.final
            errors = [base, refitted, error]
            reasons = [*([wrong_name] if wrong_name else []), learned.evidence()]
            floor = search.floor_beside(learned.model, calm)
            verdict = Verdict("unknown_law", reasons, np.minimum(floor, error))
        elif wrong_name:
            # what is wrong is reported as a candidate, not kept in the model
            named = ", ".join(e.kind for e in final.model.effects[len(reference.effects) :])
            reasons = [wrong_name, f"The nearest of the catalogue, not kept: {named}."]
            _back_to_own_numbers(search)
            final, error = _final_fit(search, search.linear, search.linear.reproducible)
            errors = [base, error]
            verdict = Verdict("unexplained", reasons, np.minimum(floor, error))
    return _diagnosis(search, final, errors, verdict, calm)


def _without_idle(search: Search, final: Fit, error: Array, calm: bool) -> tuple[Fit, Array]:
    """Return the final fit without effects or numbers that the whole record leaves open.

    An effect that was added early may have nothing left to do beside those that came after it, and
    of a family at one place a kind with fewer numbers may nearly do the same; so it is asked where
    numbers are open, or absurd on the whole record. What is told alike then need not be: the error
    may rise by more than chance, but not by what the record would have to show to add an effect.
    """
    first, policy = len(search.reference.effects), search.policy
    for at in reversed(range(first, len(final.model.effects))):
        effect = final.model.effects[at]
        if len(final.model.effects) > first + 1 and undetermined(final, at, policy):
            without = search.fitted_without(final.model, at)
            shorter = _no_worse(search, without, error, calm, np.log(1 + policy.together))
            if shorter is not None:
                final, error = shorter
                del search.steps[2 + at - first]
                search.reasons.append(f"{effect} was not kept: the others explain as much.")
                continue
        absurd = effect.definition.implausible(final.model.effects[at].values)
        if not absurd and not undetermined(final, at, policy, every=True):
            continue
        for instead in simpler(search, final.model, at):
            shorter = _no_worse(search, instead, error, calm, np.log(1 + policy.together))
            if shorter is not None:
                final, error = shorter
                last = final.model.effects[-1]
                del search.steps[2 + at - first]
                search.steps.append((last.kind, final.model))
                alike = {each.kind: each for each in (*closer_kinds(search), effect)}
                search.confusions += [confused(last, other) for other in alike.values()]
                break
    return final, error


def _likeliest_kinds(search: Search, final: Fit, error: Array, calm: bool) -> tuple[Fit, Array]:
    """Return the final fit with the kinds of friction with memory that the whole record prefers.

    A part of the record may leave numbers of one kind more open than those of another, and held-out
    blocks judge kinds with such numbers. Where little more than noise is left, likelihood over all
    decides, each kind begun with the force that the one found makes. What comes near is told alike.
    """
    first, policy = len(search.reference.effects), search.policy
    over_all = calm and len(final.errors) == search.prepared.record.samples
    found = [e for e in final.model.effects[first:] if e.definition.family]
    remembering = [(e.kind, e.at) for e in found if e.definition.has_memory]
    if not (over_all and remembering) or np.any(
        error > policy.shape_above * search.floor_beside(final.model, calm)
    ):
        return final, error
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
            error = _whole_error(final.model, search, calm)
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
    return final, error


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


def _gently(search: Search, final: Fit, error: Array, calm: bool) -> tuple[Fit, Array]:
    """Return the final fit with those jumps of friction rounded that the data know to be none.

    What a jump leaves at every reversal may be less than the noise and yet move all other numbers
    by more than their standard errors. So likelihood decides, not a visible fall.
    """
    for at in range(len(search.reference.effects), len(final.model.effects)):
        for fitted in _rounded(final, at, search, calm):
            left = _whole_error(fitted.model, search, calm)
            odds = search.prepared.record.samples * float(np.sum(np.log(error / left)))
            if odds > search.policy.least_odds:
                final, error = fitted, left
    return final, error


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


def _no_worse(
    search: Search, instead: JudgedFit | None, error: Array, calm: bool, most: float
) -> tuple[Fit, Array] | None:
    """Go on with a model if its final fit leaves at most so much more; return that and its error.

    `most` is a difference of the mean log of errors.
    """
    if instead is None:
        return None
    fitted, left = _final_fit(search, instead, calm)
    if not np.mean(np.log(left / error)) < most:
        return None
    search.stage = instead
    return fitted, left


def _crowded(model: MechanicalModel, first: int) -> bool:
    """Return whether three effects or more were added at one place: one curve may be all that."""
    added = [frozenset(e.at) for e in model.effects[first:] if e.definition.domain == "pair"]
    return any(added.count(at) > 2 for at in added)


def _back_to_own_numbers(search: Search) -> None:
    """Forget what was added."""
    search.stage = search.linear
    del search.steps[2:]
    search.confusions.clear()


def _unknown_law(
    search: Search,
    floor: Array,
    tried: Sequence[Sequence[LawKinds]],
    names: Array | None,
    calm: bool,
) -> tuple[Learned, Array] | None:
    """Return a law that no catalogue holds, in place of all that was added, if it explains all.

    Its errors come with it. Whatever several named forces are, a surface is too, and much may look
    like a drift: a surface takes the place of names that failed, a drift that of names that explain
    a part. A curve does so of any names, whose errors are given, if it leaves visibly less. In a
    motion that fades, what depends on its amplitude changes with time too, and the record does not
    tell the two apart.
    """
    search.say("a law that no catalogue holds")
    scales = replace(search.prepared.scales, noise=floor)
    prepared = replace(search.prepared, scales=scales)
    visible = np.log(1 - search.policy.visible_fall)
    for kinds in tried:
        learned = learn(search.linear.model, prepared, search.reference, kinds)
        if learned is None or not learned.explains:
            continue
        left = _whole_error(learned.model, search, calm)
        if names is None or np.mean(np.log(left / names)) < visible:
            _back_to_own_numbers(search)
            search.stage = learned.fitted
            search.steps.append((learned.laws[0].effect.kind, learned.model))
            return learned, left
    return None


def _diagnosis(
    search: Search, final: Fit, errors: list[Array], verdict: Verdict, calm: bool
) -> Diagnosis:
    """Put the findings together; `errors` are those of the steps."""
    model, record, reference = final.model, search.prepared.record, search.reference
    size = np.std(record.Y, axis=0)

    def by_output(values: Array) -> dict[str, float]:
        return dict(zip(model.output_names, (values / size).tolist(), strict=True))

    steps = [*search.steps[:-1], (search.steps[-1][0], model)]  # the last one as fitted in the end
    entries = tuple(
        Entry(step, by_output(error), then)
        for (step, then), error in zip(steps, errors, strict=True)
    )
    left = search.prepared.motion(model, record)
    covariance = covariance_of(final)
    deviations = errors_from(covariance)
    numbers = model.parameters
    added = range(len(reference.effects), len(model.effects))
    found = tuple(_found(model, index, deviations) for index in added)
    return Diagnosis(
        verdict=verdict.word,
        model=model,
        effects=found,
        candidates=tuple(search.candidates),
        indistinguishable=(*search.confusions, *_asymmetries(reference, found)),
        ledger=Ledger(entries, by_output(verdict.floor)),
        missing_force=left.force,
        maps=force_maps(model, left),
        sites=tuple(force_sites(reference)[1]),
        parameters={k: Value(numbers[k], e, unit_of(model, k)) for k, e in deviations.items()},
        covariance=covariance,
        reasons=(*search.reasons, *_left_open(final, added, search), *verdict.reasons),
        reproducible=calm,
        time=record.axis,
    )


def _left_open(final: Fit, added: Sequence[int], search: Search) -> list[str]:
    """Say of which effects the first number is not determined, though they are there."""
    leads = {i: undetermined(final, i, search.policy) for i in added}
    effects = final.model.effects
    return [
        f"{effects[i]} is there, but the data leave its {lead} open."
        for i, lead in leads.items()
        if lead
    ]


def _whole_error(model: MechanicalModel, search: Search, calm: bool) -> Array:
    """Return the free-run error of each output over the whole record.

    A model whose long runs are not reproducible is run in windows.
    """
    prepared = search.prepared
    return rms_over(model, prepared, prepared.everything if calm else prepared.windows)


def _final_fit(search: Search, stage: JudgedFit, calm: bool) -> tuple[Fit, Array]:
    """Fit a stage's model to the whole record; return the fit and its free-run error."""
    prepared = search.prepared
    pieces = prepared.everything
    spans = prepared.spans(pieces, search.policy.growth)
    if not calm:
        spans = [span for span in spans if span < prepared.short] + [prepared.short]
    before = _whole_error(stage.model, search, calm)
    if calm and np.all(before < search.policy.lost * stage.error):
        spans = spans[-2:]  # what follows the whole record already is not lost on long windows
    last = search.policy.follows(prepared.record.Y.size)
    fits = homotopy(
        stage.model, prepared, pieces, search.reference, spans, prepared.steps,
        last=last, known=True,
    )  # fmt: skip
    if not fits:
        return stage.fit, before
    error = _whole_error(fits[-1].model, search, calm)
    if np.mean(np.log(error)) > np.mean(np.log(before)):
        return stage.fit, before
    return fits[-1], error


def _verdict(
    search: Search,
    calm: bool,
    base: Array,
    refitted: Array,
    error: Array,
    added: bool,
    floor: Array,
) -> Verdict:
    """Choose the verdict.

    Parameters
    ----------
    search : Search
    calm : bool
        Whether free runs over the whole record judge; otherwise the errors are of windows.
    base, refitted, error : ndarray, shape (ny,)
        Free-run errors of the model as it was, refitted, and in the end.
    added : bool
        Whether effects were added.
    floor : ndarray, shape (ny,)
        Noise of the sensors.
    """
    policy = search.policy
    size = np.std(search.prepared.record.Y, axis=0)
    at_floor, into = bool(np.all(error < policy.shape_above * floor)), []
    if not at_floor and _noise_on_inputs(search) and np.all(error < policy.loudest * size):
        times = float(np.max(error / floor))
        into = [f"What is left is {times:.3g} times the noise of the sensors, "
                "and like a noise on the inputs."]  # fmt: skip
        at_floor, floor = True, error
    if added:
        share = _explained(refitted, error, floor)
        told = [*into, f"The effects explain {100 * share:.0f} % of the error above the noise."]
        times = float(np.max(error / floor))
        if times > policy.far:
            told.insert(0, f"What is left is {times:.3g} times the noise.")
        if at_floor or share > policy.explained or not calm:
            return Verdict("missing_effect", told if share > 0 else [], floor)
        told[-1] += f" {100 * (1 - share):.0f} % is left."
        return Verdict("partly_explained", told, floor)
    if not at_floor:
        why = "No effect of the catalogue makes the error fall visibly."
        return Verdict("unexplained", [why], floor)
    wrong = np.any(base > policy.improved * error)
    return Verdict("parameters" if wrong else "adequate", into, floor)


def _noise_on_inputs(search: Search) -> bool:
    """Return whether the last screening saw noise on the inputs, and no missing force.

    It is none if anything that was tried in the end, though refused, leaves visibly less, be it of
    what it was fitted to: with thousands of samples for each number no fit bends itself to noise.
    Nor is it while so many effects share a place that one curve may be all of them, and more.
    """
    stage, policy = search.stage, search.policy
    if search.screening is None or _crowded(stage.model, len(search.reference.effects)):
        return False
    tried = [item.fitted for turn in search.turns if not turn.added for item in turn.tried]
    visible = np.log(1 - policy.visible_fall)
    if any(more_left(f, stage) < visible or falls_where_fitted(stage, f, policy) for f in tried):
        return False
    level = search.screening.level
    return level.force <= search.policy.silent and level.input_noise > 0


def _explained(before: Array, after: Array, noise: Array) -> float:
    """Return the share of the error's power above the noise that went away."""
    excess = float(np.sum((before**2 - noise**2) / noise**2))
    left = float(np.sum(np.maximum(after**2 - noise**2, 0) / noise**2))
    return 1 - left / excess if excess > 0 else 1.0


def _found(model: MechanicalModel, index: int, errors: dict[str, float]) -> FoundEffect:
    effect = model.effects[index]
    parameters = {}
    for p in effect.definition.parameters:
        if not p.fitted and effect.values[p.name] == p.default:
            continue
        unit = effect_unit(model, effect, p.name)
        error = errors.get(f"effect[{index}].{p.name}", 0.0)
        parameters[p.name] = Value(effect.values[p.name], error, unit)
    return FoundEffect(effect.kind, effect.at, parameters, effect.own)


def _asymmetries(model: MechanicalModel, found: Sequence[FoundEffect]) -> list[Confusion]:
    """Return the constants that friction of unlike size in the two directions would be.

    Only the friction in each direction plus or minus the constant shows while something slides.
    """
    pairs = []
    for constant in found:
        end = _loaded(model, constant)
        for friction in found:
            if end is None or friction.kind not in _DRY or end not in friction.at:
                continue
            size = next(iter(constant.parameters.values())).value
            name = next(iter(constant.parameters))
            lopsided = Effect("coulomb_friction", friction.at, {"asymmetry": -size})
            here = Effect(constant.kind, constant.at, {name: size})
            pairs.append(confused(here, lopsided))
    return pairs


def _loaded(model: MechanicalModel, constant: FoundEffect) -> str | None:
    """Return the coordinate on which a constant force acts, or seems to act by an offset."""
    if constant.kind == "constant_force":
        return constant.at[0]
    if constant.kind == "sensor_offset":
        output = next(o for o in model.outputs if o.name == constant.at[0])
        return output.of[0] if output.quantity == FORCE else None
    return None
