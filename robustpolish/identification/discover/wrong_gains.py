"""Gains that a refit hides in a common factor of masses and springs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robustpolish.effects import Effect
from robustpolish.identification.discover.search import Search
from robustpolish.identification.findings.confused import confused
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
    spans = prepared.spans(prepared.trial)
    stages = homotopy(model, prepared, prepared.trial, reference, spans)
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
        gain = np.log(new[f"input.{names[0]}.gain"] / old[f"input.{names[0]}.gain"])
        moved = [
            gain - np.array([np.log(new[k] / old[k]) for k in keys if old[k] > 0 and new[k] > 0])
            for keys in (masses, springs)
        ]
        if not all(logs.size for logs in moved):
            continue
        # masses are weighed, springs are known roughly: each may err by itself, their mean hardly
        common = float(np.mean(moved[0]))
        apart = max(float(np.ptp(moved[0])), abs(float(np.mean(moved[1])) - common))
        spread = search.policy.gain_spread * abs(common)
        if abs(common) < search.policy.gain_least or apart > spread:
            continue
        effect = Effect("input_gain", (names[0],), {"gain": float(np.exp(common))})
        outputs = [o.name for o in before.outputs if chain.intersection(o.of)]
        alike = [Effect("sensor_gain", (outputs[0],))] if len(outputs) == 1 else []
        found.append(WrongGain(effect, tuple(alike)))
    return found
