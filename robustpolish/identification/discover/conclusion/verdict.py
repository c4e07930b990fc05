"""The verdict on what a search found."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robustpolish.arrays import Array
from robustpolish.identification.discover.conclusion.final_fit import Final
from robustpolish.identification.discover.judge import (
    falls_where_fitted,
    more_left,
    undetermined,
)
from robustpolish.identification.discover.search import Search
from robustpolish.identification.laws.free_shape import better_shape
from robustpolish.models.mechanical import MechanicalModel

NO_EFFECT = "No effect of the catalogue makes the error fall visibly."


class Verdict(NamedTuple):
    """The verdict, its reasons, and the noise floor of each output in its unit."""

    word: str
    reasons: list[str]
    floor: Array


def verdict_on(search: Search, final: Final, base: Array, refitted: Array) -> Verdict:
    """Choose the verdict.

    Parameters
    ----------
    search : Search
    final : Final
    base, refitted : ndarray, shape (ny,)
        Errors of the model as it was, and refitted; of windows where `final` is not calm.
    """
    policy, error = search.policy, final.error
    size = np.std(search.prepared.record.Y, axis=0)
    floor = search.floor_beside(final.fit.model, final.calm)
    at_floor, into = bool(np.all(error < policy.shape_above * floor)), []
    if not at_floor and _noise_on_inputs(search) and np.all(error < policy.loudest * size):
        times = float(np.max(error / floor))
        into = [f"What is left is {times:.3g} times the noise of the sensors, "
                "and like a noise on the inputs."]  # fmt: skip
        at_floor, floor = True, error
    if search.added_to(final.fit.model):
        share = _explained(refitted, error, floor)
        told = [*into, f"The effects explain {100 * share:.0f} % of the error above the noise."]
        times = float(np.max(error / floor))
        if times > policy.far:
            told.insert(0, f"What is left is {times:.3g} times the noise.")
        if at_floor or share > policy.explained or not final.calm:
            return Verdict("missing_effect", told if share > 0 else [], floor)
        told[-1] += f" {100 * (1 - share):.0f} % is left."
        return Verdict("partly_explained", told, floor)
    if not at_floor:
        return Verdict("unexplained", [NO_EFFECT], floor)
    wrong = np.any(base > policy.improved * error)
    return Verdict("parameters" if wrong else "adequate", into, floor)


def more_is_left(search: Search, final: Final, verdict: Verdict) -> bool:
    """Return whether more than noise is left."""
    return bool(np.any(final.error > search.policy.shape_above * verdict.floor))


def wrong_name(search: Search, final: Final, refitted: Array, verdict: Verdict) -> str | None:
    """Say why the effects that were found are no names of what is missing.

    None if they are, or if there are none.
    """
    if not search.added_to(final.fit.model):
        return None
    if more_is_left(search, final, verdict):
        shape = better_shape(final.fit.model, search.prepared)
        if shape is not None:
            return shape
    if verdict.word != "partly_explained":
        return None
    fall = float(np.max(1 - final.error / refitted))
    if fall < search.policy.visible_fall or _explained(refitted, final.error, verdict.floor) <= 0:
        return NO_EFFECT  # a fit to all may leave nothing of what helped on some blocks
    effects = range(len(search.reference.effects), len(final.fit.model.effects))
    if all(undetermined(final.fit, at, search.policy) for at in effects):
        # a size that stands for others is a finding where all is explained, and only there
        return "What helps has no size that the data determine."
    return None


def crowded(search: Search, model: MechanicalModel) -> bool:
    """Return whether three effects or more were added at one place: one curve may be all that."""
    effects = search.added_to(model)
    added = [frozenset(e.at) for e in effects if e.definition.domain == "pair"]
    return any(added.count(at) > 2 for at in added)


def _noise_on_inputs(search: Search) -> bool:
    """Return whether the last screening saw noise on the inputs, and no missing force.

    It is none if anything that was tried in the end, though refused, leaves visibly less, be it of
    what it was fitted to: with thousands of samples for each number no fit bends itself to noise.
    Nor is it while so many effects share a place that one curve may be all of them, and more.
    """
    stage, policy = search.stage, search.policy
    if search.screening is None or crowded(search, stage.model):
        return False
    tried = [item.fitted for turn in search.turns if not turn.added for item in turn.tried]
    visible = np.log(1 - policy.visible_fall)
    if any(more_left(f, stage) < visible or falls_where_fitted(stage, f, policy) for f in tried):
        return False
    level = search.screening.level
    return level.force <= search.policy.silent and level.input_noise > 0


def _explained(before: Array, after: Array, noise: Array) -> float:
    """Return the share of the error's power above the noise that went away."""
    excess = float(np.sum((before**2 - noise**2) / noise**2))
    left = float(np.sum(np.maximum(after**2 - noise**2, 0) / noise**2))
    return 1 - left / excess if excess > 0 else 1.0
