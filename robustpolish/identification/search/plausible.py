"""Whether an effect of a fitted model can be the answer: its signs, sizes, lines and numbers."""

from __future__ import annotations

import numpy as np

from robustpolish.identification.fit.least_squares import Fit, covariance_of
from robustpolish.identification.fit.result import stderr_from_covariance
from robustpolish.identification.record import Record, input_period, poles_of
from robustpolish.identification.refit import held_inputs
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.mechanical.model import MechanicalModel

DETERMINED = 0.5
"""Largest standard error of a size, as a share of it: what the data leave open is no finding."""
_HEAVY = 10.0
"""Times the mass of a machine from which what would hang on it is the ground."""
_FREQUENCY_SHIFT = 0.1
"""Share by which the frequency of a decay may shift with its amplitude."""
_UNEXPLAINED_DELAY = 0.75
"""Samples by which an input acts later than a linear one, that no hold explains."""
_LINE_STDERRS = 5.0
"""Standard errors from which a fitted frequency is none of the lines of the inputs."""


def implausible(fitted: Fit, index: int, record: Record, errors: dict[str, float]) -> str:
    """Say why an effect of a fitted model cannot be what is missing; empty if it can.

    Parameters
    ----------
    fitted : Fit
    index : int
        Where the effect stands.
    record : Record
    errors : dict of str to float
        Standard errors of the fit.

    Returns
    -------
    str
    """
    model = fitted.model
    effect = model.effects[index]
    lead = undetermined_parameter(fitted, index, errors)
    return (
        effect.definition.implausible(effect.values)
        or _outside_line(effect, model, record, errors.get(f"effect[{index}].{_line(effect)}"))
        or _short_delay(model, effect, record)
        or _heavy_mass(model, effect)
        or (f"its {lead} is not determined" if lead else "")
    )


def undetermined_parameter(fitted: Fit, index: int, errors: dict[str, float] | None = None) -> str:
    """Return the first size of an effect, if the data leave it open; empty if they do not.

    Parameters
    ----------
    fitted : Fit
    index : int
    errors : dict of str to float, optional
        Standard errors of the fit.
    """
    effect = fitted.model.effects[index]
    # of an input that is held, an accelerometer sees no difference until a delay comes to a sample
    if effect.definition.timing is not None:
        return ""
    if errors is None:
        errors = stderr_from_covariance(covariance_of(fitted))
    numbers = [p for p in effect.definition.parameters if p.fitted]
    # of a stop, the gap says where it is and the stiffness whether it is there
    sizes = [p for p in numbers if p.counts_force]
    signal = effect.definition.domain in ("input", "output")
    for lead in dict.fromkeys((*numbers[:1], *sizes[:1])):
        error = errors.get(f"effect[{index}].{lead.name}", 0.0)
        size = effect.values[lead.name] - (lead.default if signal else 0.0)  # a gain of 1 is none
        if not error < DETERMINED * abs(size):
            return lead.name
    return ""


def _short_delay(model: MechanicalModel, effect: Effect, record: Record) -> str:
    """Say whether an effect delays an input by less than a record can tell from a hold.

    A held input is half a sample late by itself. What is as near to that as to a whole sample no
    hold explains: a velocity that is the difference of two positions is late by half a sample, too.
    """
    if effect.definition.domain != "input":
        return ""
    held = effect.at[0] in held_inputs(model)
    for number in effect.definition.parameters:
        late = effect.values[number.name] if number.dimension == "T" else np.inf
        if late < (_UNEXPLAINED_DELAY - 0.5 * held) * record.dt:
            samples = late / record.dt
            return f"a {number.name} of {samples:.2g} samples is what its input does between them"
    return ""


def _heavy_mass(model: MechanicalModel, effect: Effect) -> str:
    """Say whether an effect hangs far more mass on a machine than that has.

    What cannot be moved is the ground: as a resonator it drifts for ever, as the offset of a sensor
    makes a motion seem to.
    """
    mass = effect.values.get("mass", 0.0) if effect.definition.swinging else 0.0
    known = sum(dof.mass for dof in model.dofs)
    if known > 0 and mass > _HEAVY * known:  # of a motion that is imposed none is known
        return f"a mass of {mass:.3g} kg is far more than the machine has"
    return ""


def _line(effect: Effect) -> str | None:
    return effect.definition.line


def _outside_line(
    effect: Effect, model: MechanicalModel, record: Record, error: float | None
) -> str:
    """Say whether a force from outside has a line that the motion has by itself.

    What depends on the motion repeats with the inputs, so such a line may be any law of motion. It
    is one of the inputs' lines if it is nearer than the record's length resolves, or than some
    standard errors of its frequency. Without inputs the motion has the lines of the modes.
    """
    name = _line(effect)
    if name is None:
        return ""
    frequency = effect.values[name]
    if not model.inputs and _has_mode_at(model, frequency, record):
        return "in a free decay the machine swings at this frequency by itself"
    inputs = record.signals(model)
    for part in record.parts:
        period = input_period(part.own(inputs), part.dt)
        turns = frequency * (period or np.nan)
        resolved = 0.5 / (part.samples * part.dt)
        near = min(resolved, _LINE_STDERRS * (np.inf if error is None else error))
        if period and abs(turns - round(turns)) <= near * period:
            return f"the inputs repeat every {period:.4g} s, and what they move has this line too"
    return ""


def _has_mode_at(model: MechanicalModel, frequency: float, record: Record) -> bool:
    """Return whether a model has a mode that its record cannot tell from a line."""
    poles = poles_of(model)
    apart = np.abs(np.abs(np.imag(poles)) / (2 * np.pi) - frequency)
    width = np.abs(np.real(poles)) / np.pi + 2 / (record.samples * record.dt)
    return bool(np.any(apart < np.maximum(width, _FREQUENCY_SHIFT * frequency)))
