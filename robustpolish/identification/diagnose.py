"""Learn which physical effect a model lacks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.effects import Effect
from robustpolish.identification.chains import connected
from robustpolish.identification.conclusion import conclude
from robustpolish.identification.confusion import experiment
from robustpolish.identification.diagnosis import (
    Confusion,
    Diagnosis,
    RankedCandidate,
)
from robustpolish.identification.evaluation import FREE
from robustpolish.identification.gains import WrongGain, wrong_gains
from robustpolish.identification.holds import null_score, with_holds
from robustpolish.identification.homotopy import Stage, best_stage, homotopy
from robustpolish.identification.observer import Level
from robustpolish.identification.record import record_of
from robustpolish.identification.screening import Candidate, screen
from robustpolish.identification.search import Search, steps
from robustpolish.identification.setting import Setting, prepare
from robustpolish.identification.standard_errors import standard_errors
from robustpolish.identification.verdict import SILENT
from robustpolish.models.mechanical import MechanicalModel

Array = NDArray[np.float64]

VISIBLE_FALL = 0.2
LEAST_ODDS = 12.0
MOST_EFFECTS = 4
MOST_REFITS = 5
# An effect whose score is below this share of the best is no rival to one that explains all.
NEAR_SCORE = 0.6
_LINEAR = (Level(1.0), Level(0.1), FREE)
_EXTENDED = (Level(0.1), Level(0.01), Level(0.001), FREE)

Progress = Callable[[str], None]


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
    entries: list[tuple[str, MechanicalModel]] = [("base", model)]
    say("how inputs act between their samples")
    model = with_holds(model, setting)
    say("refit of the model's own parameters")
    stages = homotopy(model, setting, setting.trial, model, _LINEAR)
    stage = best_stage(stages, setting)
    search = Search(setting, model, stage, entries, stages[min(1, len(stages) - 1)].model, stage)
    entries.append(("refit", stage.model))
    while len(search.stage.model.effects) - len(model.effects) < MOST_EFFECTS:
        if not _add_one(search, say):
            break
    # only now: as long as something is missing, a fit bends masses and springs alike
    for found in wrong_gains(model, search.stage.model):
        _add_gain(search, found, say)
    return conclude(search, model, say)


def _add_one(search: Search, say: Progress) -> bool:
    """Try to add one effect; return whether one earned its place."""
    setting = search.setting
    if _at_floor(search.stage, setting):
        return False
    number = len(search.stage.model.effects) - len(search.reference.effects) + 1
    for start in _starts(search):
        say(f"screening for effect {number}")
        screening = screen(start, setting.screened, setting.scales, setting.amplitude)
        search.screening = screening
        refits: list[tuple[Candidate, Stage]] = []
        hopeful = _hopeful(screening.candidates)
        for candidate in hopeful:
            explained = any(_at_floor(s, setting) for _, s in refits)
            if explained and candidate.score < NEAR_SCORE * hopeful[0].score:
                break
            say(f"refit with {candidate.effect}")
            fitted = _refit_with(candidate, start, search)
            if fitted is not None:
                refits.append((candidate, fitted))
        ranked = sorted(refits, key=lambda item: _judgement(item[1], refits))
        _remember(search, ranked, screening.candidates, number)
        earned = _first_earned(_in_turn(ranked, search), search)
        if earned is not None:
            _accept(search, earned, ranked)
            return True
        if screening.level.force <= SILENT:
            break  # no missing force is seen: another start will not show one
    return False


def _at_floor(stage: Stage, setting: Setting) -> bool:
    """Return whether not even the noise alone would make the error fall visibly."""
    return bool(np.all(stage.error * (1 - VISIBLE_FALL) < setting.scales.noise))


def _accept(
    search: Search,
    earned: tuple[Candidate, Stage],
    ranked: Sequence[tuple[Candidate, Stage]],
) -> None:
    candidate, fitted = earned
    _note_confusions(search, earned, ranked)
    search.stage = fitted
    search.steps.append((candidate.effect.kind, fitted.model))


def _starts(search: Search) -> list[MechanicalModel]:
    """Return the models from which to screen, the more likely one first.

    A free-run fit bends the model's numbers to what is missing; one that is led by the data
    leaves that to the free force, but may wander off where the data say little.
    """
    if search.stage.model.effects != search.guided.effects:
        return [search.stage.model]
    pair = [search.stage.model, search.guided]
    return sorted(pair, key=lambda model: null_score(model, search.setting))


def _add_gain(search: Search, found: WrongGain, say: Progress) -> None:
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
    search.steps.append((effect.kind, stage.model))


def _hopeful(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the candidates that deserve a refit."""
    good = [c for c in candidates if c.sensible and c.score > LEAST_ODDS]
    if not good:
        return []
    best = good[0].score
    near = [c for c in good if c.score > 0.25 * best]
    return near[:MOST_REFITS]


def _refit_with(candidate: Candidate, start: MechanicalModel, search: Search) -> Stage | None:
    effect = candidate.effect
    model = start.with_effect(effect.kind, effect.at, effect.values)
    setting = search.setting
    stages = homotopy(model, setting, setting.trial, search.reference, _EXTENDED, steps(setting))
    return best_stage(stages, setting) if stages else None


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
    ranked: Sequence[tuple[Candidate, Stage]], search: Search
) -> list[tuple[Candidate, Stage]]:
    """Return the candidates by error; among equals the one with the fewest parameters first."""
    if not ranked:
        return []
    rivals = list(ranked)
    limit = _judgement(rivals[0][1], rivals) + _tolerance(search.setting)

    joined = connected(search.reference)

    def order(item: tuple[Candidate, Stage]) -> tuple[bool, int, bool, float]:
        error = _judgement(item[1], rivals)
        effect = item[0].effect
        if error > limit:
            return True, 0, False, error
        ends = set(effect.at) - {"ground"}
        apart = effect.definition.domain == "pair" and not any(ends <= g for g in joined)
        return False, _size(effect), apart, error

    return sorted(rivals, key=order)


def _first_earned(
    candidates: Sequence[tuple[Candidate, Stage]], search: Search
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


def _objection(candidate: Candidate, fitted: Stage, search: Search) -> str | None:
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
    search: Search,
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
    search: Search,
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
