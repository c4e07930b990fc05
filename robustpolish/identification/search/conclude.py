"""From the end of a search to its diagnosis: final fit, learned laws, verdict, what is alike."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.identification.diagnosis import Diagnosis
from robustpolish.identification.findings import (
    Entry,
    FoundEffect,
    IndistinguishablePair,
    Ledger,
    RankedCandidate,
    Value,
    indistinguishable_pair,
    learned_laws_of,
)
from robustpolish.identification.fit.least_squares import (
    Fit,
    covariance_of,
    effective_samples,
    evaluate_fit,
    free_run_rms,
    free_run_rms_checked,
    homotopy,
    log_odds,
)
from robustpolish.identification.fit.parameters import with_effects_at
from robustpolish.identification.fit.result import stderr_from_covariance
from robustpolish.identification.observer.kalman import force_sites
from robustpolish.identification.residual_tests import force_maps, residual_noise_floor
from robustpolish.identification.search import score
from robustpolish.identification.search.equivalents import (
    find_force_equivalents,
    richer_kinds,
    with_rounded_turn,
)
from robustpolish.identification.search.laws import CURVES, KINDS, OVER_TIME, learn
from robustpolish.identification.search.search import NEAR, EffectSearch, told_alike
from robustpolish.identification.search.verdict import (
    NEAR_NOISE,
    FinalFit,
    Residual,
    Verdict,
    residual_of,
    verdict_on,
)
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.mechanical.data import effect_unit, unit_of
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import FORCE

_NAMED = 3
"""Kinds of the catalogue that are refitted in place of a learned curve."""
_DRY = ("coulomb_friction", "stribeck_friction")


class Conclusion(NamedTuple):
    """The model that is the answer, fitted to parts of the record and to the whole of it."""

    scored: score.ScoredModel
    final: FinalFit
    residual: Residual


def conclude(run: EffectSearch, model: MechanicalModel, stopped: bool = False) -> Diagnosis:
    """Fit the final model to the whole record and choose the verdict.

    Parameters
    ----------
    run : EffectSearch
    model : MechanicalModel
        As the user gave it.
    stopped : bool, optional
        Whether the search was stopped: nothing is fitted any more.
    """
    predictable = _predictable(run)
    if stopped:
        final = _as_it_is(run, predictable)
        found = Conclusion(run.best, final, residual_of(final, run.prepared))
    else:
        run.say("final fit")
        found = _final(run, predictable)
    final = found.final
    run.say("errors of every step")
    before = [(step, scored.model) for step, scored in run.steps[:-1]]
    if not run.best.added or found.scored is not run.best:
        before = [(step, scored.model) for step, scored in run.steps]
        if found.scored.places == run.base.places:
            before = []
    steps = [("base", model), *before]
    errors = [whole_record_error(m, run, final.predictable) for _, m in steps]
    base = errors[0]
    if run.reference is not model:
        # how an input acts between its samples is no number of the model
        base = whole_record_error(run.reference, run, final.predictable)
    refitted = errors[1] if len(errors) > 1 else final.error
    if found.scored.curves:
        verdict = _verdict_on_law(run, found)
    else:
        verdict = verdict_on(run, final, found.residual, base, refitted)
    last = run.steps[-1][0]
    if found.scored is not run.best:
        new = [str(e) for e in found.scored.added if (e.kind, e.at) not in run.best.places]
        last = " and ".join(new) or last
    return _diagnosis(run, found, verdict, [*steps, (last, final.model)], [*errors, final.error])


def _final(run: EffectSearch, predictable: bool) -> Conclusion:
    """Return the best model fitted to the whole record, or a learned law that is better."""
    final = _refined(run, fit_whole_record(run, run.best, predictable))
    refined = run.fits.scored(evaluate_fit(final.fit, run.prepared))
    if refined is not None and refined.places != run.best.places:
        run.accept(refined)
    residual = residual_of(final, run.prepared)
    names = Conclusion(run.best, final, residual)
    asked = run.most > 0 and (run.enough is None or not run.at_noise_floor(run.best))
    if not (asked and residual.structure and run.prepared.work.left()):
        return names
    law = _better_law(run, residual, named=not (refined is None or refined.refusal[0]))
    if law is None:
        return names
    final = fit_whole_record(run, law, predictable)
    found = Conclusion(law, final, residual_of(final, run.prepared))
    if found.scored.curves:
        return found
    run.accept(law)  # it has a name
    return found._replace(final=_refined(run, final))


def _better_law(run: EffectSearch, residual: Residual, named: bool) -> score.ScoredModel | None:
    """Return a learned law in place of all that was added, if it is better by strong evidence.

    A kind of the catalogue that makes its force takes its place if it is as good. `named` says
    whether the whole record bears out what was added.
    """
    run.say("a law that no catalogue holds")
    # a surface can be anything, so it takes the place of no name
    kinds = CURVES if run.best.laws else KINDS
    ways = [kinds, OVER_TIME] if run.reference.inputs else [kinds]
    found = []
    for way in ways:
        law = learn(run, way, residual.floor)
        if law is None:
            continue
        # a curve that leaves more than noise is no answer where there are names
        left = residual_noise_floor(law.model, run.prepared, law.fitted.reproducible)
        explains = bool(np.all(law.fitted.error < NEAR_NOISE * left))
        if explains or not (named and run.best.laws):
            found += [law, *_named(run, law)]
        if explains:
            break
    chosen = score.simplest_of_best([run.best, *found], run.base)
    return None if chosen is run.best else chosen


def _named(run: EffectSearch, scored: score.ScoredModel) -> list[score.ScoredModel]:
    """Return models with kinds of the catalogue that make nearly the force of a learned curve."""
    laws = scored.curves
    if len(laws) != 1 or len(laws[0].definition.over) != 1:
        return []
    at = scored.model.effects.index(laws[0])
    found = []
    for near in find_force_equivalents(scored.model, at, run.prepared)[:_NAMED]:
        if near.left < NEAR:
            run.say(f"refit with {near.effect} in place of the curve")
            named = run.fits.replaced(scored, laws[0], near.effect)
            if named is not None and not run.note(named, (near.effect,)):
                found.append(named)
    return found


def _verdict_on_law(run: EffectSearch, found: Conclusion) -> Verdict:
    curves = found.scored.curves
    over = " and ".join(name for e in curves for name in e.definition.over)
    size = np.std(run.prepared.record.Y, axis=0)
    before, after = (
        float(np.max(scored.fitted.error / size)) for scored in (run.base, found.scored)
    )
    what = learned_laws_of(found.final.model, None)[-1].quantity
    gain = score.nats(found.scored, run.base)
    reasons = [
        f"A {what} over {over} at {', '.join(curves[0].at)} takes the held-out error from "
        f"{before:.3g} to {after:.3g} of the output's deviation ({gain:.0f} nats).",
        *found.residual.structure,
    ]
    if run.best.added:
        named = " and ".join(map(str, run.best.added))
        gain = float(np.diff(score.scores([run.best, found.scored], run.base))[0])
        reasons.append(f"Not kept, {gain:.0f} nats behind: {named}.")
    return Verdict("unknown_law", reasons, found.residual.floor)


# The fit to the whole record.


def _predictable(run: EffectSearch) -> bool:
    """Return whether free runs over the whole record judge what was found; windows do otherwise."""
    stage, prepared = run.best.fitted, run.prepared
    return (
        stage.reproducible and free_run_rms_checked(stage.model, prepared, prepared.everything)[1]
    )


def _as_it_is(run: EffectSearch, predictable: bool) -> FinalFit:
    error = whole_record_error(run.best.model, run, predictable)
    return FinalFit(run.best.fitted.fit, error, predictable)


def fit_whole_record(run: EffectSearch, scored: score.ScoredModel, predictable: bool) -> FinalFit:
    """Fit a model to the whole record, and judge it there."""
    prepared, stage = run.prepared, scored.fitted
    policy, pieces = prepared.policy, prepared.everything
    spans = prepared.spans(pieces, policy.growth)
    if not predictable:
        spans = [span for span in spans if span < prepared.short] + [prepared.short]
    before = whole_record_error(stage.model, run, predictable)
    if predictable and np.all(before < policy.lost * stage.error):
        spans = spans[-2:]  # what follows the whole record already is not lost on long windows
    last = policy.follows(prepared.record.Y.size)
    fits = homotopy(
        stage.model, prepared, pieces, run.reference, spans, prepared.steps, run.fits.check,
        last=last, known=True,
    )  # fmt: skip
    if not fits:
        return FinalFit(stage.fit, before, predictable)
    error = whole_record_error(fits[-1].model, run, predictable)
    if np.mean(np.log(error)) > np.mean(np.log(before)):
        return FinalFit(stage.fit, before, predictable)
    return FinalFit(fits[-1], error, predictable)


def whole_record_error(model: MechanicalModel, run: EffectSearch, predictable: bool) -> Array:
    """Return the free-run error of each output over the whole record.

    A model whose long runs are not reproducible is run in windows.
    """
    prepared = run.prepared
    return free_run_rms(model, prepared, prepared.everything if predictable else prepared.windows)


def _refined(run: EffectSearch, final: FinalFit) -> FinalFit:
    """Return the final fit with its effects in the finer form that the whole record asks for.

    A jump of friction is rounded: what it leaves at every reversal may be less than the noise and
    yet move all other numbers by more than their standard errors. A kind that has more numbers
    takes the place of one: a part of the record may not have told them. The likelihood over the
    whole record decides.
    """
    prepared, predictable = run.prepared, final.predictable
    pieces = prepared.everything if predictable else prepared.windows
    last = prepared.policy.follows(prepared.record.Y.size)
    spans = prepared.spans(pieces)[-1:]
    for at in range(len(run.reference.effects), len(final.model.effects)):
        before = final
        for begun, numbers in _finer(run, before, at):
            for fitted in homotopy(
                begun, prepared, pieces, run.reference, spans, prepared.steps, run.fits.check,
                last=last, known=True,
            ):  # fmt: skip
                left = whole_record_error(fitted.model, run, predictable)
                counts = effective_samples(fitted.errors)
                alike = fitted.errors.shape == final.fit.errors.shape
                odds = (
                    log_odds(fitted, final.fit)
                    if alike
                    else float(np.sum(counts * np.log(final.error / left)))
                )
                cost = 0.5 * len(numbers) * np.log(np.sum(counts))
                errors = stderr_from_covariance(covariance_of(fitted))
                values = fitted.model.effects[at].values
                determined = all(
                    errors.get(f"effect[{at}].{n}", np.inf) < score.DETERMINED * values[n]
                    for n in numbers
                )
                if determined and odds - cost > score.STRONG:
                    final = FinalFit(fitted, left, predictable)
    return final


def _finer(
    run: EffectSearch, final: FinalFit, at: int
) -> Iterator[tuple[MechanicalModel, list[str]]]:
    """Yield models with an effect in a finer form to begin from, and the numbers that it adds."""
    model, prepared = final.model, run.prepared
    effect = model.effects[at]
    turned = with_rounded_turn(model, at, prepared)
    if turned is not None:
        yield turned.model, [effect.definition.turns_over]
    for richer in richer_kinds(model, at, prepared):
        more = [p.name for p in richer.definition.parameters if p.fitted]
        own = [p.name for p in effect.definition.parameters]
        yield with_effects_at(model, at, richer), [name for name in more if name not in own]


# The diagnosis as data.


def _diagnosis(
    run: EffectSearch,
    found: Conclusion,
    verdict: Verdict,
    steps: Sequence[tuple[str, MechanicalModel]],
    errors: Sequence[Array],
) -> Diagnosis:
    """Put the findings together."""
    fit, record, reference = found.final.fit, run.prepared.record, run.reference
    model = fit.model
    size = np.std(record.Y, axis=0)

    def by_output(values: Array) -> dict[str, float]:
        return dict(zip(model.output_names, (values / size).tolist(), strict=True))

    entries = tuple(
        Entry(step, by_output(error), then)
        for (step, then), error in zip(steps, errors, strict=True)
    )
    left = run.prepared.motion(model, record)
    covariance = covariance_of(fit)
    deviations = stderr_from_covariance(covariance)
    numbers = model.parameters
    added = range(len(reference.effects), len(model.effects))
    effects = tuple(found_effect(model, index, deviations) for index in added)
    named = not found.scored.curves
    alike = [indistinguishable_pair(*p) for p in _alike_pairs(run, found)] if named else []
    limited = []
    if run.prepared.work.refused:
        limited = ["The search was ended by its limit of work before all was tried."]
    return Diagnosis(
        verdict=verdict.word,
        model=model,
        effects=effects,
        candidates=tuple(_candidates(run)),
        indistinguishable=(*alike, *_friction_asymmetries(reference, effects)),
        ledger=Ledger(entries, by_output(verdict.floor)),
        missing_force=left.force,
        maps=force_maps(model, left),
        sites=tuple(force_sites(reference)[1]),
        parameters={k: Value(numbers[k], e, unit_of(model, k)) for k, e in deviations.items()},
        covariance=covariance,
        reasons=(
            *_describe_held_out(run),
            *limited,
            *_undetermined_effects(fit, added),
            *verdict.reasons,
        ),
        reproducible=found.final.predictable,
        time=record.axis,
    )


def _alike_pairs(run: EffectSearch, found: Conclusion) -> list[tuple[Effect, Effect]]:
    """Return effects that were found, each with one that the data do not tell from it.

    Beside what was fitted it is every kind whose force comes so near that the difference, as an
    error of the outputs, is no strong evidence.
    """
    pairs = told_alike(run)
    final = found.final
    for index in range(len(run.reference.effects), len(final.model.effects)):
        effect = final.model.effects[index]
        if effect.definition.domain != "pair":
            continue
        known = {(b.kind, b.at) for a, b in pairs if (a.kind, a.at) == (effect.kind, effect.at)}
        known |= {(e.kind, e.at) for t in run.tried for e in t.effects if t.scored is not None}
        for near in find_force_equivalents(final.model, index, run.prepared)[:3]:
            other = near.effect
            if (other.kind, other.at) in known:
                continue
            instead = with_effects_at(final.model, index, other)
            error = whole_record_error(instead, run, final.predictable)
            counted = effective_samples(final.fit.errors)
            with np.errstate(divide="ignore"):
                odds = float(np.sum(counted * np.log(error / final.error)))
            if odds < score.STRONG:
                pairs.append((effect, other))
    return pairs


def _candidates(run: EffectSearch) -> Iterator[RankedCandidate]:
    """Yield what was refitted, then what was only screened in the last round."""
    size = np.std(run.prepared.record.Y, axis=0)
    once = {(t.step, frozenset((e.kind, e.at) for e in t.effects)): t for t in run.tried}
    fitted = [t for t in once.values() if t.scored is not None and t.effects]
    gains = score.scores([t.scored for t in fitted if t.scored is not None], run.base)
    for tried, gain in sorted(zip(fitted, gains, strict=True), key=lambda p: (p[0].step, -p[1])):
        assert tried.scored is not None
        error = float(np.mean(tried.scored.fitted.error / size))
        e, *beside = tried.effects
        yield RankedCandidate(
            e.kind, e.at, error, gain, tried.step, e.values, tried.refused, e.own, tuple(beside)
        )
    places = {(e.kind, e.at) for t in fitted for e in t.effects}
    for other in run.screening.candidates if run.screening is not None else ():
        if other.place not in places and other.nats > 0:
            e, remark = other.effect, other.remark or "screened only"
            step = 1 + run.best.laws
            yield RankedCandidate(e.kind, e.at, np.inf, other.nats, step, e.values, remark, e.own)


def _undetermined_effects(final: Fit, added: Sequence[int]) -> list[str]:
    """Say of which effects the first number is not determined, though they are there."""
    leads = {i: score.undetermined_parameter(final, i) for i in added}
    effects = final.model.effects
    return [
        f"{effects[i]} is there, but the data leave its {lead} open."
        for i, lead in leads.items()
        if lead
    ]


def found_effect(model: MechanicalModel, index: int, errors: dict[str, float]) -> FoundEffect:
    """Return an effect of a fitted model with the standard errors and units of its sizes."""
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


def _describe_held_out(run: EffectSearch) -> list[str]:
    """Say what several records are used for."""
    prepared, said = run.prepared, []
    if prepared.repeats is not None:
        said.append(f"{prepared.repeats.names} repeat each other: their difference is the noise.")
    kept = {piece.record.name for piece in prepared.estimation}
    held = dict.fromkeys(piece.record.name for piece in prepared.held_out)
    whole = [name for name in held if name not in kept]
    if whole:
        blocks = [f"blocks of {name}" for name in held if name in kept]
        said.append(f"Held out to judge: {', '.join([*whole, *blocks])}.")
    return said
