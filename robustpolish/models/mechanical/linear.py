"""A mechanical model with its effects, linearised about a state of rest, for synthesis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from robustpolish.arrays import Matrix
from robustpolish.models.mechanical.data import MechanicalData
from robustpolish.models.mechanical.effect_slopes import (
    LinearEffects,
    add_timing,
    linear_effects,
    sensor_gains,
    signal_gains,
    with_effects,
)
from robustpolish.models.mechanical.parts import UNITS
from robustpolish.models.plant.plant import GeneralizedPlant
from robustpolish.validation import described, invalid, one_of


def linearize(
    model: MechanicalData,
    controls: Sequence[str] | None,
    actuation: Literal["force", "displacement"],
    measured: Literal["outputs", "state", "displacement"],
    operating_point: Mapping[str, float] | None,
) -> GeneralizedPlant:
    """Return the plant; see :meth:`MechanicalModel.linearize`."""
    one_of("actuation", actuation, ("force", "displacement"))
    one_of("measured", measured, ("outputs", "state", "displacement"))
    if not model.free:
        shown = described("a model whose whole motion is imposed")
        raise invalid("model", shown, "a free coordinate", "There is nothing to control.")
    m = model.matrices
    names, nf = model.free, len(model.free)
    effects = linear_effects(model, operating_point)
    A, B, C, D = with_effects(model, effects)
    disturbances = list(m.signals)
    pushes, chosen, B2, D22 = _controls(model, controls, actuation, A.shape[0], effects)
    B *= signal_gains(model)
    C, D, D22 = (sensor_gains(model)[:, None] * M for M in (C, D, D22))
    if chosen:
        taken = [disturbances.index(name) for name in chosen]
        B2, D22 = np.hstack([B[:, taken], B2]), np.hstack([D[:, taken], D22])
        keep = [i for i, name in enumerate(disturbances) if name not in chosen]
        B, D, disturbances = B[:, keep], D[:, keep], [disturbances[i] for i in keep]
    states = [*names, *(f"d{name}" for name in names), *effects.states]
    inputs = [*disturbances, *chosen]
    A, both, C, through, more = add_timing(
        model, inputs, A, np.hstack([B, B2]), C, np.hstack([D, D22])
    )
    nw = len(disturbances)
    states += more
    order = [i for k in range(nf) for i in (k, nf + k)] + list(range(2 * nf, len(states)))
    A, both, C = A[np.ix_(order, order)], both[order], C[:, order]
    states = [states[i] for i in order]
    position = np.zeros((nf, len(states)))
    position[range(nf), range(0, 2 * nf, 2)] = 1.0
    if measured != "outputs":
        C = np.eye(len(states)) if measured == "state" else position
        through = np.zeros((len(C), both.shape[1]))
        measurements = states if measured == "state" else list(names)
    else:
        measurements = list(model.output_names)
    if not len(C):
        measurements = []
    labels = [f"measured_{name}" for name in measurements]
    units = _units(model, states, labels, measured, actuation, pushes)
    return GeneralizedPlant.from_matrices(
        A,
        both[:, :nw],
        both[:, nw:],
        position,
        C,
        D21=through[:, :nw],
        D22=through[:, nw:],
        states=states,
        disturbances=disturbances,
        controls=[*chosen, *(f"u_{name}" for name in pushes)],
        performance=list(names),
        measurements=labels,
        units=units,
    )


def _controls(
    model: MechanicalData,
    controls: Sequence[str] | None,
    actuation: str,
    n: int,
    effects: LinearEffects,
) -> tuple[list[str], list[str], Matrix, Matrix]:
    """Return coordinates and inputs that are controls, and B2 and D22 of the former."""
    wanted = list(model.free) if controls is None else list(controls)
    signals = model.matrices.signals
    known = [*model.free, *signals]
    for name in wanted:
        if name not in known:
            raise invalid("controls", name, f"names among {', '.join(known)}", "Correct it.")
    chosen = [name for name in wanted if name in signals and name not in model.free]
    pushes = [name for name in wanted if name in model.free]
    m, nf = model.matrices, len(model.free)
    B2, D22 = np.zeros((n, len(pushes))), np.zeros((len(model.outputs), len(pushes)))
    for column, name in enumerate(pushes):
        row = model.free.index(name)
        if actuation == "displacement":
            B2[row, column] = 1.0
            continue
        B2[nf : 2 * nf, column] = m.inverse_mass[:, row]
        D22[:, column] = m.Sa[:, m.free] @ m.inverse_mass[:, row]
    return pushes, chosen, B2, D22


def _units(
    model: MechanicalData,
    states: Sequence[str],
    labels: Sequence[str],
    measured: str,
    actuation: str,
    pushes: Sequence[str],
) -> dict[str, str]:
    units: dict[str, str] = {}
    for name in model.free:
        kind = UNITS[model.dof(name).rotational]
        units |= {name: kind["displacement"], f"d{name}": kind["velocity"]}
        if name in pushes:
            units[f"u_{name}"] = kind["force" if actuation == "force" else "velocity"]
    if measured == "outputs":
        units |= {f"measured_{o.name}": model.unit_of(o) for o in model.outputs}
    else:
        units |= {f"measured_{name}": units[name] for name in states if name in units}
    for item in model.inputs:
        units.setdefault(item.name, model.unit_of(item))
    known = {*states, *labels, *model.matrices.signals, *model.free}
    known |= {f"u_{name}" for name in pushes}
    return {name: unit for name, unit in units.items() if name in known}
