"""Learn which physical effect a model lacks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.effects import Effect
from robustpolish.identification.confusion import asymmetries, experiment
from robustpolish.identification.diagnosis import (
    Confusion,
    Diagnosis,
    FoundEffect,
    RankedCandidate,
    Value,
)
from robustpolish.identification.evaluation import FREE, free_errors
from robustpolish.identification.gains import WrongGain, wrong_gains
from robustpolish.identification.holds import null_score, with_holds
from robustpolish.identification.ledger import Ledger
from robustpolish.identification.observer import Level, force_sites
from robustpolish.identification.parameters import effect_unit, unit_of
from robustpolish.identification.record import record_of
from robustpolish.identification.refit import (
    Setting,
    Stage,
    best_stage,
    homotopy,
    prepare,
    standard_errors,
)
from robustpolish.identification.screening import Candidate, Screening, screen
from robustpolish.identification.verdict import choose_verdict
from robustpolish.models.mechanical import MechanicalModel

Array = NDArray[np.float64]

VISIBLE_FALL = 0.2
LEAST_ODDS = 12.0
MOST_EFFECTS = 4
MOST_REFITS = 5
_LINEAR = (Level(1.0), Level(0.1), FREE)
_EXTENDED = (Level(0.1), Level(0.01), Level(0.001), FREE)

Progress = Callable[[str], None]


@dataclass
class _Search:
    """What the search knows so far."""

    setting: Setting
    reference: MechanicalModel
    stage: Stage
    ledger: Ledger
    guided: MechanicalModel
    candidates: list[RankedCandidate] = field(default_factory=list)
    confusions: list[Confusion] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    screening: Screening | None = None


def diagnose(
    model: MechanicalModel, data: xr.Dataset, progress: Progress | None = None
) -> Diagnosis:
    """Learn which physical effect a model lacks, and add it.

    Parameters
    ----------
    model : MechanicalModel
    data : xarray.Dataset
        Inputs and outputs of the model by name over uniform ``time``, SI units.
    progress : callable, optional
        Called with a short text at every step.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InvalidInputError
        If columns are missing or the record is too short.

    Notes
    -----
    The model's own numbers are refitted first. Then every effect of the catalogue is
    screened at every place with an observer that has a leaking random-walk force as the
    competing explanation, and coloured sensor noise and noise on the inputs as others. The
    best few are refitted by homotopy and ranked on held-out blocks. An effect is added if
    the held-out error falls visibly, its sign is physical and its parameters are
    determined; then the search starts again.
    """
    say = progress or (lambda text: None)
    record = record_of(model, data)
    setting = prepare(model, record)
    say("errors of the model as it is")
    ledger = Ledger(noise_floor=_by_output(model, setting.scales.noise, setting))
    base = _whole_error(model, setting)
    ledger = ledger.add("base", _by_output(model, base, setting))
    model = with_holds(model, setting)
    say("refit of the model's own parameters")
    stages = homotopy(model, setting, setting.trial, model, _LINEAR)
    stage = best_stage(stages, setting)
    search = _Search(setting, model, stage, ledger, stages[min(1, len(stages) - 1)].model)
    search.ledger = ledger.add(
        "refit", _by_output(model, _whole_error(stage.model, setting), setting)
    )
    while len(search.stage.model.effects) - len(model.effects) < MOST_EFFECTS:
        if not _add_one(search, say):
            break
    # only now: as long as something is missing, a fit bends masses and springs alike
    for found in wrong_gains(model, search.stage.model):
        _add_gain(search, found, say)
    return _conclude(search, model, base, say)


def _whole_error(model: MechanicalModel, setting: Setting) -> Array:
    errors = free_errors(
        model, setting.everything, setting.scales, setting.dt, setting.amplitude,
        setting.state_scale,
    )  # fmt: skip
    rms = np.sqrt(np.mean(errors**2, axis=0))
    return np.where(np.isfinite(rms), rms, np.inf)


def _by_output(model: MechanicalModel, values: Array, setting: Setting) -> dict[str, float]:
    size = np.std(setting.record.Y, axis=0)
    return dict(zip(model.output_names, (values / size).tolist(), strict=True))


def _add_one(search: _Search, say: Progress) -> bool:
    """Try to add one effect; return whether one earned its place."""
    setting, stage = search.setting, search.stage
    number = len(stage.model.effects) - len(search.reference.effects) + 1
    say(f"screening for effect {number}")
    screening = screen(
        _least_distorted(search), setting.screened, setting.scales, setting.amplitude
    )
    search.screening = screening
    hopeful = _hopeful(screening.candidates)
    refits: list[tuple[Candidate, Stage]] = []
    for candidate in hopeful:
        say(f"refit with {candidate.effect}")
        fitted = _refit_with(candidate, search)
        if fitted is not None:
            refits.append((candidate, fitted))
    ranked = sorted(refits, key=lambda item: _judgement(item[1], refits))
    _remember(search, ranked, screening.candidates, number)
    earned = _first_earned(_in_turn(ranked, search), search)
    if earned is None:
        return False
    candidate, fitted = earned
    _note_confusions(search, earned, ranked)
    search.stage = fitted
    search.ledger = search.ledger.add(
        candidate.effect.kind,
        _by_output(fitted.model, _whole_error(fitted.model, setting), setting),
    )
    return True


def _least_distorted(search: _Search) -> MechanicalModel:
    """Return the model from which to screen.

    A free-run fit bends the model's numbers to what is missing; one that is led by the data
    leaves that to the free force. The likelihood tells which is nearer.
    """
    if search.stage.model.effects != search.guided.effects:
        return search.stage.model
    pair = (search.stage.model, search.guided)
    return min(pair, key=lambda model: null_score(model, search.setting))


def _add_gain(search: _Search, found: WrongGain, say: Progress) -> None:
    """Add the gain of an input, if the error does not mind."""
    setting, model = search.setting, search.reference
    effect = found.effect
    say(f"refit with {effect}")
    extended = replace(model, effects=search.stage.model.effects).with_effect(
        effect.kind, effect.at, effect.values
    )
    stages = homotopy(extended, setting, setting.trial, model, _LINEAR)
    if not stages:
        return
    stage = best_stage(stages, setting)
    if np.mean(np.log(stage.error / search.stage.error)) > 0.05:
        return
    search.stage = stage
    for other in found.alike:
        search.confusions.append(Confusion(effect, other, experiment(effect, other)))
    search.reasons.append(found.reason)
    search.ledger = search.ledger.add(
        effect.kind, _by_output(stage.model, _whole_error(stage.model, setting), setting)
    )


def _hopeful(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the candidates that deserve a refit."""
    good = [c for c in candidates if c.sensible and c.score > LEAST_ODDS]
    if not good:
        return []
    best = good[0].score
    near = [c for c in good if c.score > 0.25 * best]
    return near[:MOST_REFITS]


