"""Numbers and noise that a diagnosis states, beside the true ones.

The integrator of the cases and the package write some laws in other numbers; `TRUTH` translates,
for effects that are named right. In most the numbers are the same, in their order:

===========================  ======================================================================
coulomb_friction             force; its width is given to fits, not found by them
stribeck_friction            force, static force, velocity
elastic_coulomb_friction     force, stiffness
lugre_friction               force, static force, velocity, stiffness
bouc_wen_hysteresis          k, y, n of z' = (v - (|v| |z|^(n-1) z + v |z|^n) / 2) / y, force k y z;
                             the package gives stiffness k, exponent n, and beta = gamma =
                             1/2 (F / (k y))^n, where F is the force that it refers them to
backlash                     gap; the stiffness is that of the spring that is there
harmonic_force               amplitude, frequency in Hz instead of rad/s, cosine instead of sine
unbalance, parametric_...    size and phase, the frequency is known
input_delay                  delay; an input that is held between samples lags half a sample more,
                             which is a part of the delay where the model does not know of the hold
===========================  ======================================================================

Phases are those at the first sample, while integrators begin before the warm-up. A place written
the other way round turns the sign of what is odd. Where no force is known (a free decay, or a gain
of the only input), a model's forces, masses and springs have the unit of its heaviest mass: truth
is told in that unit. Where the gain of an input stands for that of a sensor, or all sensors have
gains, other units differ, too: such numbers are not compared.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from robustpolish.identification.fit.parameters import scale_fixing_masses

from .cases import model_of
from .judge import normal

SIGMAS = 1.96


class Stated(NamedTuple):
    """A number with its standard error, and the true one."""

    name: str
    truth: float
    value: float
    stderr: float

    @property
    def covered(self):
        """Whether the 95 % interval holds the truth."""
        return abs(self.value - self.truth) <= SIGMAS * self.stderr


def effect_numbers(case, diagnosis):
    """Return the fitted numbers of all effects that are named right."""
    if _other_gains(case, diagnosis):
        return []
    begin = case.warm_up * case.machine.dt
    units = units_of_case(case, diagnosis)
    stated = []
    for kind, at, p in case.effects:
        found = next(
            (e for e in diagnosis.effects if normal(e.kind, e.at) == normal(kind, at)), None
        )
        if found is None:
            continue
        unit = unit_at(units, at)
        forces = {p.name for p in found.definition.parameters if {"F", "M"} & set(p.dimension)} | (
            {"gain"} if kind == "input_gain" else set()
        )
        values = {
            name: v.value / (unit if name in forces else 1.0)
            for name, v in found.parameters.items()
        }
        truth = TRUTH[kind](p, values, begin)
        if kind == "input_delay" and case.held and not _knows_hold(diagnosis.model, at):
            truth["delay"] += case.machine.dt / 2
        if tuple(found.at) != tuple(at):
            truth = _turned(kind, truth)
        for parameter in found.definition.parameters:
            name = parameter.name
            if not parameter.fitted or name not in truth or name not in found.parameters:
                continue
            given = found.parameters[name]
            true = truth[name] * (unit if name in forces else 1.0)
            if name == "phase":
                true = given.value + np.angle(np.exp(1j * (true - given.value)))
            stated.append(_stated(f"{kind}.{name}", true, given))
    return _determined(stated)


def own_numbers(case, diagnosis):
    """Return the fitted masses, springs and dampers of the model."""
    if _other_gains(case, diagnosis):
        return []
    true_model = model_of(replace(case, wrong={}))
    units = units_of_case(case, diagnosis)
    places = {".".join(dof.key): (dof.name,) for dof in true_model.dofs}
    places |= {f"spring[{i}].stiffness": s.between for i, s in enumerate(true_model.springs)}
    places |= {f"damper[{i}].damping": d.between for i, d in enumerate(true_model.dampers)}
    truth = true_model.parameters
    stated = [
        _stated(key, truth[key] * unit_at(units, places[key]), given)
        for key, given in diagnosis.parameters.items()
        if key in places
    ]
    return _determined(stated)


def floor_ratios(data, noise, diagnosis):
    """Return the stated noise of each sensor over the true one."""
    stated = diagnosis.noise_floor
    return {name: float(stated[name] * np.std(data[name].values) / noise[name]) for name in noise}


def _stated(name, truth, given):
    return Stated(name, float(truth), float(given.value), float(given.stderr))


def _determined(stated):
    """Leave out what a fit held, and what it says to be open."""
    return [s for s in stated if 0 < s.stderr < np.inf]


def _other_gains(case, diagnosis):
    """Return whether gains were named that are not those of the truth, or of all that is seen."""
    gains = ("input_gain", "sensor_gain")
    true = {normal(kind, at) for kind, at, _ in case.effects if kind in gains}
    found = {normal(e.kind, e.at) for e in diagnosis.effects if e.kind in gains}
    sensors = {at for kind, at in found if kind == "sensor_gain"}
    return true != found or len(sensors) == len(case.machine.measured)


def units_of_case(case, diagnosis):
    """Return the unit of force over the true one for each coordinate."""
    masses = dict(zip(case.machine.names, case.machine.mass, strict=True))
    return {
        name: diagnosis.model.dof(heaviest).mass / masses[heaviest]
        for heaviest, chain in scale_fixing_masses(diagnosis.model).items()
        for name in chain
    }


def unit_at(units, at):
    """Return the unit at a place; an input is called as the coordinate it pushes."""
    return next((units[name] for name in (n.removeprefix("F_") for n in at) if name in units), 1.0)


def _knows_hold(model, at):
    """Return whether a model holds an input between samples."""
    holds = (e for e in model.effects if e.kind == "input_hold" and tuple(e.at) == tuple(at))
    return any(effect.values["order"] == 0.0 for effect in holds)


def _turned(kind, truth):
    """Return the numbers of an effect at the same place written the other way round."""
    odd = {
        "quadratic_stiffness": ("stiffness",),
        "contact_stop": ("gap",),
        "gyroscopic_coupling": ("coefficient",),
    }
    if kind == "cross_stiffness":
        return {"stiffness_xy": truth["stiffness_yx"], "stiffness_yx": truth["stiffness_xy"]}
    if kind == "unbalance":  # from the second axis it turns backwards, a quarter of a turn ahead
        return {"unbalance": truth["unbalance"], "phase": truth["phase"] - np.pi / 2}
    return {name: -x if name in odd.get(kind, ()) else x for name, x in truth.items()}


def _same(*names):
    return lambda p, found, begin: dict(zip(names, p, strict=False))


def _bouc_wen(p, found, begin):
    stiffness, yields, exponent = p
    share = 0.5 * (found["force"] / (stiffness * yields)) ** exponent
    return {"stiffness": stiffness, "exponent": exponent, "beta": share, "gamma": share}


def _harmonic(p, found, begin):
    amplitude, omega, phase = p
    at_first_sample = phase + omega * begin - np.pi / 2
    return {"amplitude": amplitude, "frequency": omega / (2 * np.pi), "phase": at_first_sample}


def _spinning(size):
    return lambda p, found, begin: {size: p[0], "phase": p[2] + p[1] * begin}


TRUTH = {
    "coulomb_friction": _same("force"),
    "stribeck_friction": _same("force", "static_force", "velocity"),
    "elastic_coulomb_friction": _same("force", "stiffness"),
    "lugre_friction": _same("force", "static_force", "velocity", "stiffness"),
    "bouc_wen_hysteresis": _bouc_wen,
    "quadratic_damping": _same("coefficient"),
    "displacement_dependent_damping": _same("coefficient"),
    "cubic_stiffness": _same("stiffness"),
    "quadratic_stiffness": _same("stiffness"),
    "backlash": _same("gap"),
    "contact_stop": _same("gap", "stiffness"),
    "pendulum_gravity": _same("moment"),
    "constant_force": _same("force"),
    "harmonic_force": _harmonic,
    "unbalance": _spinning("unbalance"),
    "parametric_stiffness": _spinning("amplitude"),
    "gyroscopic_coupling": _same("coefficient"),
    "cross_stiffness": _same("stiffness_xy", "stiffness_yx"),
    "attached_resonator": _same("mass", "stiffness", "damping"),
    "input_delay": _same("delay"),
    "input_lag": _same("lag"),
    "input_saturation": _same("limit"),
    "input_dead_zone": _same("width"),
    "maxwell_element": _same("stiffness", "time"),
    "input_gain": _same("gain"),
    "sensor_gain": _same("gain"),
    "sensor_offset": _same("offset"),
}
