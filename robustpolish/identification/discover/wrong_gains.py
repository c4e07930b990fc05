"""Gains that a refit hides in masses and springs.

The gain of the only input is a common factor of all masses and springs. That of a sensor may be
hidden as well, where masses have no sensor: then other numbers explain the record as exactly as the
gain. What the data do not tell, what was known beforehand does: that machine is named whose numbers
are the likelier, at odds that count as very strong evidence (Kass and Raftery 1995, Journal of the
American Statistical Association 90, 773-795).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robustpolish.effects import Effect
from robustpolish.identification.discover.search import Search
from robustpolish.identification.findings.confused import confused
from robustpolish.identification.fit.homotopy import JudgedFit
from robustpolish.identification.fit.parameters import (
    chain_keys,
    connected,
    driving,
    free_parameters,
)
from robustpolish.models.mechanical.parts import FORCE


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
    _move_likelier(search)
    for wrong in _wrong_gains(search):
        _add(search, wrong)
    _add_likelier(search)


def _move_likelier(search: Search) -> None:
    """Put a gain that was found where the data do not tell it from, if numbers are likelier so."""
    pairs = [p for p in search.confusions if p.first.kind == p.second.kind == "sensor_gain"]
    for pair in pairs:
        here = [(e.kind, e.at) for e in search.stage.model.effects]
        if (pair.first.kind, pair.first.at) not in here:
            continue
        at = here.index((pair.first.kind, pair.first.at))
        moved = _with_gain(search, pair.second, at)
        if moved is None or _odds(moved, search) <= search.policy.strong_odds:
            continue
        before, search.stage = search.stage, moved
        named = moved.model.effects[at]
        search.confusions[search.confusions.index(pair)] = confused(named, pair.first)
        _say_known(search, named, before)
        search.steps[-1] = (search.steps[-1][0], moved.model)


def _add_likelier(search: Search) -> None:
    """Add the gain beside which the numbers are far likelier than they are without any gain."""
    policy, model = search.policy, search.stage.model
    # where more than noise is left, numbers bend to what is missing, and so would a gain
    if _unlikely(search.stage, search) <= policy.strong_odds or not search.noise_alone(
        policy.at_floor
    ):
        return
    # numbers that one effect after the other has bent may lie far out in a flat valley
    straight = _begun_as_known(search, model.effects)
    if straight is not None and _odds(straight, search) > 0:
        search.stage = straight
        search.steps[-1] = (search.steps[-1][0], straight.model)
        if _unlikely(straight, search) <= policy.strong_odds:
            return
    there = {(e.kind, e.at) for e in model.effects}
    gains = [("sensor_gain", (o.name,)) for o in model.outputs if o.quantity != FORCE]
    gains += [("input_gain", (i.name,)) for i in model.inputs if i.imposes is None]
    tried = [Effect(kind, at, {"gain": 1.0}) for kind, at in gains if (kind, at) not in there]
    fits = [fitted for effect in tried if (fitted := _with_gain(search, effect)) is not None]
    ranked = sorted(((_odds(fitted, search), i) for i, fitted in enumerate(fits)), reverse=True)
    if not ranked or ranked[0][0] <= policy.strong_odds:
        return
    before, search.stage = search.stage, fits[ranked[0][1]]
    named = search.stage.model.effects[-1]
    search.confusions += [
        confused(named, fits[i].model.effects[-1])
        for odds, i in ranked[1:]
        if ranked[0][0] - odds <= policy.strong_odds
    ]
    _say_known(search, named, before)
    search.steps.append((named.kind, search.stage.model))


def _say_known(search: Search, named: Effect, before: JudgedFit) -> None:
    search.reasons.append(
        f"Other numbers explain as much as {named}, but {_furthest(before, search)}, and that is "
        "known better."
    )


def _odds(fitted: JudgedFit, search: Search) -> float:
    """Return the log odds of a fit over the best so far, by held-out errors and what was known.

    A lower error is no evidence here: screening would have seen it.
    """
    samples = sum(piece.record.samples for piece in search.prepared.held_out)
    fall = float(np.sum(np.log(search.stage.error / fitted.error)))
    return samples * min(fall, 0.0) + _unlikely(search.stage, search) - _unlikely(fitted, search)


def _known(fitted: JudgedFit, search: Search) -> dict[str, float]:
    """Return how far numbers moved from what was known, in standard deviations of that."""
    model, prepared = fitted.model, search.prepared
    values = model.parameters
    free = free_parameters(model, prepared.scales.bandwidth, search.policy, search.reference)
    return {f.key: (values[f.key] - f.centre) / f.prior for f in free if np.isfinite(f.prior)}


def _unlikely(fitted: JudgedFit, search: Search) -> float:
    """Return by how much less likely the numbers are than what was known, as log odds."""
    return 0.5 * sum(moved**2 for moved in _known(fitted, search).values())


def _furthest(fitted: JudgedFit, search: Search) -> str:
    """Say which number moved furthest."""
    moved = _known(fitted, search)
    key = max(moved, key=lambda name: abs(moved[name]))
    before, after = (m.parameters[key] for m in (search.reference, fitted.model))
    return f"{key} would be {after:.3g} instead of {before:.3g}"


def _add(search: Search, wrong: WrongGain) -> None:
    """Add the gain of an input, if the error does not mind."""
    effect, stage = wrong.effect, _with_gain(search, wrong.effect)
    if stage is None:
        return
    if _lost(search.stage, stage) > search.policy.gain_loss:
        return
    search.stage = stage
    search.confusions += [confused(effect, other) for other in wrong.alike]
    search.reasons.append(
        f"Masses and springs err by one factor: {effect.at[0]} acts {effect.values['gain']:.3g} "
        "times as strongly as the record says."
    )
    search.steps.append((effect.kind, stage.model))


def _lost(before: JudgedFit, after: JudgedFit) -> float:
    """Return the log of the error that is lost; near chaos only long runs part by chance."""
    pairs = (after.error, before.error), (after.short, before.short)
    return min(float(np.mean(np.log(new / old))) for new, old in pairs)


def _with_gain(search: Search, gain: Effect, at: int | None = None) -> JudgedFit | None:
    """Return the model with a gain, fitted from its numbers as they were; None if nothing ended.

    It comes last, or takes the place of the effect that stands at `at`.
    """
    search.say(f"refit with {gain}")
    there = search.stage.model.effects
    effects = (*there, gain) if at is None else (*there[:at], gain, *there[at + 1 :])
    return _begun_as_known(search, effects)


def _begun_as_known(search: Search, effects: tuple[Effect, ...]) -> JudgedFit | None:
    """Return the model with these effects, fitted from its own numbers as they were."""
    spans = search.prepared.spans(search.prepared.trial)
    return search.fitted_over(replace(search.reference, effects=effects), spans)


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
