"""Ask whether a force of any shape would do what a named effect does not.

An effect of a family (a hardening spring, say) is the best of the catalogue even if the true
law is another one of that family. If a free curve over displacement or velocity brings the
innovations to the noise where the named effect leaves them well above, the name is wrong.
"""

from __future__ import annotations

import numpy as np

from robustpolish.arrays import Array
from robustpolish.effects import Effect
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.screening.candidates import places
from robustpolish.identification.screening.filtered import FilteredRecord
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import port_row


def better_shape(model: MechanicalModel, prepared: PreparedRecord) -> str | None:
    """Return a sentence if a free curve at a place of the model's effects explains far more.

    Parameters
    ----------
    model : MechanicalModel
        With the effects that were found.
    prepared : PreparedRecord
    """
    policy, record, noise = prepared.policy, prepared.screened, prepared.scales.noise
    motion = prepared.motion(model, record)
    seen = [FilteredRecord(model, prepared, record, level, motion) for level in policy.shape_levels]
    for at in _places(model):
        rows, pairs = port_row(model, at)[None], [at]
        for name, signal in (("displacement", rows @ motion.q), ("velocity", rows @ motion.v)):
            columns = _hinges(signal[0])
            if any(_explains(f, rows, pairs, columns, noise) for f in seen):
                where = ", ".join(at)
                return (
                    f"A free curve of force over {name} at {where} explains far more than the "
                    "effects that have a name."
                )
    return None


def _places(model: MechanicalModel) -> list[tuple[str, ...]]:
    """Return the pairs at which the model has effects."""
    found = []
    for effect in model.effects:
        if effect.definition.domain == "pair":
            found.append(effect.at)
        elif effect.definition.domain == "dof":
            found.append((effect.at[0], "ground"))
    possible = {frozenset(at) for at in places(model, Effect("cubic_stiffness", ("x",)).definition)}
    return [at for at in dict.fromkeys(found) if frozenset(at) in possible]


def _hinges(x: Array) -> Array:
    """Return the columns of a piecewise linear curve, shape (columns, 1, samples)."""
    knots = np.percentile(x, [4, 12, 25, 40, 60, 75, 88, 96])
    return np.maximum(x - knots[:, None], 0.0)[:, None, :]


def _explains(
    f: FilteredRecord, rows: Array, pairs: list[tuple[str, ...]], columns: Array, noise: Array
) -> bool:
    before = np.sqrt(np.mean(f.residual(None)[0] ** 2, axis=0))
    rest, c = f.residual(f.weighted(f.observer.respond(rows, pairs, columns)))
    if not np.isfinite(c).all():
        return False
    after = np.sqrt(np.mean(rest**2, axis=0))
    return bool(
        np.all(after < f.policy.shape_above * noise)
        and np.any(before > f.policy.shape_fall * after)
    )
