"""Simulation of a machine, its effects included, with the sampled controller that runs it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import control
import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from robustpolish.base.arrays import Array, Matrix, Vector
from robustpolish.base.checks import described, instance_of, invalid, misfit, one_of, whole_number
from robustpolish.errors import InvalidInputError, SolverError
from robustpolish.implementation.realization import anti_windup
from robustpolish.implementation.run import disturbance_columns
from robustpolish.implementation.sampled_design import SampledDesign
from robustpolish.machines.mechanical.feedback import Feedback, feedback_of, limits_of
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import DISPLACEMENT, VELOCITY, Input, Output
from robustpolish.machines.simulation import needed_substeps, simulate_model
from robustpolish.synthesis.design import Design

Controller = Feedback | Sequence[Feedback] | SampledDesign | control.StateSpace | None

LOAD = "load_"
"""Before the name of an input that a controller drives: a load in the same place."""
REFERENCE = "reference_"
"""Before the name of an output: what it shall be, for controllers that name no references."""


def in_loop(machine: MechanicalModel, controller: Any, asked: Sequence[str]) -> MechanicalModel:
    """Return a machine in the loop of a controller, its references named.

    Parameters
    ----------
    machine : MechanicalModel
        Its own feedback stays if there is no controller.
    controller : Feedback, sequence of Feedback, SampledDesign, control.StateSpace or None
    asked : sequence of str
        Outputs with a reference.

    Raises
    ------
    InvalidInputError
        If the controller is continuous, or sees or drives what the machine has not.
    """
    controller = getattr(controller, "sampled", controller)  # of a designed machine
    if controller is None:
        return machine
    if isinstance(controller, Feedback):
        return replace(machine, feedback=(controller,))
    if isinstance(controller, Sequence):
        return replace(machine, feedback=tuple(controller))
    more: dict[str, Any] = {}
    if isinstance(controller, SampledDesign):
        K = controller.controller
        limit = limits_of(controller.plant, K.output_labels)
        more = {"delay": controller.delay, "limit": limit}
        more["anti_windup"] = anti_windup(K, "auto").L if limit and K.nstates else True
    else:
        K = getattr(controller, "controller", controller)
    instance_of("controller", K, control.StateSpace, "a Feedback or a SampledDesign", _SAMPLE)
    if isinstance(controller, Design) or not K.dt or K.dt is True:
        shown = described("a continuous controller")
        raise invalid("controller", shown, "one with a sampling period", _SAMPLE)
    loop = feedback_of(K, {name: f"{REFERENCE}{name}" for name in asked}, **more)
    outputs = [_output(machine, term.of) for term in loop.terms]
    inputs = [_input(machine, name) for name in loop.drives]
    return replace(
        machine,
        outputs=(*machine.outputs, *(o for o in outputs if o.name not in machine.output_names)),
        inputs=(*machine.inputs, *(i for i in inputs if i.name not in machine.input_names)),
        feedback=(loop,),
    )


_SAMPLE = "Sample a design with .discretize(period, delay=)."


def _output(machine: MechanicalModel, name: str) -> Output:
    """Return the output, coordinate or velocity that a controller sees by this name."""
    known = {output.name: output for output in machine.outputs}
    for coordinate in machine.free:
        known.setdefault(coordinate, Output(coordinate, (coordinate, "ground"), DISPLACEMENT))
        for rate in (f"d{coordinate}", f"{coordinate}_dot"):
            known.setdefault(rate, Output(rate, (coordinate, "ground"), VELOCITY))
    return known[one_of("controller", name, known, "Name its measurements as the outputs are.")]


def _input(machine: MechanicalModel, name: str) -> Input:
    """Return the input that a controller drives by this name, or a force on a coordinate."""
    known = {item.name: item for item in machine.inputs}
    for coordinate in machine.free:
        known.setdefault(f"u_{coordinate}", Input(f"u_{coordinate}", (coordinate, "ground")))
    return known[one_of("controller", name, known, "Name its controls as the inputs are.")]


def simulate_machine(
    machine: MechanicalModel,
    controller: Controller = None,
    load: xr.Dataset | None = None,
    reference: xr.Dataset | None = None,
    initial_state: ArrayLike | None = None,
) -> xr.Dataset:
    """Simulate a machine with its controller; see :func:`robustpolish.simulate`."""
    asked = [] if reference is None else [str(name) for name in reference.data_vars]
    model = in_loop(machine, controller, asked)
    beside = [
        i for i in model.inputs if i.name in model.driven and load is not None and i.name in load
    ]
    pushed = (replace(item, name=f"{LOAD}{item.name}") for item in beside)
    model = replace(model, inputs=(*model.inputs, *pushed))
    units = {item.name: model.unit_of(item) for item in model.inputs}
    given = []
    for what, source, prefix in (("load", load, LOAD), ("reference", reference, REFERENCE)):
        if source is not None:
            known = {n: f"{prefix}{n}" for n in source.data_vars if f"{prefix}{n}" in model.columns}
            given.append(disturbance_columns(source.rename(known), model.columns, units, what))
    if not given:
        shown = described("neither load nor reference")
        raise invalid("load", shown, "something that moves the machine", "Give one of them.")
    time = _grid(model, given[0][0])
    over = xr.Dataset({}, {"time": time})
    for i, name in enumerate(model.columns):
        over[name] = ("time", sum(np.interp(time, at, part[:, i]) for at, part in given))
    with np.errstate(all="ignore"):
        found = simulate_model(model, over, initial_state)
    lost = np.flatnonzero(~np.isfinite(found.outputs).all(axis=1))
    if lost.size:
        raise SolverError(
            f"controller: the loop diverges after {time[lost[0]] - time[0]:.4g} s. Check the signs "
            "of its gains (u = K y, gains times reference - output), its period and its delay."
        )
    result: dict[str, Any] = {
        item.name: ("time", column, {"units": model.unit_of(item)})
        for item, column in zip(model.outputs, found.outputs.T, strict=True)
    }
    commands = [(loop, i) for loop in model.feedback for i in range(len(loop.drives))]
    for (loop, i), column in zip(commands, found.commands.T, strict=True):
        name, (low, high) = loop.drives[i], loop.bounds[:, i]
        share = float(np.mean((column <= low) | (column >= high)))
        result[name] = ("time", column, {"units": units.get(name, ""), "at_limit": share})
    result |= {name: over[name] for name in model.references}
    return xr.Dataset(result, {"time": ("time", time, {"units": "s"})})


def _grid(model: MechanicalModel, time: Array) -> Array:
    """Return times, or as fine ones that suit the periods of controllers."""
    if time.size < 2:
        raise misfit("time", "a single sample", "two or more", "Simulate a longer time.")
    step = float(np.min(np.diff(time)))
    even = np.ptp(np.diff(time)) <= 1e-6 * step
    if even:
        try:
            needed_substeps(model, (time[-1] - time[0]) / (time.size - 1), 0.0)
            return time
        except InvalidInputError:
            pass
    period = min((loop.period for loop in model.feedback), default=step)
    step = period / max(1, math.ceil(period / step - 1e-6))
    return time[0] + step * np.arange(math.floor((time[-1] - time[0]) / step + 1e-6) + 1)


# Parameter samples from the covariance of a fit.

# Beyond this share of draws of the wrong sign the truncated distribution is not that of the fit.
_MOST_REDRAWN = 0.5


def draw(
    model: MechanicalModel, keys: tuple[str, ...], covariance: Matrix, samples: int, seed: int
) -> tuple[tuple[str, ...], Matrix, Vector, tuple[str, ...]]:
    """Draw numbers of a model.

    A draw in which a mass, a stiffness or a damping changes its sign is no machine of this kind and
    is drawn again.

    Parameters
    ----------
    model : MechanicalModel
    keys : tuple of str
        Of the uncertain numbers.
    covariance : ndarray, shape (keys, keys)
        Infinite or NaN on the diagonal where nothing is known.
    samples, seed : int

    Returns
    -------
    keys : tuple of str
    values : ndarray, shape (samples, keys)
    nominal : ndarray, shape (keys,)
    left_out : tuple of str
        Keys whose error is not known; they keep their value.
    """
    whole_number("samples", samples, 1, remedy="Ask for 200 machines.")
    variances = np.diag(covariance)
    if np.any(variances < 0):
        raise misfit("standard_errors", "a negative variance", "errors of at least 0", "Check it.")
    known = np.isfinite(variances)
    used, left_out = (
        tuple(key for key, here in zip(keys, known == kind, strict=True) if here)
        for kind in (True, False)
    )
    if not used:
        shown = described("no number with a known error")
        remedy = "Pass standard_errors, or fit to data that determines the numbers."
        raise invalid("learned", shown, "a fit with standard errors", remedy)
    nominal = np.array([model.parameters[key] for key in used])
    # A square root of the covariance of numbers of very different size.
    size = np.sqrt(variances[known])
    safe = np.where(size > 0, size, 1.0)
    eigen, vectors = np.linalg.eigh(covariance[known][:, known] / np.outer(safe, safe))
    root = safe[:, None] * vectors * np.sqrt(np.maximum(eigen, 0.0))
    sign = np.array([0.0 if key.startswith(("effect", "input")) else 1.0 for key in used])
    sign *= np.sign(nominal)
    rng = np.random.default_rng(seed)
    values = nominal + rng.standard_normal((samples, len(used))) @ root.T
    again = np.flatnonzero(np.any(values * sign < 0, axis=1))
    if again.size <= _MOST_REDRAWN * samples:
        while again.size:
            values[again] = nominal + rng.standard_normal((again.size, len(used))) @ root.T
            again = again[np.any(values[again] * sign < 0, axis=1)]
        return used, values, nominal, left_out
    worst = used[int(np.argmax(np.linalg.norm(root, axis=1) / np.maximum(abs(nominal), 1e-300)))]
    shown, want = f"an error of {worst} as large as its value", "smaller errors"
    raise misfit("standard_errors", shown, want, "Hold the number fixed, or measure it better.")


def uncertain_numbers(
    learned: Any, standard_errors: Mapping[str, float] | None
) -> tuple[MechanicalModel, tuple[str, ...], NDArray[np.float64]]:
    """Return the model, the keys of its uncertain numbers, and their covariance."""
    model = learned if isinstance(learned, MechanicalModel) else getattr(learned, "model", None)
    if not isinstance(model, MechanicalModel):
        shown = described(type(learned).__name__)
        raise invalid("learned", shown, "a diagnosis, a refit or a model", "Pass one of these.")
    if standard_errors is not None:
        for key in standard_errors:
            if key not in model.parameters:
                want = "a key of model.parameters"
                raise invalid("standard_errors", key, want, "Check its spelling.")
        errors = np.array([float(error) for error in standard_errors.values()])
        return model, tuple(standard_errors), np.diag(errors**2)
    covariance = getattr(learned, "covariance", None)
    if covariance is None:
        want = "errors for a model without a fit"
        raise invalid("standard_errors", None, want, "Pass a mapping by key.")
    keys = tuple(str(key) for key in covariance[covariance.dims[0]].values)
    return model, keys, np.asarray(covariance.values, dtype=float)
