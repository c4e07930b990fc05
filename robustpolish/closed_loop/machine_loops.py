"""Simulation of a machine, its effects included, with the sampled controller that runs it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import control
import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from robustpolish.base.arrays import Array
from robustpolish.base.checks import described, instance_of, invalid, misfit, one_of, whole_number
from robustpolish.errors import InvalidInputError, SolverError
from robustpolish.implementation.realization import anti_windup
from robustpolish.implementation.sampled_design import SampledDesign
from robustpolish.machines.loop import references
from robustpolish.machines.mechanical.feedback import Feedback, feedback_of, limits_of
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import DISPLACEMENT, VELOCITY, Input, Output
from robustpolish.machines.simulation import needed_substeps, simulate_model
from robustpolish.synthesis.design import Design

if TYPE_CHECKING:
    from robustpolish.identification.fit.result import Refit

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
    given = [data for data in (load, reference) if data is not None]
    if not given:
        shown = described("neither load nor reference")
        raise invalid("load", shown, "something that moves the machine", "Give one of them.")
    for name, data in (("load", load), ("reference", reference)):
        if data is not None and (not isinstance(data, xr.Dataset) or "time" not in data.coords):
            remedy = "Build an xarray.Dataset with a variable per signal."
            raise misfit(name, type(data).__name__, "samples over 'time', in s", remedy)
    asked = [] if reference is None else [str(name) for name in reference.data_vars]
    model = in_loop(machine, controller, asked)
    pushed = [
        item for item in model.inputs if item.name in model.driven and item.name in (load or {})
    ]
    beside = tuple(replace(item, name=f"{LOAD}{item.name}") for item in pushed)
    model = replace(model, inputs=(*model.inputs, *beside))
    names = [*model.columns]
    time = _grid(model, given[0])
    data = {name: np.zeros(time.size) for name in names}
    known = set()
    for given_data, prefixes in ((load, ("", LOAD)), (reference, ("", REFERENCE))):
        for name, column in ({} if given_data is None else given_data.data_vars).items():
            for own in (f"{prefix}{name}" for prefix in prefixes):
                if own in data and own not in known:
                    data[own] = np.interp(time, given_data["time"].values, column.values)
                    known.add(own)
    if not known:
        shown = described(f"variables {', '.join(str(n) for d in given for n in d.data_vars)}")
        expected = f"one or several of {', '.join(map(repr, names))}"
        raise invalid("load", shown, expected, "Rename them; what is left out is zero.")
    over = xr.Dataset({name: ("time", column) for name, column in data.items()}, {"time": time})
    with np.errstate(all="ignore"):
        found = simulate_model(model, over, initial_state)
    lost = np.flatnonzero(~np.isfinite(found.outputs).all(axis=1))
    if lost.size:
        raise SolverError(
            f"controller: the loop diverges after {time[lost[0]] - time[0]:.4g} s. Check the signs "
            "of its gains (u = K y, gains times reference - output), its period and its delay."
        )
    result = {
        item.name: ("time", column, {"units": model.unit_of(item)})
        for item, column in zip(model.outputs, found.outputs.T, strict=True)
    }
    units = {item.name: model.unit_of(item) for item in model.inputs}
    commands = [(loop, i) for loop in model.feedback for i in range(len(loop.drives))]
    for (loop, i), column in zip(commands, found.commands.T, strict=True):
        name, (low, high) = loop.drives[i], loop.bounds[:, i]
        share = float(np.mean((column <= low) | (column >= high)))
        result[name] = ("time", column, {"units": units.get(name, ""), "at_limit": share})
    result |= {name: ("time", data[name]) for name in references(model)}
    return xr.Dataset(result, {"time": ("time", time, {"units": "s"})})


def _grid(model: MechanicalModel, data: xr.Dataset) -> Array:
    """Return the times of data, or as fine ones that suit the periods of controllers."""
    time = np.asarray(data["time"].values, dtype=float)
    if time.size < 2 or not np.isfinite(time).all() or np.any(np.diff(time) <= 0):
        raise misfit("time", "its samples", "two or more, rising", "Sort them.")
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


def machines_of_fit(fitted: Refit, samples: int, seed: int) -> Iterator[MechanicalModel]:
    """Yield machines with the numbers of a fit, drawn from the normal distribution of their errors.

    What would turn the sign of a number that has one, or make no machine, is drawn again.

    Parameters
    ----------
    fitted : Refit
    samples, seed : int

    Raises
    ------
    InvalidInputError
        If the fit says so little that hardly any draw is a machine.
    """
    from robustpolish.identification.fit.result import Refit as Fit  # imports lmfit

    instance_of("fit", fitted, Fit, "a Refit", "Pass what rp.refit(...) returned.")
    whole_number("samples", samples, 1)
    covariance = fitted.covariance
    told = np.isfinite(np.diag(covariance.values))
    keys = [str(key) for key in covariance["parameter"].values[told]]
    centre = np.array([fitted.model.parameters[key] for key in keys])
    block = covariance.values[np.ix_(told, told)]
    size = np.sqrt(np.diag(block))
    unit = np.outer(size, size)
    values, vectors = np.linalg.eigh(
        np.divide(block, unit, where=unit > 0, out=np.zeros_like(unit))
    )
    root = size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    rng, found = np.random.default_rng(seed), 0
    for _ in range(100 * samples):
        drawn = centre + root @ rng.standard_normal(centre.size)
        if np.any(drawn * centre < 0):
            continue
        try:
            machine = fitted.model.with_parameters(dict(zip(keys, drawn.tolist(), strict=True)))
        except InvalidInputError:
            continue
        yield machine
        found += 1
        if found == samples:
            return
    shown = described(f"standard errors with which {found} of {100 * samples} draws are machines")
    raise invalid("fit", shown, "numbers that the data determine", "Measure more, or hold some.")