def _refit_with(candidate: Candidate, search: _Search) -> Stage | None:
    effect = candidate.effect
    model = _least_distorted(search).with_effect(effect.kind, effect.at, effect.values)
    setting = search.setting
    stages = homotopy(model, setting, setting.trial, search.reference, _EXTENDED, _steps(setting))
    return best_stage(stages, setting) if stages else None


def _steps(setting: Setting) -> int:
    """Return the most steps of a stage: short records can afford more."""
    return 15 if setting.record.samples < 4000 else 7


def _judgement(stage: Stage, rivals: Sequence[tuple[Candidate, Stage]]) -> float:
    """Return the mean log of the held-out errors; guided ones unless all run reproducibly."""
    every = all(s.reproducible for _, s in rivals)
    errors = stage.free if every else stage.guided
    return float(np.mean(np.log(np.maximum(errors, 1e-300))))


def _tolerance(setting: Setting) -> float:
    """Return the relative difference of errors below which two effects are one to this data."""
    held = sum(p.record.samples for p in setting.held_out)
    return float(np.clip(40 / held, 0.003, 0.03))


def _in_turn(
    ranked: Sequence[tuple[Candidate, Stage]], search: _Search
) -> list[tuple[Candidate, Stage]]:
    """Return the candidates by error; among equals the one with the fewest parameters first."""
    if not ranked:
        return []
    rivals = list(ranked)
    limit = _judgement(rivals[0][1], rivals) + _tolerance(search.setting)

    def order(item: tuple[Candidate, Stage]) -> tuple[bool, int, float]:
        error = _judgement(item[1], rivals)
        equal = error <= limit
        return (not equal, _size(item[0].effect) if equal else 0, error)

    return sorted(rivals, key=order)


def _first_earned(
    candidates: Sequence[tuple[Candidate, Stage]], search: _Search
) -> tuple[Candidate, Stage] | None:
    """Return the first candidate that earns its place."""
    for candidate, fitted in candidates:
        remark = _objection(candidate, fitted, search)
        if not remark:
            return candidate, fitted
        search.reasons.append(f"{candidate.effect} was not added: {remark}.")
    return None


def _size(effect: Effect) -> int:
    return sum(p.fitted for p in effect.definition.parameters)


