"""Learn which physical effect a model lacks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.identification.discover.conclude import conclude
from robustpolish.identification.discover.confusion import experiment
from robustpolish.identification.discover.diagnosis import Confusion, Diagnosis
from robustpolish.identification.discover.hopeful import VISIBLE_FALL, hopeful
from robustpolish.identification.discover.input_hold import null_score, with_holds
from robustpolish.identification.discover.judge import (
    Refitted,
    first_earned,
    in_turn,
    judgement,
    objection,
)
from robustpolish.identification.discover.noting import note_confusions, remember
from robustpolish.identification.discover.own_numbers import refit_own
from robustpolish.identification.discover.pairs import before_constant, fitted_with, hiding
from robustpolish.identification.discover.screening import screen
from robustpolish.identification.discover.search import Search
from robustpolish.identification.discover.verdict import SILENT
from robustpolish.identification.discover.wrong_gain import WrongGain, wrong_gains
from robustpolish.identification.fit.evaluation import FREE
from robustpolish.identification.fit.homotopy import Stage, best_stage, homotopy
from robustpolish.identification.fit.prepared import Setting, prepare
from robustpolish.identification.observer.kalman import Level
from robustpolish.identification.record import record_of
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.progress import working

Array = NDArray[np.float64]

MOST_EFFECTS = 4
# An effect whose score is below this share of the best is no rival to one that explains all.
NEAR_SCORE = 0.6
_LINEAR = (Level(1.0), Level(0.1), FREE)

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

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> diagnosis = rp.diagnose(model, data.isel(time=slice(0, 500)))
    >>> effect = diagnosis.effects[0]
    >>> diagnosis.verdict, effect.kind, round(effect.parameters["force"].value, 1)
    ('missing_effect', 'coulomb_friction', 3.0)
    """
    if progress is not None:
        return _diagnose(model, data, progress)
    with working("Diagnosing") as tell:
        return _diagnose(model, data, tell)


def _diagnose(model: MechanicalModel, data: xr.Dataset, say: Progress) -> Diagnosis:
    record = record_of(model, data)
    setting = prepare(model, record)
    entries: list[tuple[str, MechanicalModel]] = [("base", model)]
    say("how inputs act between their samples")
    model = with_holds(model, setting)
    say("refit of the model's own parameters")
    stage, guided = refit_own(model, setting)
    search = Search(setting, model, stage, entries, guided, stage)
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
        refits: list[Refitted] = []
        chosen, further = hopeful(screening)
        for candidate in [*chosen, *further]:
            explained = any(_at_floor(s, setting) for _, s in refits)
            if explained and candidate.score < NEAR_SCORE * chosen[0].score:
                break
            if candidate in further and _any_earned(refits, search):
                break
            say(f"refit with {candidate.effect}")
            fitted = fitted_with(start, candidate.effect, search)
            if fitted is not None:
                refits.append((candidate, fitted))
        ranked = sorted(refits, key=lambda item: judgement(item[1], refits))
        remember(search, ranked, screening.candidates, number)
        earned = first_earned(in_turn(ranked, search), search)
        if earned is not None:
            earned = before_constant(earned, ranked, search)
            note_confusions(search, earned, ranked)
        else:
            earned = hiding(ranked, search)
        if earned is not None:
            _accept(search, earned)
            return True
        if screening.level.force <= SILENT:
            break  # no missing force is seen: another start will not show one
    return False


def _at_floor(stage: Stage, setting: Setting) -> bool:
    """Return whether not even the noise alone would make the error fall visibly."""
    return bool(np.all(stage.error * (1 - VISIBLE_FALL) < setting.scales.noise))


def _any_earned(refits: Sequence[Refitted], search: Search) -> bool:
    """Return whether one of the candidates earns its place."""
    return any(not objection(search.stage, stage, search.setting) for _, stage in refits)


def _accept(search: Search, earned: Refitted) -> None:
    candidate, search.stage = earned
    search.steps.append((candidate.effect.kind, search.stage.model))
    refused = f"{candidate.effect} was not added"
    search.reasons = [reason for reason in search.reasons if not reason.startswith(refused)]


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
