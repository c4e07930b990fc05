"""Linear systems with named signals: made from matrices, and as plain values in files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike

from robustpolish.saved_file import Fields


def named_system(
    matrices: Sequence[ArrayLike],
    dt: float | bool,
    inputs: Sequence[str],
    outputs: Sequence[str],
    states: Sequence[str] = (),
) -> control.StateSpace:
    """Return the system of A, B, C, D with these names, states without effect kept.

    Parameters
    ----------
    matrices : sequence of array_like
        A, B, C and D.
    dt : float or True
        Sampling time in s; 0 is continuous time.
    inputs, outputs, states : sequence of str
        Names.

    Returns
    -------
    control.StateSpace
    """
    names = {"inputs": list(inputs), "outputs": list(outputs), "states": list(states)}
    return control.StateSpace(*matrices, dt, remove_useless_states=False, **names)


def system_content(system: control.StateSpace) -> dict[str, Any]:
    """Return a system as plain values, every entry of its matrices exact."""
    return {
        **{name: np.asarray(getattr(system, name)) for name in "ABCD"},
        "dt": 0 if system.dt is None else system.dt,
        "states": list(system.state_labels),
        "inputs": list(system.input_labels),
        "outputs": list(system.output_labels),
    }


def system_from(fields: Fields) -> control.StateSpace:
    """Return the system that :func:`system_content` described."""
    inputs, outputs, states = (list(fields.texts(key)) for key in ("inputs", "outputs", "states"))
    n, m, p = len(states), len(inputs), len(outputs)
    shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
    matrices = [fields.array(name, *shape) for name, shape in shapes.items()]
    dt = True if fields.raw("dt") is True else fields.number("dt")
    return named_system(matrices, dt, inputs, outputs, states)
