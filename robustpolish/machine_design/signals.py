"""A machine as a plant, its signals chosen by the names that users have for them."""

from __future__ import annotations

from collections.abc import Sequence

import control
import numpy as np

from robustpolish.arrays import Matrix
from robustpolish.models import GeneralizedPlant, MechanicalModel
from robustpolish.validation import described, invalid, spelled

Names = Sequence[str]
CONTROL, MEASUREMENT, DISTURBANCE = "u_", "measured_", "disturbance_"
"""What the package puts before the names of coordinates and outputs."""


def machine_plant(
    machine: MechanicalModel | GeneralizedPlant,
    controls: Names,
    measurements: Names,
    performance: Names,
    disturbances: Names,
) -> GeneralizedPlant:
    """Return the plant with the signals of these names; where none are given, with all.

    Parameters
    ----------
    machine : MechanicalModel or GeneralizedPlant
        Effects of a model are linearised about rest.
    controls : sequence of str
        Inputs of the model, or coordinates that a force acts on; controls of a plant.
    measurements : sequence of str
        Outputs of the model, coordinates (``x``) or velocities (``dx``); measurements of a plant.
    performance : sequence of str
        Coordinates, velocities or outputs; performance outputs or measurements of a plant.
    disturbances : sequence of str
        Inputs, or coordinates that a force acts on; disturbances or controls of a plant. All
        inputs that are no controls by default; the controls' places if nothing is left.

    Returns
    -------
    GeneralizedPlant

    Raises
    ------
    InvalidInputError
        If there is no such signal; it names the nearest.
    """
    if isinstance(machine, MechanicalModel):
        plant, known = _of_model(machine, controls, disturbances), len(machine.outputs)
        performance = performance or machine.free
        measurements = measurements or plant.measurement_names[:known]
    else:
        plant = machine
        if not isinstance(plant.system, control.StateSpace):
            shown = described("a frequency response")
            raise invalid("machine", shown, "a model with states", "Fit one to it first.")
    u = _places("controls", controls, plant.control_names, (CONTROL,))
    y = _places("measurements", measurements, plant.measurement_names, (MEASUREMENT,))
    acting, inputs = plant.control_names, plant.disturbance_names
    shown, heard = plant.performance_names, plant.measurement_names
    # Every control may disturb as well, and every measurement be judged.
    doubled = [DISTURBANCE + name.removeprefix(CONTROL) for name in acting]
    outputs = [f"output_{name.removeprefix(MEASUREMENT)}" for name in heard]
    wiring = plant.wiring.with_inputs_twice(doubled)
    wiring = wiring.with_performance(np.eye(plant.ny), np.zeros((plant.ny, plant.nu)), outputs)
    z = _places("performance", performance, (*shown, *heard), ("", MEASUREMENT), len(shown))
    if disturbances:
        candidates = (*inputs, *acting)
        at = _places("disturbances", disturbances, candidates, ("", CONTROL), len(inputs))
    else:
        own = range(len(inputs))
        at = list(own) if own else [len(inputs) + i for i in u]
    w = [i + plant.nu if i < len(inputs) else i - len(inputs) for i in at]
    units = dict(plant.units)
    units |= {new: units[old] for new, old in zip(doubled, acting, strict=True) if old in units}
    units |= {new: units[old] for new, old in zip(outputs, heard, strict=True) if old in units}
    chosen = wiring.chosen(w, u, z, y)
    there = {*chosen.system.input_labels, *chosen.system.output_labels, *chosen.states}
    return plant.rewired(chosen, units={name: units[name] for name in units if name in there})


def signal(argument: str, name: str, known: Names, *prefixes: str) -> str:
    """Return the plant's name of a signal that a user calls without its prefix.

    Raises
    ------
    InvalidInputError
        If none has the name, or two have it that differ in the prefix.
    """
    same = [f"{prefix}{name}" for prefix in prefixes if f"{prefix}{name}" in known]
    if len(same) > 1 and name not in known:
        shown = described(f"{name}, which may be {' or '.join(same)}")
        raise invalid((argument, name), shown, "one of both", "Write it out.")
    return known[_places(argument, [name], known, prefixes)[0]]


def _of_model(model: MechanicalModel, controls: Names, disturbances: Names) -> GeneralizedPlant:
    """Return the plant of a model with all that may be chosen: states are measured, too."""
    free, signals = model.free, model.matrices.signals
    _places("controls", controls, (*signals, *free), ("",), prefixed=(CONTROL,))
    _places("disturbances", disturbances, (*signals, *free), ("",), prefixed=(CONTROL,))
    if not controls:
        shown = described("none")
        want = f"names among {', '.join(dict.fromkeys((*signals, *free)))}"
        raise invalid("controls", shown, want, "Say what the controller acts on.")
    wanted = [name.removeprefix(CONTROL) if name not in signals else name for name in controls]
    pushes = [
        name.removeprefix(CONTROL)
        for name in disturbances
        if name not in signals and name.removeprefix(CONTROL) in free
    ]
    plant = model.linearize(list(dict.fromkeys([*wanted, *pushes])))
    heard = [f"{MEASUREMENT}{name}" for name in plant.states]
    more = [i for i, name in enumerate(heard) if name not in plant.measurement_names]
    none = np.zeros((len(more), plant.nw + plant.nu))
    D2: Matrix = np.vstack([np.hstack([plant.D21, plant.D22]), none])
    units = {heard[i]: plant.units[plant.states[i]] for i in more if plant.states[i] in plant.units}
    return plant.replace(
        C2=np.vstack([plant.C2, np.eye(plant.nx)[more]]),
        D21=D2[:, : plant.nw],
        D22=D2[:, plant.nw :],
        measurements=[*plant.measurement_names, *(heard[i] for i in more)],
        units=units,
    )


def _places(
    argument: str,
    names: Names,
    known: Names,
    prefixes: Names,
    first: int = 0,
    prefixed: Names = (),
) -> list[int]:
    """Return where names stand among those that are known; all, or the `first`, if none is given.

    A user may leave a prefix out; `prefixed` are those that only users write.
    """
    if isinstance(names, str):
        names = (names,)
    found = []
    for name in names:
        tries = [name, *(f"{prefix}{name}" for prefix in prefixes)]
        tries += [str(name).removeprefix(prefix) for prefix in prefixed]
        place = next((known.index(one) for one in tries if one in known), None)
        if place is None:
            short = [_bare(one, prefixes) for one in known]
            want = f"one of {', '.join(dict.fromkeys(short)) or 'none'}"
            raise invalid(argument, name, want, spelled(name, short))
        if place in found:
            shown = described(f"{name} twice")
            raise invalid(argument, shown, "different names", "Name each signal once.")
        found.append(place)
    return found or list(range(first or len(known)))


def _bare(name: str, prefixes: Names) -> str:
    for prefix in filter(None, prefixes):
        name = name.removeprefix(prefix)
    return name
