"""Numbers that a fit moved by decades."""

from __future__ import annotations

import math
from collections.abc import Mapping

from robustpolish.identification.sanity.limits import LIMITS
from robustpolish.identification.sanity.units import unit_of_change

_KINDS = {"mass": "mass", "inertia": "mass", "stiffness": "stiffness", "damping": "damping",
          "gain": "gain"}  # fmt: skip


def moved_numbers(before: Mapping[str, float], after: Mapping[str, float]) -> list[str]:
    """Name the numbers of a machine that a fit moved so far that a unit must be wrong.

    Parameters
    ----------
    before, after : mapping of str to float
        ``model.parameters`` of the model as it was given and as it was fitted.

    Returns
    -------
    list of str

    Examples
    --------
    >>> moved_numbers({"spring[0].stiffness": 2.0}, {"spring[0].stiffness": 1.9e6})[0]
    'the fit moved spring[0].stiffness from 2 to 1.9e+06, by 6.0 decades, as milliseconds taken
    for seconds make it. Check the units in the model file and of the channels and the time'
    >>> moved_numbers({"dof.x.mass": 2.0}, {"dof.x.mass": 3.0})
    []
    """
    found = []
    for key, old in before.items():
        kind = _KINDS.get(key.rpartition(".")[2])
        new = after.get(key, old)
        if kind is None or key.startswith("effect") or old == 0 or new == 0:
            continue
        if old * new < 0:
            found.append(
                f"the fit turned the sign of {key}, from {old:.4g} to {new:.4g}. Check the "
                "direction of the sensors and of the inputs"
            )
            continue
        ratio = new / old
        if max(ratio, 1 / ratio) < (LIMITS.damped if kind == "damping" else LIMITS.moved):
            continue
        guess = unit_of_change(kind, ratio)
        found.append(
            f"the fit moved {key} from {old:.4g} to {new:.4g}, by {abs(math.log10(ratio)):.1f} "
            f"decades{f', {guess}' if guess else ''}. Check the units in the model file and of the "
            "channels and the time"
        )
    return found
