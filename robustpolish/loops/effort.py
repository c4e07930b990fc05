"""What noise and disturbances make the controls do: size, peak, and how quickly they move."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import control
import numpy as np
import xarray as xr

from robustpolish.analysis import h2_norm
from robustpolish.arrays import Array, Vector
from robustpolish.loops.loop import Loop, norm_of
from robustpolish.loops.sensitivities import from_to
from robustpolish.simulation import linear_response
from robustpolish.validation import described, instance_of, invalid

# Each scale of time takes so many steps, of a twentieth of the fastest pole's time at first.
_STEPS = 400
_FINEST = 0.05
_SETTLED = 8.0
_MOST_SCALES = 60
_MOST_SAMPLES = 100_000


@dataclass(frozen=True)
class Effort:
    """What one source makes one control do.

    Attributes
    ----------
    source, control : str
        A measurement with noise, or a disturbance; and the control.
    rms : float
        Root mean square of the control per unit of the source's density: the H2 norm. In
        continuous time for white noise of one unit per root hertz, negative frequencies counted
        too (divide a data sheet's one-sided density by root 2); infinite where the control follows
        at once, for white noise has no finite power. In discrete time for noise of standard
        deviation 1 in every sample.
    peak_gain : float
        Largest gain over all frequencies, the H-infinity norm.
    peak_gain_hz : float
        Where it is.
    step_peak : float
        Largest size of the control after a unit step of the source.
    step_rate : float
        Largest rate of the control in units per second after that step; infinite where the
        control jumps. In discrete time the largest change from one sample to the next, over the
        sampling time.
    unit, source_unit : str
        Of the control and of the source, where the plant knows them.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> noise = rp.loop_analysis(control.tf([1], [1, 1]), control.tf([-2], [1, 2])).noise[0]
    >>> noise.source, round(noise.rms, 4), round(noise.step_rate, 4)
    ('y[0]', 0.9129, 2.0)
    """

    source: str
    control: str
    rms: float
    peak_gain: float
    peak_gain_hz: float
    step_peak: float
    step_rate: float
    unit: str = ""
    source_unit: str = ""


@dataclass(frozen=True)
class GivenEffort:
    """What one control does under given signals.

    Attributes
    ----------
    control : str
    peak, rms : float
        Its largest size and its root mean square.
    peak_rate : float
        Its largest rate in units per second, from sample to sample.
    unit : str
        Of the control, where the plant knows it.

    Examples
    --------
    >>> from robustpolish.loops import GivenEffort
    >>> GivenEffort("F", peak=2.0, rms=1.0, peak_rate=50.0).peak
    2.0
    """

    control: str
    peak: float
    rms: float
    peak_rate: float
    unit: str = ""


def noise_effort(loop: Loop) -> tuple[Effort, ...]:
    """Return what noise on every measurement makes every control do."""
    return _efforts(loop, from_to(loop.closed, loop.at("output"), loop.at("input")))


def disturbance_effort(loop: Loop) -> tuple[Effort, ...]:
    """Return what every disturbance of the plant makes every control do.

    A plant without disturbances of its own is disturbed at its controls.
    """
    return _efforts(loop, disturbed(loop))


def disturbed(loop: Loop) -> control.StateSpace:
    """Return the system from the disturbances to the controls."""
    plant = loop.plant
    if plant.nw == 0:
        return loop.around(loop.at("input"), 1.0, 1.0)  # K y = u - d
    whole = plant.with_control_outputs()
    closed = whole.closed_loop(loop.controller)
    rows = list(range(plant.nz, plant.nz + plant.nu))
    found = from_to(closed, list(range(plant.nw)), rows)
    # An output of the plant that has a control's name already would have turned it into "u_2".
    found.update_names(outputs=list(plant.control_names))
    return found


def given_effort(loop: Loop, disturbance: xr.Dataset) -> tuple[GivenEffort, ...]:
    """Return what every control does under given disturbances, the loop starting at rest.

    Raises
    ------
    InvalidInputError
        If the dataset has no disturbance of the plant, or one that is not over `time` alone.
    """
    remedy = "Build one with a variable per disturbance over 'time', in s."
    instance_of("disturbance", disturbance, xr.Dataset, "an xarray.Dataset over time", remedy)
    system = disturbed(loop)
    known = [name for name in system.input_labels if name in disturbance]
    if "time" not in disturbance.coords or not known:
        shown = described(f"variables {', '.join(map(str, disturbance.data_vars)) or 'none'}")
        wanted = f"some of {', '.join(system.input_labels)} over 'time'"
        raise invalid("disturbance", shown, wanted, "Rename the variables.")
    time = disturbance["time"].to_numpy().astype(float)
    inputs = np.zeros((time.size, system.ninputs or 0))
    for name in known:
        variable = disturbance[name]
        if variable.dims != ("time",):
            shown = described(f"dimensions {variable.dims}")
            raise invalid(f"disturbance[{name!r}]", shown, "('time',)", "Select one trajectory.")
        inputs[:, system.input_labels.index(name)] = variable.to_numpy()
    outputs = linear_response(system, time, inputs).outputs
    rates = np.abs(np.diff(outputs, axis=0)) / np.diff(time)[:, None]
    return tuple(
        GivenEffort(
            name,
            float(np.abs(outputs[:, i]).max(initial=0.0)),
            float(np.sqrt(np.mean(outputs[:, i] ** 2))),
            float(rates[:, i].max(initial=0.0)),
            loop.unit(name),
        )
        for i, name in enumerate(system.output_labels)
    )


def _efforts(loop: Loop, system: control.StateSpace) -> tuple[Effort, ...]:
    peaks, rates = _step_sizes(system)
    found = []
    for j, source in enumerate(system.input_labels):
        for i, name in enumerate(system.output_labels):
            part = from_to(system, [j], [i])
            peak = norm_of(part)
            found.append(
                Effort(
                    source,
                    name,
                    h2_norm(part, tolerance=1e-6).value,
                    peak.value,
                    peak.frequency / (2 * math.pi),
                    float(peaks[i, j]),
                    float(rates[i, j]),
                    loop.unit(name),
                    loop.unit(source),
                )
            )
    return tuple(found)


def _step_sizes(system: control.StateSpace) -> tuple[Array, Array]:
    """Return the largest sizes of the step response and of its rate, outputs by inputs."""
    p, m = system.noutputs or 0, system.ninputs or 0
    D = np.abs(np.asarray(system.D))
    peaks, rates = D.copy(), np.where(D > 0, np.inf, 0.0)
    if system.nstates == 0:
        return peaks, rates
    discrete = system.isdtime(strict=True)
    step = 1.0 if system.dt is True else float(system.dt or 1)
    if discrete:
        rates = D / step
    for time in _time_scales(system):
        for j in range(m):
            unit = np.zeros((time.size, m))
            unit[:, j] = 1.0
            outputs = linear_response(system, time, unit).outputs
            peaks[:, j] = np.maximum(peaks[:, j], np.abs(outputs).max(axis=0))
            if discrete:
                changes = np.abs(np.diff(outputs, axis=0)).max(axis=0, initial=0.0)
                rates[:, j] = np.maximum(rates[:, j], changes / step)
            else:
                rates[:, j] = np.maximum(rates[:, j], _impulse(system, time, j))
    return peaks.reshape(p, m), rates.reshape(p, m)


def _impulse(system: control.StateSpace, time: Vector, j: int) -> Vector:
    """Return the largest sizes of the impulse response, which is the rate of the step response."""
    still = np.zeros((time.size, system.ninputs or 0))
    start = np.asarray(system.B)[:, j]
    return np.abs(linear_response(system, time, still, start).outputs).max(axis=0)


def _time_scales(system: control.StateSpace) -> list[Vector]:
    """Return grids of time, each twice as coarse as the one before, until all has settled."""
    poles: Any = np.asarray(system.poles())
    if system.isdtime(strict=True):
        step = 1.0 if system.dt is True else float(system.dt or 1)
        slowest = float(np.abs(poles).max(initial=0.0))
        count = _SETTLED / -math.log(slowest) if 0 < slowest < 1 else len(poles) + 1
        whole: Any = np.arange(int(min(count + len(poles), _MOST_SAMPLES)) + 2) * step
        return [whole]
    if not np.abs(poles).any():
        return []  # integrators that nothing reaches, or of which nothing is seen
    step = _FINEST / float(np.abs(poles).max())
    least = float(np.abs(poles.real).min())
    last = _SETTLED / least if least > 0 else math.inf
    grids: list[Any] = []
    for _ in range(_MOST_SCALES):
        grids.append(np.arange(_STEPS + 1) * step)
        if grids[-1][-1] >= last:
            break
        step *= 2
    return grids
