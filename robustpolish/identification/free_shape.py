"""Ask whether a force of any shape would do what a named effect does not.

An effect of a family (a hardening spring, say) is the best of the catalogue even if the true
law is another one of that family. If a free curve over displacement or velocity brings the
innovations to the noise where the named effect leaves them well above, the name is wrong.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robustpolish.effects import Effect
from robustpolish.identification.candidates import places
from robustpolish.identification.filtered import Filtered
from robustpolish.identification.following import following
from robustpolish.identification.missing_force import smooth
from robustpolish.identification.observer import Level
from robustpolish.identification.setting import Setting
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import port_pairs, port_rows

Array = NDArray[np.float64]
_LEVELS = (Level(0.1), Level(0.01), Level(0.002))
_AT_NOISE = 1.5
_FALL = 1.5


def better_shape(model: MechanicalModel, setting: Setting) -> str | None:
    """Return a sentence if a free curve at a place of the model's effects explains far more.

    Parameters
    ----------
    model : MechanicalModel
        With the effects that were found.
    setting : Setting
    """
    record = setting.screened
    time = np.asarray(record.data["time"].values, dtype=float)
    level = following(model, record, setting.scales)
    motion = smooth(model, record, level, setting.scales, setting.amplitude)
    seen = [Filtered(model, record, level, setting.scales, motion, time) for level in _LEVELS]
    for at in _places(model):
        effect = Effect("cubic_stiffness", at)
        rows, pairs = port_rows(model, effect), port_pairs(effect)
        for name, signal in (("displacement", rows @ motion.q), ("velocity", rows @ motion.v)):
            columns = _hinges(signal[0])
            if any(_explains(f, rows, pairs, columns, setting.scales.noise) for f in seen):
                where = ", ".join(at)
                return (
                    f"A free curve of force over {name} at {where} explains far more than the "
                    "effects that have a name."
                )
    return None


def _places(model: MechanicalModel) -> list[tuple[str, ...]]:
    """Return the pairs at which the model has effects."""
    found = []
    for added in model.effects:
        effect = Effect(added.kind, added.at, added.parameters)
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
    f: Filtered, rows: Array, pairs: list[tuple[str, ...]], columns: Array, noise: Array
) -> bool:
    before = np.sqrt(np.mean(f.residual(None)[0] ** 2, axis=0))
    rest, c = f.residual(f.weighted(f.observer.respond(rows, pairs, columns)))
    if not np.isfinite(c).all():
        return False
    after = np.sqrt(np.mean(rest**2, axis=0))
    return bool(np.all(after < _AT_NOISE * noise) and np.any(before > _FALL * after))