def _objection(candidate: Candidate, fitted: Stage, search: _Search) -> str | None:
    """Say why an effect does not earn its place."""
    before, after = search.stage, fitted
    free = before.reproducible and after.reproducible
    old, new = (before.free, after.free) if free else (before.guided, after.guided)
    fall = 1 - new / old
    if np.max(fall) < VISIBLE_FALL:
        return f"the held-out error falls by {100 * max(float(np.max(fall)), 0):.0f} % only"
    if np.mean(np.log(new / old)) > np.log(1 - VISIBLE_FALL / 2):
        return "one output gains what another loses"
    effect = _last_effect(fitted.model)
    implausible = effect.definition.implausible(effect.values)
    if implausible:
        return implausible
    errors = standard_errors(fitted.fit, search.setting.record)
    index = len(fitted.model.effects) - 1
    lead = next(p.name for p in effect.definition.parameters if p.fitted)
    error = errors.get(f"effect[{index}].{lead}", 0.0)
    if not error < 0.5 * abs(effect.values[lead]) and effect.definition.domain != "input":
        return f"its {lead} is not determined"
    return None


def _last_effect(model: MechanicalModel) -> Effect:
    last = model.effects[-1]
    return Effect(last.kind, last.at, last.parameters)


def _note_confusions(
    search: _Search,
    winner: tuple[Candidate, Stage],
    ranked: Sequence[tuple[Candidate, Stage]],
) -> None:
    rivals = list(ranked)
    here = _judgement(winner[1], rivals)
    for candidate, stage in ranked:
        if candidate is winner[0]:
            continue
        if _judgement(stage, rivals) - here < _tolerance(search.setting):
            pair = (winner[0].effect, candidate.effect)
            search.confusions.append(Confusion(*pair, experiment(*pair)))


def _remember(
    search: _Search,
    ranked: Sequence[tuple[Candidate, Stage]],
    screened: Sequence[Candidate],
    number: int,
) -> None:
    size = np.std(search.setting.record.Y, axis=0)
    done = set()
    for candidate, stage in ranked:
        effect = _last_effect(stage.model)
        done.add(id(candidate))
        search.candidates.append(
            RankedCandidate(
                effect.kind, effect.at, float(np.mean(stage.error / size)), candidate.score,
                number, effect.values,
            )
        )  # fmt: skip
    for candidate in screened:
        if id(candidate) not in done and candidate.score > 0:
            search.candidates.append(
                RankedCandidate(
                    candidate.effect.kind, candidate.effect.at, np.inf, candidate.score, number,
                    candidate.effect.values, candidate.remark or "screened only",
                )
            )  # fmt: skip


def _conclude(search: _Search, model: MechanicalModel, base: Array, say: Progress) -> Diagnosis:
    """Fit the final model to the whole record and choose the verdict."""
    setting, stage = search.setting, search.stage
    say("final fit")
    levels = (Level(0.01), FREE) if stage.reproducible else (Level(0.1), Level(0.01))
    fits = homotopy(stage.model, setting, setting.everything, model, levels, _steps(setting))
    final = fits[-1] if fits else stage.fit
    error = _whole_error(final.model, setting)
    if stage.reproducible and np.mean(np.log(error)) > np.mean(
        np.log(_whole_error(stage.model, setting))
    ):
        final = stage.fit
        error = _whole_error(final.model, setting)
    added = final.model.effects[len(model.effects) :]
    names = final.model.output_names
    ledger = search.ledger
    if added or len(ledger.entries) > 1:
        last = replace(ledger.entries[-1], nrmse=_by_output(model, error, setting))
        ledger = replace(ledger, entries=(*ledger.entries[:-1], last))
    refit = search.ledger.entries[1].nrmse
    refitted = np.array([refit[name] for name in names]) * np.std(setting.record.Y, axis=0)
    verdict, reasons, floor = choose_verdict(
        setting, stage, search.screening, base, refitted, error, bool(added)
    )
    ledger = replace(ledger, noise_floor=dict(zip(names, floor.tolist(), strict=True)))
    errors = standard_errors(final, setting.record)
    values = {
        key: Value(final.model.parameters[key], errors[key], unit_of(final.model, key))
        for key in errors
    }
    found = tuple(_found(final.model, len(model.effects) + i, errors) for i in range(len(added)))
    search.confusions += asymmetries(found)
    motion = search.screening.motion if search.screening else None
    _, sites = force_sites(model)
    return Diagnosis(
        verdict, final.model, found, tuple(search.candidates), tuple(search.confusions), ledger,
        motion.force if motion else np.zeros((len(sites), 0)), tuple(sites), values,
        (*search.reasons, *reasons), stage.reproducible,
    )  # fmt: skip


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
