"""Systems of a loop as pictures: responses over frequencies of their own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.base.arrays import AnyVector, Vector
from robustpolish.linear.norms.singular_values import frequency_grid
from robustpolish.linear.response import linear_response
from robustpolish.loops.response import SystemResponse
from robustpolish.plots.frequency import plot_bode, plot_gains, plot_nichols, plot_nyquist_disks
from robustpolish.plots.time import plot_time_series

_STEPS = 2000


def grid_of(systems: Mapping[str, control.StateSpace], rates: AnyVector) -> Vector:
    """Return frequencies in rad/s that show all of several systems."""
    every: Any = [SystemResponse(system).rates for system in systems.values()]
    own: Any = np.concatenate([rates, *every])
    slowest = float(np.abs(rates).min(initial=math.inf))
    if math.isfinite(
        slowest
    ):  # what is far slower than the loop is an integrator, but for rounding
        own = own[np.abs(own) > slowest / 100]
    highest = min(SystemResponse(system).highest for system in systems.values())
    return frequency_grid(own, highest)


def responses(
    systems: Mapping[str, control.StateSpace], rates: AnyVector | None = None
) -> dict[str, xr.DataArray]:
    """Return scalar responses over frequency in Hz, those of several signals row by row."""
    rates = np.zeros(0, complex) if rates is None else rates
    omega = grid_of(systems, rates)
    found = {}
    for name, system in systems.items():
        values = SystemResponse(system).at(omega)
        several = values.shape[1:] != (1, 1)
        for i, output in enumerate(system.output_labels):
            for j, entry in enumerate(system.input_labels):
                label = f"{name} {entry} to {output}" if several else name
                found[label] = over_frequency(omega, values[:, i, j])
    return found


def plot_loop_nyquist(
    loops: Mapping[str, control.StateSpace],
    disks: Mapping[str, float],
    ax: Axes | None = None,
    rates: AnyVector | None = None,
) -> Axes:
    """Draw scalar loops around -1 with their disks."""
    return plot_nyquist_disks(responses(loops, rates), disks, ax)


def plot_loop_nichols(
    loops: Mapping[str, control.StateSpace],
    disks: Mapping[str, float],
    ax: Axes | None = None,
    rates: AnyVector | None = None,
) -> Axes:
    """Draw scalar loops in Nichols's plane with their disks."""
    return plot_nichols(responses(loops, rates), disks, ax)


def plot_loop_bode(
    loops: Mapping[str, control.StateSpace], ax: Axes | None = None, rates: AnyVector | None = None
) -> Axes:
    """Draw gain and phase of scalar loops."""
    return plot_bode(responses(loops, rates), ax, name="gain of L")


def plot_sigma(
    systems: Mapping[str, control.StateSpace],
    ax: Axes | None = None,
    rates: AnyVector | None = None,
) -> Axes:
    """Draw the largest singular values of systems of any size."""
    rates = np.zeros(0, complex) if rates is None else rates
    omega = grid_of(systems, rates)
    gains = {
        name: over_frequency(omega, SystemResponse(system).sizes(omega)[:, 0])
        for name, system in systems.items()
    }
    several = any(system.ninputs != 1 or system.noutputs != 1 for system in systems.values())
    return plot_gains(gains, None, ax, name="largest singular value" if several else "gain")


def plot_steps(
    systems: Mapping[str, control.StateSpace], duration: float, ax: Axes | None = None
) -> Axes:
    """Draw the responses of stable systems to a unit step at each input."""
    traces = {}
    for name, system in systems.items():
        discrete = system.isdtime(strict=True)
        step = 1.0 if system.dt is True else float(system.dt or 0)
        count = min(math.ceil(duration / step), 100_000) if discrete else _STEPS
        time = np.arange(count + 1) * (step if discrete else duration / _STEPS)
        for j, entry in enumerate(system.input_labels):
            inputs = np.zeros((time.size, system.ninputs or 0))
            inputs[:, j] = 1.0
            outputs = linear_response(system, time, inputs).outputs
            several = (system.ninputs or 0) > 1 or (system.noutputs or 0) > 1
            for i, output in enumerate(system.output_labels):
                label = f"{name} {entry} to {output}" if several else name
                traces[label] = xr.DataArray(
                    outputs[:, i], {"time": time}, "time", "response to a unit step"
                )
    return plot_time_series(traces, ax)


def over_frequency(omega: Vector, values: AnyVector) -> xr.DataArray:
    """Return values over frequencies in rad/s with the latter in Hz."""
    hertz = ("frequency", omega / (2 * math.pi), {"units": "Hz"})
    return xr.DataArray(values, dims="frequency", coords={"frequency": hertz})
