"""Tell a wrong gain from wrong masses and springs.

The error cannot: a machine that is lighter and softer by one factor answers like one whose
input is larger, or whose sensor shows too much. But masses and springs do not err by the same
factor by chance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robustpolish.effects import Effect
from robustpolish.identification.discover.confusion import confused
from robustpolish.identification.discover.search import Search
from robustpolish.identification.fit.homotopy import best_stage, homotopy
from robustpolish.identification.fit.parameters import chain_keys, connected, driving


@dataclass(frozen=True)
class WrongGain:
    """A gain that explains what a refit did to masses and springs.

    Attributes
    ----------
    effect : Effect
    alike : tuple of Effect
        Effects that would explain it as well.
    """

    effect: Effect
    alike: tuple[Effect, ...]


def add_wrong_gains(search: Search) -> None:
    """Add the gains that explain what the refit did to masses and springs, if there are any."""
    for wrong in _wrong_gains(search):
        _add(search, wrong)


def _add(search: Search, wrong: WrongGain) -> None:
    """Add the gain of an input, if the error does not mind."""
    prepared, reference, effect = search.prepared, search.reference, wrong.effect
    search.say(f"refit with {effect}")
    model = replace(reference, effects=(*search.stage.model.effects, effect))
    stages = homotopy(model, prepared, prepared.trial, reference, search.policy.linear)
    if not stages:
        return
    stage = best_stage(stages, prepared)
    if np.mean(np.log(stage.error / search.stage.error)) > search.policy.gain_loss:
        return
    search.stage = stage
    search.confusions += [confused(effect, other) for other in wrong.alike]
    search.reasons.append(
        f"Masses and springs err by one factor: {effect.at[0]} acts {effect.values['gain']:.3g} "
        "times as strongly as the record says."
    )
    search.steps.append((effect.kind, stage.model))


def _wrong_gains(search: Search) -> list[WrongGain]:
    """Return the gains that a refit hides in a common factor of masses and springs."""
    before, after = search.reference, search.stage.model
    old, new = before.parameters, after.parameters
    found = []
    there = {(e.kind, e.at) for e in after.effects}
    for chain in connected(before):
        names = driving(before, chain)
        if len(names) != 1 or ("input_gain", (names[0],)) in there:
            continue
        masses, springs, _ = chain_keys(before, chain)
        keys = [key for key in masses + springs if old[key] > 0 and new[key] > 0]
        if len(keys) < 2:
            continue
        logs = [np.log(new[key] / old[key]) for key in keys]
        gain = f"input.{names[0]}.gain"
        common = float(np.log(new[gain] / old[gain]) - np.mean(logs))
        scatter = search.policy.gain_spread * abs(common)
        if abs(common) < search.policy.gain_least or np.ptp(logs) > scatter:
            continue
        effect = Effect("input_gain", (names[0],), {"gain": float(np.exp(common))})
        outputs = [o.name for o in before.outputs if chain.intersection(o.of)]
        alike = [Effect("sensor_gain", (outputs[0],))] if len(outputs) == 1 else []
        found.append(WrongGain(effect, tuple(alike)))
    return found
