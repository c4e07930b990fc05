"""The error by displacement and velocity at each place, and the missing force over both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.identification.comparison import Comparison
from robustpolish.identification.free_run import FreeRun
from robustpolish.identification.missing_force import motion_of
from robustpolish.identification.observed_motion import observed_motion
from robustpolish.identification.observer import force_sites
from robustpolish.identification.residual_shares import surface, value_shares
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.parts import FORCE, UNITS

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PlaceShares:
    """The error by the motion at one place.

    Attributes
    ----------
    at : (str, str)
        Two coordinates, or one and ``"ground"``.
    displacement, velocity : xarray.DataArray, shapes (output, displacement), (output, velocity)
        Share of each output's squared error by relative displacement and velocity.
    surface : xarray.Dataset
        Restoring-force surface: mean missing force on the first coordinate over displacement and
        velocity.
    observed : bool
        Whether motion and force were estimated from the measured outputs (by a smoother). If
        that could not be done the motion is the simulated one and the force unknown (NaN).
    """

    at: tuple[str, str]
    displacement: xr.DataArray
    velocity: xr.DataArray
    surface: xr.Dataset
    observed: bool


def place_shares(comparison: Comparison, residual: xr.Dataset, bins: int) -> dict[str, PlaceShares]:
    """Return the error by the motion at every coordinate and connection of the model.

    Parameters
    ----------
    comparison : Comparison
    residual : xarray.Dataset
        Its residual, which may begin later.
    bins : int

    Returns
    -------
    dict of str to PlaceShares
        By ``"x"`` for a coordinate and ``"x - x_m"`` for a connection.
    """
    model = comparison.model
    q, v, force, observed = _motion(comparison)
    skip = q.shape[1] - residual.sizes["time"]
    q, v, force = q[:, skip:], v[:, skip:], force[:, skip:]
    sites = force_sites(model)[0]
    result: dict[str, PlaceShares] = {}
    for at, row in _places(model):
        dq, dv = row @ q, row @ v
        if np.ptp(dq) == 0 or np.ptp(dv) == 0:
            continue
        pull = (sites @ row) @ force / float(row @ row)
        shown = surface(dq, dv, pull, bins)
        units = UNITS[model.dof(at[0]).rotational]
        shown["force"].attrs["units"] = units[FORCE]
        for dim in ("displacement", "velocity"):
            shown[dim].attrs["units"] = units[dim]
        result[at[0] if at[1] == "ground" else f"{at[0]} - {at[1]}"] = PlaceShares(
            at=at,
            displacement=value_shares(residual, dq, bins, "displacement"),
            velocity=value_shares(residual, dv, bins, "velocity"),
            surface=shown,
            observed=observed,
        )
    return result


def _motion(comparison: Comparison) -> tuple[Array, Array, Array, bool]:
    """Displacements, velocities and missing forces along the record, shape (rows, samples)."""
    model = comparison.model
    found = observed_motion(model, comparison.data)
    if found is not None:
        smoothed = found.smoothed
        return smoothed.q, smoothed.v, smoothed.force, True
    run = FreeRun(model, comparison.data)
    states = run.states(comparison.starts[0])[1]
    q, v = motion_of(model, np.nan_to_num(states), run.inputs)
    return q, v, np.full((len(force_sites(model)[0]), run.samples), np.nan), False


def _places(model: MechanicalModel) -> list[tuple[tuple[str, str], Array]]:
    """Every coordinate against ground, and every pair that something connects."""
    names = model.dof_names
    pairs = [(name, "ground") for name in names]
    connected = [s.between for s in model.springs] + [d.between for d in model.dampers]
    connected += [e.at for e in model.effects if e.definition.domain == "pair"]
    connected += [output.of for output in model.outputs]
    for ends in connected:
        if "ground" not in ends and not any(set(ends) == set(pair) for pair in pairs):
            pairs.append((ends[0], ends[1]))
    rows = []
    for pair in pairs:
        row = np.zeros(len(names))
        for name, sign in zip(pair, (1.0, -1.0), strict=True):
            if name in names:
                row[names.index(name)] = sign
        rows.append(row)
    return list(zip(pairs, rows, strict=True))
