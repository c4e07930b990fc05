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
from robustpolish.linear.norms.hinf import frequency_grid
from robustpolish.linear.response import linear_response
from robustpolish.loops.loop import sample_step
from robustpolish.loops.response import LineResponse, SystemResponse
from robustpolish.plots.frequency import plot_bode, plot_gains, plot_nichols, plot_nyquist_disks
from robustpolish.plots.time import plot_time_series

# Of a step response: in continuous time, and at most in discrete time.
_STEPS = 2000
_MOST_SAMPLES = 100_000


System = control.StateSpace | control.FrequencyResponseData


def _response(system: System) -> SystemResponse | LineResponse:
    measured = isinstance(system, control.FrequencyResponseData)
    return LineResponse(system) if measured else SystemResponse(system)


def grid_of(systems: Mapping[str, System], rates: AnyVector | None = None) -> Vector:
    """Return frequencies in rad/s that show all of several systems; measured ones have theirs."""
    found: Any = [_response(system) for system in systems.values()]
    if isinstance(found[0], LineResponse):
        return found[0].omega
    rates = np.zeros(0, complex) if rates is None else rates
    own: Any = np.concatenate([rates, *(response.rates for response in found)])
    slowest = float(np.abs(rates).min(initial=math.inf))
    if math.isfinite(slowest):
        # What is far slower than the loop is an integrator, but for rounding.
        own = own[np.abs(own) > slowest / 100]
    return frequency_grid(own, min(response.highest for response in found))


def responses(
    systems: Mapping[str, System], rates: AnyVector | None = None
) -> dict[str, xr.DataArray]:
    """Return scalar responses over frequency in Hz, those of several signals row by row."""
    omega = grid_of(systems, rates)
    found = {}
    for name, system in systems.items():
        values = _response(system).at(omega)
        for i, output in enumerate(system.output_labels):
            for j, entry in enumerate(system.input_labels):
                label = f"{name} {entry} to {output}" if _several(system) else name
                found[label] = _over_frequency(omega, values[:, i, j])
    return found


def plot_sigma(
    systems: Mapping[str, System], ax: Axes | None = None, rates: AnyVector | None = None
) -> Axes:
    """Draw the largest singular values of systems of any size."""
    omega = grid_of(systems, rates)
    gains = {
        name: _over_frequency(omega, _response(system).sizes(omega)[:, 0])
        for name, system in systems.items()
    }
    several = any(map(_several, systems.values()))
    return plot_gains(gains, None, ax, name="largest singular value" if several else "gain")


def plot_loops(
    loops: Mapping[str, System],
    disks: Mapping[str, float],
    kind: str,
    ax: Axes | None,
    rates: AnyVector | None,
) -> Axes:
    """Draw scalar loops: gain and phase, or the curve around -1 with its disk."""
    curves = responses(loops, rates)
    if kind == "bode":
        return plot_bode(curves, ax, name="gain of L")
    draw = plot_nyquist_disks if kind == "nyquist" else plot_nichols
    return draw(curves, disks, ax)


def plot_steps(
    systems: Mapping[str, control.StateSpace], duration: float, ax: Axes | None = None
) -> Axes:
    """Draw the responses of stable systems to a unit step at each input."""
    traces = {}
    for name, system in systems.items():
        step = sample_step(system.dt)
        count = min(math.ceil(duration / step), _MOST_SAMPLES) if step else _STEPS
        time = np.arange(count + 1) * (step or duration / _STEPS)
        for entry, inputs in zip(system.input_labels, np.eye(system.ninputs or 0), strict=True):
            outputs = linear_response(system, time, np.tile(inputs, (time.size, 1))).outputs
            for output, values in zip(system.output_labels, outputs.T, strict=True):
                label = f"{name} {entry} to {output}" if _several(system) else name
                traces[label] = xr.DataArray(
                    values, {"time": time}, "time", "response to a unit step"
                )
    return plot_time_series(traces, ax)


def _several(system: System) -> bool:
    return system.ninputs != 1 or system.noutputs != 1


def _over_frequency(omega: Vector, values: AnyVector) -> xr.DataArray:
    """Return values over frequencies in rad/s with the latter in Hz."""
    hertz = ("frequency", omega / (2 * math.pi), {"units": "Hz"})
    return xr.DataArray(values, dims="frequency", coords={"frequency": hertz})
