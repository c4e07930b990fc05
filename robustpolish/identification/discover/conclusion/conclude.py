"""The end of a diagnosis: final fit, verdict, result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robustpolish.arrays import Array
from robustpolish.effects import Effect
from robustpolish.identification.discover.conclusion.final_fit import (
    Final,
    final_fit,
    fit_to_all,
    whole_error,
)
from robustpolish.identification.discover.conclusion.unknown_law import (
    LawFound,
    error_left,
    one_curve,
    replaces,
    unknown_law,
)
from robustpolish.identification.discover.conclusion.verdict import Verdict, verdict_on, wrong_name
from robustpolish.identification.discover.judge import undetermined
from robustpolish.identification.discover.search import Search
from robustpolish.identification.findings.confused import confused
from robustpolish.identification.findings.diagnosis import Diagnosis
from robustpolish.identification.findings.findings import Confusion, FoundEffect, Value
from robustpolish.identification.findings.ledger import Entry, Ledger
from robustpolish.identification.fit.least_squares import (
    Fit,
    covariance_of,
    errors_from,
)
from robustpolish.identification.observer.kalman import force_sites
from robustpolish.identification.residuals.force_maps import force_maps
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.data import effect_unit, unit_of
from robustpolish.models.mechanical.parts import FORCE

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
    before = _errors_before(search, names.calm)
    base, refitted = before[0], [*before, names.error][1]
    if search.reference is not model:
        # how an input acts between its samples is no number of the model
        base = whole_error(search.reference, search, names.calm)
    verdict = verdict_on(search, names, base, refitted)
    wrong = wrong_name(search, names, refitted, verdict)
    law = unknown_law(search, names, verdict, wrong)
    if law is not None:
        return _with_law(search, names, law, wrong)
    if wrong is not None:
        return _unexplained(search, names, before, wrong)
    return _diagnosis(search, names, before, verdict)


def conclude_with_one_curve(search: Search) -> Diagnosis | None:
    """Conclude with a curve that explains all of which the effects found leave visibly more.

    None if there is no such curve. The search stays as it is.
    """
    law = one_curve(search)
    if law is None:
        return None
    search.say("final fit")
    beside = search.copy()
    names = final_fit(beside)
    return _with_law(beside, names, law) if replaces(law, names) else None


def _errors_before(search: Search, calm: bool) -> list[Array]:
    """Return the errors of every step but the last."""
    search.say("errors of every step")
    return [whole_error(model, search, calm) for _, model in search.steps[:-1]]


def _with_law(search: Search, names: Final, law: LawFound, wrong: str | None = None) -> Diagnosis:
    """Conclude with a law in place of the effects that were found."""
    learned, error = law.learned, error_left(law, names)
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
        confusions=[],
    )
    floor = told.floor_beside(learned.model, names.calm)
    verdict = Verdict("unknown_law", reasons, np.minimum(floor, error))
    final = Final(learned.final, error, names.calm)
    return _diagnosis(told, final, _errors_before(told, names.calm), verdict)


def _unexplained(search: Search, names: Final, before: list[Array], wrong: str) -> Diagnosis:
    """Conclude with the model's own numbers; what was found is reported, not kept."""
    named = " and ".join(map(str, search.added_to(names.fit.model)))
    floor = search.floor_beside(names.fit.model, names.calm)
    own = fit_to_all(search, search.linear, search.linear.reproducible)
    reasons = [wrong, f"The nearest of the catalogue, not kept: {named}."]
    verdict = Verdict("unexplained", reasons, np.minimum(floor, own.error))
    told = replace(search, stage=search.linear, steps=search.steps[:2], confusions=[])
    return _diagnosis(told, own._replace(calm=names.calm), before[:1], verdict)


def _diagnosis(search: Search, final: Final, before: list[Array], verdict: Verdict) -> Diagnosis:
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
    deviations = errors_from(covariance)
    numbers = model.parameters
    added = range(len(reference.effects), len(model.effects))
    limited = [_NOT_ALL_TRIED] if search.prepared.work.refused else []
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
        reasons=(*search.reasons, *limited, *_left_open(fit, added, search), *verdict.reasons),
        reproducible=final.calm,
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
