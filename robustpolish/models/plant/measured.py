"""A plant that is known by its frequency response only."""

from __future__ import annotations

from collections.abc import Sequence

import control
import numpy as np

from robustpolish.arrays import AnyArray, Vector
from robustpolish.validation import described, invalid


def rearranged(
    system: control.FrequencyResponseData, outputs: Sequence[int], inputs: Sequence[int]
) -> control.FrequencyResponseData:
    """Return a response with its signals in another order.

    Parameters
    ----------
    system : control.FrequencyResponseData
    outputs, inputs : sequence of int
        Where each stood.

    Returns
    -------
    control.FrequencyResponseData
    """
    return control.FrequencyResponseData(
        np.asarray(system.frdata)[np.ix_(outputs, inputs)],
        system.omega,
        inputs=[system.input_labels[i] for i in inputs],
        outputs=[system.output_labels[i] for i in outputs],
    )


def finite(argument: str, system: control.FrequencyResponseData) -> control.FrequencyResponseData:
    """Return a response whose lines and values are all finite."""
    if not (np.isfinite(system.omega).all() and np.isfinite(system.frdata).all()):
        shown = described("a response with values that are not finite")
        raise invalid(argument, shown, "finite values", "Leave out those lines.")
    return system


def between_lines(system: control.FrequencyResponseData, omega: Vector) -> AnyArray:
    """Return a measured response at other frequencies, drawn straight between its lines.

    Parameters
    ----------
    system : control.FrequencyResponseData
    omega : ndarray, shape (k,)
        In rad/s, from the first of the lines to the last.

    Returns
    -------
    ndarray of complex, shape (k, outputs, inputs)

    Raises
    ------
    InvalidInputError
        If a frequency lies beyond the lines: nothing is known there.
    """
    order = np.argsort(system.omega)
    lines, values = np.asarray(system.omega)[order], np.asarray(system.frdata)[..., order]
    room = 1e-9 * lines[-1]  # hertz to rad/s and back
    if omega.size and not (lines[0] - room <= omega.min() and omega.max() <= lines[-1] + room):
        hertz = (lines[0] / (2 * np.pi), lines[-1] / (2 * np.pi))
        raise invalid(
            "frequency",
            described(f"{omega.min() / (2 * np.pi):.6g} to {omega.max() / (2 * np.pi):.6g} Hz"),
            f"frequencies within those measured, {hertz[0]:.6g} to {hertz[1]:.6g} Hz",
            "Measure there, or fit a model.",
        )
    found = np.empty((omega.size, *values.shape[:2]), dtype=complex)
    for i, j in np.ndindex(*values.shape[:2]):
        found[:, i, j] = np.interp(omega, lines, values[i, j])
    return found
