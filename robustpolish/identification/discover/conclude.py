"""The end of a diagnosis: final fit, verdict, result."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from robustpolish.effects import Effect
from robustpolish.identification.discover.confusion import asymmetries
from robustpolish.identification.discover.diagnosis import Diagnosis, FoundEffect, Value
from robustpolish.identification.discover.free_shape import better_shape
from robustpolish.identification.discover.ledger import Ledger
from robustpolish.identification.discover.search import Search, by_output, steps, whole_error
from robustpolish.identification.discover.verdict import choose_verdict
from robustpolish.identification.fit.evaluation import FREE, motion_along, reproducible
from robustpolish.identification.fit.homotopy import Stage, homotopy
from robustpolish.identification.fit.least_squares import Fit
from robustpolish.identification.fit.parameters import effect_unit, unit_of
from robustpolish.identification.fit.prepared import Setting
from robustpolish.identification.fit.standard_errors import covariance_of, errors_from
from robustpolish.identification.observer.kalman import Level, force_sites
from robustpolish.models.mechanical import MechanicalModel

Array = NDArray[np.float64]


def conclude(search: Search, model: MechanicalModel, say: Callable[[str], None]) -> Diagnosis:
    """Fit the final model to the whole record and choose the verdict.

    Parameters
    ----------
    search : Search
    model : MechanicalModel
        The model as it was, holds of its inputs included.
    say : callable
        Told what is done.
    """
    setting = search.setting
    say("final fit")
    steady = _steady(search.stage, setting)
    final, error = _final_fit(search, search.stage, model, steady)
    added = len(final.model.effects) > len(model.effects)
    names = model.output_names
    say("errors of every step")
    errors = [whole_error(m, setting, steady) for _, m in search.steps[:-1]] + [error]
    base, refitted = errors[0], errors[min(1, len(errors) - 1)]
    # how an input acts between its samples is no number of the model
    as_it_was = whole_error(model, setting, steady) if model is not search.steps[0][1] else base
    verdict, reasons, floor = choose_verdict(
        setting, steady, search.screening, as_it_was, refitted, error, added
    )
    if added and verdict == "missing_effect" and np.any(error > 1.5 * setting.scales.noise):
        other = better_shape(final.model, setting)
        if other:
            verdict, reasons = "unexplained", [other]
    if added and verdict == "unexplained":
        # what explains too little is reported as a candidate, not kept in the model
        named = ", ".join(e.kind for e in final.model.effects[len(model.effects) :])
        reasons = [*reasons, f"The nearest of the catalogue, not kept: {named}."]
        del search.steps[2:]
        search.confusions.clear()
        final, error = _final_fit(search, search.linear, model, search.linear.reproducible)
        errors = [base, error]
        floor = np.minimum(setting.scales.noise, error) / np.std(setting.record.Y, axis=0)
    ledger = Ledger(noise_floor=dict(zip(names, floor.tolist(), strict=True)))
    for (step, _), size in zip(search.steps, errors, strict=True):
        ledger = ledger.add(step, by_output(model, size, setting))
    covariance = covariance_of(final, setting.record)
    deviations = errors_from(covariance)
    values = {
        key: Value(final.model.parameters[key], deviations[key], unit_of(final.model, key))
        for key in deviations
    }
    indices = range(len(model.effects), len(final.model.effects))
    found = tuple(_found(final.model, index, deviations) for index in indices)
    motion = motion_along(final.model, setting.record, setting.scales, setting.amplitude)
    return Diagnosis(
        verdict=verdict,
        model=final.model,
        effects=found,
        candidates=tuple(search.candidates),
        indistinguishable=(*search.confusions, *asymmetries(model, found)),
        ledger=ledger,
        missing_force=motion.force,
        sites=tuple(force_sites(model)[1]),
        parameters=values,
        covariance=covariance,
        reasons=(*search.reasons, *reasons),
        reproducible=steady,
        time=np.asarray(setting.record.data["time"].values, dtype=float),
    )


def _steady(stage: Stage, setting: Setting) -> bool:
    """Return whether free runs over the whole record judge a model."""
    return stage.reproducible and reproducible(
        stage.model, setting.everything[0], setting.scales, setting.dt, setting.amplitude,
        setting.state_scale,
    )  # fmt: skip


def _final_fit(
    search: Search, stage: Stage, model: MechanicalModel, steady: bool
) -> tuple[Fit, Array]:
    """Fit a stage's model to the whole record; return the fit and its free-run error."""
    setting = search.setting
    levels = (Level(0.01), FREE) if steady else (Level(0.1), Level(0.01))
    if steady and not stage.model.effects:
        levels = (FREE,)  # led by the data, it would leave what the data hardly show
    fits = homotopy(stage.model, setting, setting.everything, model, levels, steps(setting))
    before = whole_error(stage.model, setting, steady)
    if not fits:
        return stage.fit, before
    error = whole_error(fits[-1].model, setting, steady)
    if np.mean(np.log(error)) > np.mean(np.log(before)):
        return stage.fit, before
    return fits[-1], error


def _found(model: MechanicalModel, index: int, errors: dict[str, float]) -> FoundEffect:
    added = model.effects[index]
    effect = Effect(added.kind, added.at, added.parameters)
    parameters = {}
    for p in effect.definition.parameters:
        key = f"effect[{index}].{p.name}"
        if not p.fitted and effect.values[p.name] == p.default:
            continue
        unit = effect_unit(model, added.kind, effect.at, p.name)
        parameters[p.name] = Value(effect.values[p.name], errors.get(key, 0.0), unit)
    return FoundEffect(effect.kind, effect.at, parameters)
