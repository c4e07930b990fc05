"""Find out what the inputs do between their samples.

A record made with a zero-order hold and read as linear looks like half a sample of delay; a
smooth one with content near the sampling rate like an error of every model. Neither is a
missing effect of the machine.
"""

from __future__ import annotations

from robustpolish.identification.discover.filtered import null_score
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.models.mechanical import MechanicalModel

_LINEAR = 1.0


def with_holds(model: MechanicalModel, prepared: PreparedRecord) -> MechanicalModel:
    """Return the model with the holds of its force inputs, where they are not linear.

    All inputs are taken to be of one kind. The linear model's innovations judge, its own
    numbers being corrected at the same time.
    """
    policy = prepared.policy
    names = [i.name for i in model.inputs if i.imposes is None]
    if not names or any(e.kind == "input_hold" for e in model.effects):
        return model
    tried = {_LINEAR: model}
    for order in policy.hold_orders:
        held = model
        for name in names:
            held = held.with_effect("input_hold", (name,), {"order": order})
        tried[order] = held
    scores = {order: null_score(candidate, prepared) for order, candidate in tried.items()}
    best = min(scores, key=lambda order: scores[order])
    if scores[_LINEAR] - scores[best] <= 2 * policy.hold_odds:
        return model
    if best == 0.0 and _late(model, names, prepared) < scores[best]:
        return model  # a longer delay, of which a hold would take half a sample
    return tried[best]


def _late(model: MechanicalModel, names: list[str], prepared: PreparedRecord) -> float:
    """Return the best score with one input late by some whole samples."""
    return min(
        null_score(model.with_effect("input_delay", (name,), {"delay": delay}), prepared)
        for name in names
        for delay in (n * prepared.record.dt for n in prepared.policy.hold_delays)
    )
