"""Which of the refitted candidates earns its place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robustpolish.effects import Effect
from robustpolish.identification.discover.candidates import rivals
from robustpolish.identification.discover.hopeful import VISIBLE_FALL
from robustpolish.identification.discover.screening import Candidate
from robustpolish.identification.discover.search import Search
from robustpolish.identification.fit.chains import connected
from robustpolish.identification.fit.homotopy import Stage
from robustpolish.identification.fit.prepared import Setting
from robustpolish.identification.fit.standard_errors import standard_errors

# Times the noise, beyond which an error is no noise.
FAR = 3.0

Refitted = tuple[Candidate, Stage]


def judgement(stage: Stage, rivals: Sequence[Refitted]) -> float:
    """Return the mean log of the held-out errors; guided ones unless all run reproducibly."""
    every = all(s.reproducible for _, s in rivals)
    errors = stage.free if every else stage.guided
    return float(np.mean(np.log(np.maximum(errors, 1e-300))))


def tolerance(setting: Setting) -> float:
    """Return the relative difference of errors below which two effects are one to this data."""
    held = sum(p.record.samples for p in setting.held_out)
    return float(np.clip(40 / held, 0.003, 0.03))


def in_turn(ranked: Sequence[Refitted], search: Search) -> list[Refitted]:
    """Return the candidates by error; among equals the one with the fewest parameters first."""
    if not ranked:
        return []
    every = list(ranked)
    limit = judgement(every[0][1], every) + tolerance(search.setting)
    joined = connected(search.reference)

    def order(item: Refitted) -> tuple[bool, int, bool, float]:
        error = judgement(item[1], every)
        effect = item[0].effect
        if error > limit:
            return True, 0, False, error
        ends = set(effect.at) - {"ground"}
        apart = effect.definition.domain == "pair" and not any(ends <= g for g in joined)
        return False, _size(effect), apart, error

    return _simpler_first(sorted(every, key=order), search)


def _simpler_first(ordered: list[Refitted], search: Search) -> list[Refitted]:
    """Put a simpler kind of the same family ahead if the first is not visibly better.

    Far above the noise something else is missing too, and a kind with more parameters bends itself
    to that.
    """
    effect, stage = ordered[0][0].effect, ordered[0][1]
    if np.any(stage.error < FAR * search.setting.scales.noise):
        return ordered
    limit = judgement(stage, ordered) - np.log(1 - VISIBLE_FALL)
    simpler = [
        item
        for item in ordered
        if rivals(item[0].effect.definition, effect.definition)
        and item[0].effect.at == effect.at
        and _size(item[0].effect) < _size(effect)
        and judgement(item[1], ordered) < limit
    ]
    if not simpler:
        return ordered
    first = min(simpler, key=lambda item: (_size(item[0].effect), judgement(item[1], ordered)))
    return [first, *(item for item in ordered if item is not first)]


def first_earned(candidates: Sequence[Refitted], search: Search) -> Refitted | None:
    """Return the first candidate that earns its place."""
    for candidate, fitted in candidates:
        remark = objection(search.stage, fitted, search.setting)
        if not remark:
            return candidate, fitted
        search.reasons.append(f"{candidate.effect} was not added: {remark}.")
    return None


def _size(effect: Effect) -> int:
    return sum(p.fitted for p in effect.definition.parameters)


def objection(before: Stage, after: Stage, setting: Setting, place: int = -1) -> str | None:
    """Say why an effect does not earn its place.

    Parameters
    ----------
    before, after : Stage
        Without and with it.
    setting : Setting
    place : int, optional
        Where it stands among the effects of the model; it is the last one by default.
    """
    free = before.reproducible and after.reproducible
    old, new = (before.free, after.free) if free else (before.guided, after.guided)
    fall = 1 - new / old
    if np.max(fall) < VISIBLE_FALL:
        return f"the held-out error falls by {100 * max(float(np.max(fall)), 0):.0f} % only"
    if np.mean(np.log(new / old)) > np.log(1 - VISIBLE_FALL / 2):
        return "one output gains what another loses"
    index = place % len(after.model.effects)
    effect = after.model.effects[index]
    implausible = effect.definition.implausible(effect.values)
    if implausible:
        return implausible
    errors = standard_errors(after.fit, setting.record)
    lead = next(p.name for p in effect.definition.parameters if p.fitted)
    error = errors.get(f"effect[{index}].{lead}", 0.0)
    if not error < 0.5 * abs(effect.values[lead]) and effect.definition.domain != "input":
        return f"its {lead} is not determined"
    return None
