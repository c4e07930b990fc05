"""The error by displacement and velocity at each place, and the missing force over both.

With it how much of a force follows from the motion at one place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr

from robustpolish.arrays import Array
from robustpolish.identification.compare.comparison import Comparison
from robustpolish.identification.observer.kalman import force_sites
from robustpolish.identification.observer.missing_force import motion_of, observed_motion
from robustpolish.identification.observer.run import StartedPiece, free_run, rest
from robustpolish.identification.record import record_of
from robustpolish.identification.residuals.shares import surface, value_shares
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.parts import FORCE, UNITS


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
    follows : float
        Share of the missing force's power, from 0 to 1, that displacement and velocity here
        foretell: what the map of one half of the record says of the other.
    """

    at: tuple[str, str]
    displacement: xr.DataArray
    velocity: xr.DataArray
    surface: xr.Dataset
    observed: bool
    follows: float = 0.0


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
    return {
        place.at[0] if place.at[1] == "ground" else f"{place.at[0]} - {place.at[1]}": PlaceShares(
            at=place.at,
            displacement=value_shares(residual, place.displacement, bins, "displacement"),
            velocity=value_shares(residual, place.velocity, bins, "velocity"),
            surface=place.surface,
            observed=observed,
            follows=foretold(place.displacement, place.velocity, place.force, bins),
        )
        for place in forces_at_places(model, q[:, skip:], v[:, skip:], force[:, skip:], bins)
    }


class PlaceForce(NamedTuple):
    """Relative motion at a place and the force that is missing there, with its map."""

    at: tuple[str, str]
    displacement: Array
    velocity: Array
    force: Array
    surface: xr.Dataset


def forces_at_places(
    model: MechanicalModel, q: Array, v: Array, force: Array, bins: int
) -> list[PlaceForce]:
    """Return the missing force at every coordinate and connection of a model that moves.

    Parameters
    ----------
    model : MechanicalModel
    q, v : ndarray, shape (coordinates, samples)
    force : ndarray, shape (sites, samples)
        Missing force at each site, see
        :func:`~robustpolish.identification.observer.kalman.force_sites`.
    bins : int
        Of the maps, in each direction.

    Returns
    -------
    list of PlaceForce
        With units in the maps.
    """
    sites = force_sites(model)[0]
    found = []
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
        found.append(PlaceForce(at, dq, dv, pull, shown))
    return found


def _motion(comparison: Comparison) -> tuple[Array, Array, Array, bool]:
    """Displacements, velocities and missing forces along the record, shape (rows, samples)."""
    model = comparison.model
    record = record_of(model, comparison.data)
    found = observed_motion(model, record)
    if found is not None:
        return found.q, found.v, found.force, True
    starts = [rest(model).with_vector(error.starts[0]) for error in comparison.records.values()]
    pieces = [StartedPiece(*piece) for piece in zip(record.parts, starts, strict=True)]
    states = free_run(model, record).over_all(pieces, keep=True).states
    q, v = motion_of(model, np.nan_to_num(states), record.signals(model))
    return q, v, np.full((len(force_sites(model)[0]), record.samples), np.nan), False


def _places(model: MechanicalModel) -> list[tuple[tuple[str, str], Array]]:
    """Every coordinate against ground, and every pair that something connects."""
    names = model.dof_names
    pairs = [(name, "ground") for name in names if name not in model.channels]
    connected = [s.between for s in model.springs] + [d.between for d in model.dampers]
    connected += [e.at for e in model.effects if e.definition.domain == "pair"]
    connected += [(o.of[0], o.of[1]) for o in model.outputs if o.weights is None]
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


def foretold(q: Array, v: Array, force: Array, bins: int = 12, blocks: int = 20) -> float:
    """Return the share of a force's power that the map of one half of a record says of the other.

    Parameters
    ----------
    q, v, force : ndarray, shape (samples,)
        Displacement, velocity and force; NaN forces follow from nothing.
    bins : int, optional
        Cells of the map in each direction.
    blocks : int, optional
        Stretches of the record that belong to one half and to the other in turn.

    Returns
    -------
    float
        From 0 to 1. Cells that only one half visits count as foretold to be zero.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> time = np.arange(4000) / 100
    >>> q, v = np.sin(time) + 0.3 * np.sin(7.3 * time), np.cos(time) + 2.2 * np.cos(7.3 * time)
    >>> foretold(q, v, np.sign(v)) > 0.9, foretold(q, v, rng.standard_normal(4000)) < 0.05
    (True, True)
    """
    total = float(np.sum(force**2))
    if not 0 < total < np.inf:
        return 0.0
    cell = bins * _cells(q, bins) + _cells(v, bins)
    half = (np.arange(force.size) * blocks // force.size) % 2
    left = 0.0
    for this in (0, 1):
        other = half != this
        count = np.bincount(cell[other], minlength=bins**2)
        mean = np.bincount(cell[other], force[other], bins**2) / np.maximum(count, 1)
        left += float(np.sum((force[~other] - mean[cell[~other]]) ** 2))
    return float(np.clip(1 - left / total, 0.0, 1.0))


def _cells(values: Array, bins: int) -> np.ndarray:
    edges = np.linspace(values.min(), values.max(), bins + 1)
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, bins - 1)
