"""A controller of other matrices with the same signals."""

from __future__ import annotations

from typing import Any

import control

from robustpolish.models.plant.blocks import named_system


def named_like(
    system: control.StateSpace, matrices: Any, dt: float | bool | None
) -> control.StateSpace:
    """Return the system of these matrices with the inputs and outputs of another.

    Parameters
    ----------
    system : control.StateSpace
        Gives the names, those of its states only if there are as many.
    matrices : sequence of ndarray
    dt : float, True or None

    Returns
    -------
    control.StateSpace
    """
    n = len(matrices[0])
    states = system.state_labels if n == system.nstates else [f"x[{i}]" for i in range(n)]
    time = 0 if dt is None else dt
    return named_system(matrices, time, system.input_labels, system.output_labels, states)
