"""Effects that hide each other: neither shows how much it does while the other is missing."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from robustpolish.effects import CONSTANT, Effect
from robustpolish.identification.discover.candidates import rivals
from robustpolish.identification.discover.judge import Refitted, judgement, objection
from robustpolish.identification.discover.search import Search, steps
from robustpolish.identification.fit.evaluation import FREE
from robustpolish.identification.fit.homotopy import Stage, best_stage, guided_rms, homotopy
from robustpolish.identification.fit.least_squares import Fit
from robustpolish.identification.observer.kalman import Level
from robustpolish.models.mechanical import MechanicalModel

# Share by which an effect that hides behind another lets the error fall at least.
_LEAST_FALL = 0.1
_MOST = 3
_ASKED, _HELPS = Level(0.01), 0.97
_EXTENDED = (Level(0.1), _ASKED, Level(0.001), FREE)


def fitted_with(model: MechanicalModel, effect: Effect, search: Search) -> Stage | None:
    """Return a model with one more effect, fitted.

    None if no fit ended well, or if the effect does not help even a model that is led by the data.
    """
    setting = search.setting
    extended = model.with_effect(effect.kind, effect.at, effect.values)
    if not model.free:  # all motion is imposed: no run can go astray, and none can be led
        most = 2 * steps(setting)
        stages = homotopy(extended, setting, setting.trial, search.reference, (FREE,), most)
        return best_stage(stages, setting) if stages else None
    before = guided_rms(model, setting, setting.trial, _ASKED)

    def enough(level: Level, fit: Fit) -> bool:
        return level != _ASKED or bool(np.any(fit.rmse < _HELPS * before))

    stages = homotopy(
        extended, setting, setting.trial, search.reference, _EXTENDED, steps(setting),
        enough=enough,
    )  # fmt: skip
    return best_stage(stages, setting) if stages else None


def before_constant(earned: Refitted, ranked: Sequence[Refitted], search: Search) -> Refitted:
    """Return the effect that is to be named before a constant, or the constant.

    An offset or a preload hides how well other effects do. If one of them earns its place beside
    the constant, it comes first, and the constant later.
    """
    alone = earned[1]
    if not _is_constant(earned):
        return earned
    found: list[tuple[float, Refitted]] = []
    for candidate, fitted in ranked[:_MOST]:
        if _is_constant((candidate, fitted)):
            continue
        both = fitted_with(fitted.model, alone.model.effects[-1], search)
        if both is not None and not objection(alone, both, search.setting, place=-2):
            found.append((float(np.mean(np.log(both.error))), (candidate, fitted)))
    return min(found, key=lambda item: item[0])[1] if found else earned


def hiding(ranked: Sequence[Refitted], search: Search) -> Refitted | None:
    """Return the first of two effects that earn their places only beside each other.

    Parameters
    ----------
    ranked : sequence
        Candidates with their fits, the best first; none of them earned its place alone.
    search : Search

    Returns
    -------
    Refitted or None
        The second is found by the next screening.
    """
    limit = judgement(search.stage, ranked) + np.log(1 - _LEAST_FALL)
    near = [item for item in ranked[:_MOST] if judgement(item[1], ranked) < limit]
    if near and not any(_is_constant(item) for item in near):
        near += _likeliest_constant(ranked, search)
    for one, other in combinations(near, 2):
        if rivals(one[0].effect.definition, other[0].effect.definition):
            continue
        both = fitted_with(one[1].model, other[1].model.effects[-1], search)
        if both is None:
            continue
        kept = objection(other[1], both, search.setting, place=-2)
        added = objection(one[1], both, search.setting)
        if not kept and not added:
            first, second = one, other
            if _is_constant(first):
                first, second = second, first
            search.reasons.append(
                f"{first[0].effect} earns its place only beside {second[0].effect}."
            )
            return first
    return None


def _is_constant(item: Refitted) -> bool:
    return item[0].effect.definition.family == CONSTANT


def _likeliest_constant(ranked: Sequence[Refitted], search: Search) -> list[Refitted]:
    """Return an offset or preload, which alone shows next to nothing of what it hides."""
    refitted = [item for item in ranked if _is_constant(item)]
    if refitted or search.screening is None:
        return refitted[:1]
    screened = [c for c in search.screening.candidates if c.effect.definition.family == CONSTANT]
    for candidate in sorted(screened, key=lambda c: -c.score)[:1]:
        fitted = fitted_with(search.stage.model, candidate.effect, search)
        if fitted is not None:
            refitted.append((candidate, fitted))
    return refitted
