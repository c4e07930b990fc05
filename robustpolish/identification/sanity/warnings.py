"""Everything that looks wrong about a record and a model, in plain sentences."""

from __future__ import annotations

import numpy as np
import xarray as xr

from robustpolish.identification.sanity.agreement import amplitudes, exchanged, means, signs
from robustpolish.identification.sanity.channels import clipping, dropouts, no_motion
from robustpolish.identification.sanity.gains import coherent_gain
from robustpolish.identification.sanity.limits import LIMITS
from robustpolish.identification.sanity.moved import moved_numbers
from robustpolish.measurements import sampling_time
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.parts import ACCELERATION, FORCE, Output
from robustpolish.simulation.run import simulate


def sanity_warnings(
    model: MechanicalModel,
    data: xr.Dataset,
    simulated: xr.Dataset | None = None,
    fitted: MechanicalModel | None = None,
) -> tuple[str, ...]:
    """Say what an engineer would about a record, a model and its fit before believing them.

    Parameters
    ----------
    model : MechanicalModel
        As it was given.
    data : xarray.Dataset
        Checked inputs and outputs of the model over ``time``, see
        :func:`robustpolish.identification.record.checked_data`.
    simulated : xarray.Dataset, optional
        The model's outputs over the same time, in a free run.
    fitted : MechanicalModel, optional
        The model with its numbers fitted.

    Returns
    -------
    tuple of str
        A sentence for each suspicion: the channel, what was seen, and what to do. Empty for
        most records.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> import robustpolish as rp
    >>> model = rp.MechanicalModel(
    ...     [rp.Dof("x", 1.0)],
    ...     [rp.Spring(("x", "ground"), 4.0)],
    ...     outputs=[rp.Output("x", ("x", "ground"))],
    ... )
    >>> time = np.arange(1000) * 0.01
    >>> clipped = np.clip(np.cos(2 * time), -0.8, 0.8)
    >>> data = xr.Dataset({"x": ("time", clipped, {"units": "m"})}, {"time": time})
    >>> [sentence[:37] for sentence in sanity_warnings(model, data)]
    ['x sticks at its extremes in 7 places ']
    """
    found: list[str] = []
    time = np.asarray(data["time"].values, dtype=float)
    measured = {item.name: np.asarray(data[item.name].values, float) for item in model.outputs}
    for item in model.outputs:
        found += _of_channel(item, measured[item.name], time)
    if time.size >= LIMITS.least:
        found += _of_inputs(model, data, measured)
    if simulated is not None:
        found += _of_run(model, measured, simulated)
    if fitted is not None:
        found += moved_numbers(model.parameters, fitted.parameters)
    return tuple(found)


def _of_channel(item: Output, values: np.ndarray, time: np.ndarray) -> list[str]:
    found = [clipping(item.name, values)]
    # A mass that friction holds has an acceleration that is constant, and jumps when it breaks
    # loose; a force may do both in contacts.
    if item.quantity not in (ACCELERATION, FORCE):
        found += [dropouts(item.name, values, time), no_motion(item.name, values)]
    return [sentence for sentence in found if sentence]


def _of_run(
    model: MechanicalModel, measured: dict[str, np.ndarray], simulated: xr.Dataset
) -> list[str]:
    runs = {name: np.asarray(simulated[name].values, dtype=float) for name in measured}
    if not all(np.isfinite(run).all() for run in runs.values()):
        return []
    units = {item.name: model.unit_of(item) for item in model.outputs}
    return means(measured, runs, units) if _rests(model) else []


def _of_inputs(
    model: MechanicalModel, data: xr.Dataset, measured: dict[str, np.ndarray]
) -> list[str]:
    """Compare with what the inputs make of the model at rest, however the record starts."""
    moving = [name for name in model.input_names if np.ptp(np.asarray(data[name].values)) > 0]
    if not moving:
        return []
    with np.errstate(all="ignore"):
        forced = simulate(model, data).outputs
    if not np.isfinite(forced).all():
        return []
    dt = sampling_time(data)
    gains = {
        (first, second.name): coherent_gain(forced[:, i], values, dt)
        for first, values in measured.items()
        for i, second in enumerate(model.outputs)
    }
    own = {name: gains[name, name] for name in measured}
    kinds = {item.name: f"{item.quantity} in {model.unit_of(item)}" for item in model.outputs}
    swapped = exchanged(gains, kinds)
    return swapped or [*amplitudes(own, moving), *signs(own)]


def _rests(model: MechanicalModel) -> bool:
    """Whether springs hold every coordinate, so that the model has a place of rest."""
    if not model.free:
        return False
    poles = np.linalg.eigvals(model.matrices.first_order()[0])
    largest = float(np.max(np.abs(poles), initial=0.0))
    return bool(np.min(np.abs(poles)) > 1e-6 * largest)
