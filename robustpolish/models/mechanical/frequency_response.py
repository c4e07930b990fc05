"""The response of a mechanical model over frequency, effects linearised about a state of rest."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from robustpolish.arrays import AnyArray, Array
from robustpolish.errors import RobustPolishWarning
from robustpolish.measurements import labelled_response, ratio_unit
from robustpolish.models.mechanical.data import MechanicalData
from robustpolish.models.mechanical.effect_slopes import (
    linear_effects,
    sensor_gains,
    signal_gains,
    signal_timing,
    with_effects,
)
from robustpolish.models.mechanical.parts import ACCELERATION, DISPLACEMENT, VELOCITY
from robustpolish.validation import described, invalid

_ORDER = {DISPLACEMENT: 0, VELOCITY: 1, ACCELERATION: 2}
_HELD = "input_hold"


def frequency_response(
    model: MechanicalData,
    frequency: ArrayLike,
    operating_point: Mapping[str, float] | None,
    sampling_time: float | None,
) -> xr.DataArray:
    """Return the response; see :meth:`MechanicalModel.frequency_response`."""
    lines = np.asarray(frequency, dtype=float)
    if lines.ndim != 1 or not np.isfinite(lines).all():
        shown = described(f"an array of shape {lines.shape}")
        raise invalid("frequency", shown, "finite numbers in Hz", "Pass a list of frequencies.")
    if not model.inputs or not model.outputs:
        shown = described("a model without inputs or outputs")
        raise invalid("model", shown, "one of each", "Say where it is driven and measured.")
    total, notes = response_values(model, lines, operating_point, sampling_time)
    units = [[ratio_unit(model.unit_of(o), model.unit_of(i)) for i in model.inputs]
             for o in model.outputs]  # fmt: skip
    return labelled_response(
        lines, total, model.output_names, model.input_names, units, notes=notes
    )


def response_values(
    model: MechanicalData,
    lines: Array,
    operating_point: Mapping[str, float] | None = None,
    sampling_time: float | None = None,
) -> tuple[AnyArray, list[str]]:
    """Return the response, shape (lines, outputs, inputs), and notes; nothing is checked."""
    system, notes = linear_system(model, operating_point)
    s = 2j * np.pi * lines
    values = _at(s, *system) * sensor_gains(model)[:, None] * signal_gains(model)
    values = values * signal_timing(model, s)[:, None, :]
    total = _over_inputs(model, values, s)
    total *= _holds(model, s, sampling_time, notes)[:, None, :]
    return total, notes


def linear_system(
    model: MechanicalData, operating_point: Mapping[str, float] | None = None
) -> tuple[tuple[Array, Array, Array, Array], list[str]]:
    """Return A, B, C, D from signals to outputs, and what of the effects has no linear part.

    What effects on signals do is not in it.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RobustPolishWarning)
        system = with_effects(model, linear_effects(model, operating_point))
    return system, list(dict.fromkeys(str(item.message) for item in caught))


def _at(s: AnyArray, A: Array, B: Array, C: Array, D: Array) -> AnyArray:
    """Return C (s - A)^-1 B + D, shape (lines, outputs, signals); NaN at an undamped pole."""
    pencil = s[:, None, None] * np.eye(len(A)) - A
    values = np.empty((s.size, *D.shape), dtype=complex)
    try:
        values[:] = C @ np.linalg.solve(pencil, B.astype(complex)[None]) + D
    except np.linalg.LinAlgError:  # a line right on an undamped pole, such as 0 Hz of a free mass
        for k in range(s.size):
            singular = np.linalg.cond(pencil[k]) > 1 / np.finfo(float).eps
            values[k] = np.nan if singular else C @ np.linalg.solve(pencil[k], B) + D
    return values


def _over_inputs(model: MechanicalData, values: AnyArray, s: AnyArray) -> AnyArray:
    """Put the signals of each input together: an imposed motion has its derivatives too."""
    m = model.matrices
    total = np.zeros((*values.shape[:2], len(model.inputs)), dtype=complex)
    forces = len(m.force_inputs)
    for j, item in enumerate(model.inputs):
        if item.imposes is None:
            total[..., j] = values[..., m.force_inputs.index(item.name)]
            continue
        coordinate = model.dof_names.index(item.on[0])
        for k, signal in enumerate(m.imposed_signals, forces):
            if signal.coordinate == coordinate:
                power = _ORDER[signal.quantity] - _ORDER[item.imposes]
                with np.errstate(divide="ignore", invalid="ignore"):
                    factor = s**power * (item.gain / signal.gain)
                total[..., j] += values[..., k] * factor[:, None]
    return total


def _holds(
    model: MechanicalData, s: AnyArray, sampling_time: float | None, notes: list[str]
) -> Array:
    """Return what holding an input between samples does to it, shape (lines, inputs)."""
    factors = np.ones((s.size, len(model.inputs)), dtype=complex)
    for effect in model.effects:
        if effect.kind != _HELD or effect.values["order"] == 3.0:
            continue
        if sampling_time is None:
            notes.append(f"{effect} left out: the sampling time is not known")
            continue
        half = np.imag(s) * sampling_time / 2
        kept = np.sinc(half / np.pi)
        zero_order = kept * np.exp(-1j * half)
        j = model.input_names.index(effect.at[0])
        factors[:, j] *= zero_order if effect.values["order"] == 0.0 else kept**2
    return factors
