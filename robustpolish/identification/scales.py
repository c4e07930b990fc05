"""Sizes of noise, forces and bandwidth, from the data alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from robustpolish.identification.observer import Scales, force_sites
from robustpolish.identification.record import Record
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.parts import ACCELERATION, DISPLACEMENT, VELOCITY
from robustpolish.simulation.signals import signals

Array = NDArray[np.float64]
_QUIETEST = 1e-5
# A force that lasts cannot be told from a displacement by a sensor that does not see one.
_LEAK = {VELOCITY: 20.0, ACCELERATION: 4.0}


def scales_of(model: MechanicalModel, record: Record) -> Scales:
    """Return the sizes that an observer of this record needs."""
    W = signals(model, record.data)
    noise = np.array([white_noise(y, record.dt) for y in record.Y.T])
    bandwidth = excited_bandwidth(model, record)
    m = model.matrices
    inputs = np.std(W, axis=0) if W.shape[1] else np.zeros(0)
    forces = W[:, : m.B.shape[1]] @ m.B.T
    driving = float(np.sqrt(np.mean(np.sum(forces**2, axis=1)))) if forces.size else 0.0
    q = amplitude_of(model, record, bandwidth)
    mass = np.diag(m.M)
    rows, _ = force_sites(model)
    elastic = np.array([abs(r) @ (np.abs(np.diag(m.K)) + mass * bandwidth**2 / 4) for r in rows])
    force = np.full(len(rows), driving) if driving > 0 else elastic * q / np.sqrt(2)
    measured = [
        float(np.std(record.Y[:, i])) for i, o in enumerate(model.outputs) if o.quantity == "force"
    ]
    if measured and driving == 0:
        force = np.full(len(rows), max(measured))
    share = max(_LEAK.get(o.quantity, 60.0) for o in model.outputs)
    return Scales(noise, np.maximum(force, 1e-300), inputs, bandwidth, bandwidth / share)


def white_noise(y: Array, dt: float) -> float:
    """Return the standard deviation of white noise that the quietest band allows for."""
    y = y - np.mean(y)
    total = float(np.std(y))
    if total == 0:
        return 1.0
    _, density = welch(y, 1 / dt, nperseg=min(256, len(y) // 4), detrend="linear")
    bands = np.array_split(density[1:], min(16, density.size - 1))
    lowest = min(float(np.mean(band)) for band in bands)
    return max(float(np.sqrt(lowest * 0.5 / dt)), _QUIETEST * total)


def excited_bandwidth(model: MechanicalModel, record: Record) -> float:
    """Return the frequency in rad/s below which the motion happens."""
    highest = 0.0
    for i, output in enumerate(model.outputs):
        y = record.Y[:, i] - np.mean(record.Y[:, i])
        frequency, density = welch(y, 1 / record.dt, nperseg=min(2048, len(y) // 2))
        omega = 2 * np.pi * frequency
        order = {DISPLACEMENT: 0, VELOCITY: 2, ACCELERATION: 4}.get(output.quantity, 0)
        floor = np.percentile(density, 10)
        power = np.cumsum(np.maximum(density[1:] - 3 * floor, 0) / omega[1:] ** order)
        if power[-1] > 0:
            highest = max(highest, float(omega[1:][np.searchsorted(power, 0.98 * power[-1])]))
    return highest or 0.2 / record.dt


def amplitude_of(model: MechanicalModel, record: Record, bandwidth: float) -> float:
    """Return a displacement amplitude, in m or rad, from outputs or imposed motions."""
    found = []
    for i, output in enumerate(model.outputs):
        size = float(np.percentile(np.abs(record.Y[:, i] - np.median(record.Y[:, i])), 98))
        order = {DISPLACEMENT: 0, VELOCITY: 1, ACCELERATION: 2}.get(output.quantity)
        if order is not None:
            found.append(size / bandwidth**order)
    for item in model.inputs:
        if item.imposes == DISPLACEMENT:
            found.append(float(np.percentile(np.abs(record.data[item.name].values), 98)))
    return max(found, default=0.0)
