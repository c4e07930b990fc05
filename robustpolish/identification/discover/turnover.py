"""Dry friction that turns over within some speed, and not at once.

A friction that is fitted as a jump leaves something at every reversal if it is none, which kinds
with memory and more numbers take for theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robustpolish.identification.discover.judge import judgement
from robustpolish.identification.discover.search import RefittedEffect, Search
from robustpolish.identification.fit.least_squares import covariance_of, errors_from
from robustpolish.identification.fit.parameters import turns_over_gently
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import port_rows


def rounded_friction(
    refits: Sequence[RefittedEffect], start: MechanicalModel, search: Search
) -> list[RefittedEffect]:
    """Return the best of the dry frictions that jump once more, the speed of its turn being fitted.

    Parameters
    ----------
    refits : sequence of RefittedEffect
        At one place.
    start : MechanicalModel
        The model without any of them.
    search : Search

    Returns
    -------
    list of RefittedEffect
        One or none: a jump that leaves noise alone is one, and one whose speed the data leave open
        may as well be.
    """
    jumps = [
        r for r in refits if r.effect.definition.turns_over and not turns_over_gently(r.effect)
    ]
    if not jumps:
        return []
    best = min(jumps, key=lambda item: judgement(item.fitted, jumps))
    effect = best.fitted.model.effects[-1]
    motion = search.prepared.motion(start, search.prepared.screened)
    speed = float(np.sqrt(np.mean((port_rows(start, effect) @ motion.v)[0] ** 2)))
    if search.at_floor(best.fitted) or not speed > 0:
        return []
    name = effect.definition.turns_over
    gentle = effect.with_values({**effect.parameters, name: search.policy.turnover * speed})
    search.say(f"refit with {effect} that turns over gently")
    fitted = search.fitted_with(start, gentle)
    if fitted is None:
        return []
    index = len(fitted.model.effects) - 1
    error = errors_from(covariance_of(fitted.fit)).get(f"effect[{index}].{name}", np.inf)
    if not error < search.policy.determined * fitted.model.effects[index].values[name]:
        return []
    return [RefittedEffect(replace(best.screened, effect=gentle), fitted)]
