"""Whatever users call a system, as a state-space system: transfer functions, gains, systems."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import control
import numpy as np
from control.exception import ControlMIMONotImplemented

from robustpolish.models.plant.blocks import named_system
from robustpolish.validation import described, instance_of, invalid, matrix, state_space

_KINDS = "a control.StateSpace, a control.TransferFunction or a gain"
# How far, relative, a realisation may lie from its transfer function at the points of the check.
_SAME_RESPONSE = 1e-6


def as_state_space(
    argument: str,
    value: Any,
    dt: float | bool | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> control.StateSpace:
    """Return a system, a transfer function or a gain as a state-space system.

    Parameters
    ----------
    argument : str
        Name of the argument, for messages.
    value : control.StateSpace, control.TransferFunction or array_like
        A state-space system comes back as it is. The states of a realised transfer function
        have no meaning; one of several inputs or outputs takes slycot, which realises it with the
        fewest states.
    dt : float, True or None, optional
        Sampling time of what has none of its own.
    inputs, outputs : sequence of str, optional
        Names of what is no state-space system; those of the transfer function by default.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    InvalidInputError
        If it is of another kind, has entries that are not finite, or is improper.
    """
    if isinstance(value, control.StateSpace):
        return state_space(argument, value)
    if isinstance(value, control.TransferFunction):
        return realised(argument, value, dt, inputs, outputs)
    if isinstance(value, control.InputOutputSystem | control.LTI):
        shown = described(type(value).__name__)
        raise invalid(argument, shown, _KINDS, "Fit or linearise it first.")
    if value is None or isinstance(value, str):
        raise invalid(argument, value, _KINDS, "Pass one of these.")
    gain = matrix(argument, value)
    rows, columns = gain.shape
    if (rows == 0) != (columns == 0):
        shown = described(f"shape {gain.shape}")
        raise invalid(argument, shown, "a gain with entries", "Give a row per output.")
    return named_system(
        ([], [], [], gain),
        0 if dt is None else dt,
        inputs or [f"u[{i}]" for i in range(columns)],
        outputs or [f"y[{i}]" for i in range(rows)],
    )


def realised(
    argument: str,
    system: control.TransferFunction,
    dt: float | bool | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> control.StateSpace:
    """Realise a proper transfer function; see :func:`as_state_space`."""
    instance_of(argument, system, control.TransferFunction, "a control.TransferFunction", "")
    every = [n for pair in (system.num_list, system.den_list) for row in pair for n in row]
    if not all(np.isfinite(n).all() for n in every):
        shown = described("coefficients that are not finite")
        raise invalid(argument, shown, "finite numbers", "Check its coefficients.")
    pairs = zip(system.num_list, system.den_list, strict=True)
    if any(n.size > d.size for row in pairs for n, d in zip(*row, strict=True)):
        raise invalid(
            argument,
            described("an improper TransferFunction"),
            "one with no more zeros than poles",
            "Add a lag to its derivative action.",
        )
    time = system.dt if system.dt is not None else dt
    timed = control.TransferFunction(system.num_list, system.den_list, time)
    single = system.ninputs == system.noutputs == 1
    try:
        found: Any = control.ss(
            timed,
            method="scipy" if single else None,
            inputs=list(system.input_labels if inputs is None else inputs),
            outputs=list(system.output_labels if outputs is None else outputs),
        )
    except (ControlMIMONotImplemented, ImportError):
        raise invalid(
            argument,
            described("a TransferFunction of several inputs or outputs, and slycot is missing"),
            "a control.StateSpace",
            "Install slycot, or pass a state-space realisation.",
        ) from None
    if not single:
        _same_response(argument, timed, found)
    return found


def _same_response(
    argument: str, system: control.TransferFunction, found: control.StateSpace
) -> None:
    """Refuse a realisation that is not what it realises: no routine is believed."""
    dens = [np.roots(d) for row in system.den_list for d in row]
    sizes = np.abs(np.concatenate([*dens, [1.0]]))
    scale = float(np.median(sizes[sizes > 0]))
    for factor in (0.03, 0.4, 1.1, 3.0, 40.0):
        s = 1.2 * np.exp(0.7j * factor) if system.isdtime(strict=True) else scale * factor * 1j
        s = complex(s) + 0.1 * scale * factor  # off the axis, where poles may lie
        want, have = np.atleast_2d(system(s)), np.atleast_2d(found(s))
        if not np.abs(want - have).max() <= _SAME_RESPONSE * np.abs(want).max():
            raise invalid(
                argument,
                described("a TransferFunction whose realisation has another response"),
                "one that can be realised in double precision",
                "Build it as a control.StateSpace.",
            )
