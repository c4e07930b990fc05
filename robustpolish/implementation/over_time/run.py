"""A sampled loop run over time: exact between its events, with the limits of its actuators."""

from __future__ import annotations

import math

import control
import numpy as np
import xarray as xr

from robustpolish.arrays import Array, Matrix, Vector
from robustpolish.implementation.over_time.period_flow import PeriodFlow
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.blocks import matrices_of
from robustpolish.validation import described, instance_of, invalid

LEAST_STEPS = 10
"""Steps per period at least, so that what happens between samples is seen."""

MOST_STEPS = 2000

_SAME = 1e-6


def sampled_run(
    plant: GeneralizedPlant,
    controller: control.StateSpace,
    delay: float,
    disturbance: xr.Dataset,
    limits: tuple[Vector, Vector] | None,
    feedback: Matrix,
) -> xr.Dataset:
    """Simulate a sampled loop from rest; see `SampledDesign.simulate`.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous, with its filter.
    controller : control.StateSpace
        Discrete.
    delay : float
        In s.
    disturbance : xarray.Dataset
        Over `time` in s, linear between its samples.
    limits : (ndarray, ndarray) or None
        Of the controls.
    feedback : ndarray
        L of the anti-windup.

    Returns
    -------
    xarray.Dataset
    """
    time, w = _columns(plant, disturbance)
    period = float(controller.dt)
    count = _steps(period, time)
    step = period / count
    total = max(1, math.floor((time[-1] - time[0]) / step + _SAME)) + 1
    grid = step * np.arange(total)
    flow = PeriodFlow.of(plant, period, count, delay)
    # whole periods, w staying as it is at the end: what lies beyond is thrown away again
    periods = math.ceil(total / count)

    def at(instants: Vector) -> Array:
        return np.column_stack([np.interp(instants, time - time[0], column) for column in w.T])

    drive = (
        at(step * np.arange(periods * count + 1, dtype=float)),
        at(period * np.arange(periods, dtype=float) + step * flow.cut + flow.left),
    )
    still = np.zeros((periods, plant.nu))
    pushed, _ = flow.through(*drive, np.zeros((periods, flow.states)), still, still)
    starts, sent, at_limit = _from_sample_to_sample(flow, controller, pushed, limits, feedback)
    before, after = sent[:periods], sent[1 : periods + 1]
    _, z = flow.through(*drive, starts, before, after)
    u = flow.held(before, after)
    return _dataset(plant, grid + time[0], z[:total], u[:total], at_limit / periods)


def _from_sample_to_sample(
    flow: PeriodFlow,
    controller: control.StateSpace,
    pushed: Array,
    limits: tuple[Vector, Vector] | None,
    feedback: Matrix,
) -> tuple[Array, Array, Vector]:
    """Return the plant's state after every sample, what is put out, and how often it was cut off.

    One matrix tells of the states of plant and controller what is wanted and what they will be.
    Before what is put out stand as many zeros as it takes time to act.
    """
    A, B, C, D = matrices_of(controller)
    plant, n, nk = flow.plant, flow.states, len(A)
    nu = plant.nu
    onward, by_before, by_after = flow.maps()
    onward[:, plant.nx :] = 0.0  # a sample begins new averages
    see = np.hstack([plant.C2, np.eye(plant.ny)])
    step = np.block([[D @ see, C], [onward, np.zeros((n, nk))], [B @ see, A]])
    held = np.vstack([D @ plant.D22, by_before, B @ plant.D22])
    acts = np.vstack([by_after, np.zeros((nk, nu))])
    low, high = limits if limits is not None else (-np.inf, np.inf)
    ahead = flow.whole + 1
    sent = np.zeros((len(pushed) + ahead, nu))
    starts, at_limit = np.empty((len(pushed), n)), np.zeros(nu)
    state = np.zeros(n + nk)
    for k, push in enumerate(pushed):
        starts[k] = state[:n]
        following = step @ state + held @ sent[k]
        wanted = following[:nu]
        given = np.minimum(np.maximum(wanted, low), high)
        sent[k + ahead] = given
        state = following[nu:] + acts @ sent[k + 1]
        state[:n] += push
        if limits is not None and (given != wanted).any():
            at_limit += given != wanted
            state[n:] += feedback @ (given - wanted)
    starts[:, plant.nx :] = 0.0
    return starts, sent, at_limit


def _steps(period: float, time: Vector) -> int:
    """Return steps per period, as fine as the disturbance and on its grid where that can be."""
    if time.size < 2:
        return LEAST_STEPS
    spacing = (time[-1] - time[0]) / (time.size - 1)
    ratio = period / spacing
    count = max(1, round(ratio)) if abs(ratio - round(ratio)) < _SAME * ratio else math.ceil(ratio)
    count *= max(1, math.ceil(LEAST_STEPS / count))
    if count > MOST_STEPS:
        want = f"at most {MOST_STEPS} samples per period of {period:.6g} s"
        shown = described(f"a disturbance with {ratio:.0f} samples per period")
        raise invalid("disturbance", shown, want, "Decimate it, or check the unit of its time.")
    return count


def _columns(plant: GeneralizedPlant, disturbance: xr.Dataset) -> tuple[Vector, Array]:
    remedy = "Build one with a variable per disturbance over 'time', in s."
    instance_of("disturbance", disturbance, xr.Dataset, "an xarray.Dataset over time", remedy)
    if "time" not in disturbance.coords:
        raise invalid("disturbance", described("no coordinate 'time'"), "samples over it", remedy)
    time = np.asarray(disturbance["time"].to_numpy(), dtype=float)
    rising = (
        time.ndim == 1 and time.size > 1 and np.isfinite(time).all() and (np.diff(time) > 0).all()
    )
    if not rising:
        raise invalid("disturbance", described("its time"), "a rising grid of two or more", remedy)
    known = [name for name in plant.disturbance_names if name in disturbance]
    if not known:
        listed = ", ".join(map(str, disturbance.data_vars)) or "none"
        want = f"one or more of {', '.join(plant.disturbance_names)}"
        raise invalid("disturbance", described(f"variables {listed}"), want, remedy)
    columns = []
    for name in plant.disturbance_names:
        if name not in disturbance:
            columns.append(np.zeros(time.size))
            continue
        values = np.asarray(disturbance[name].to_numpy(), dtype=float)
        if values.shape != time.shape or not np.isfinite(values).all():
            want = "finite numbers over 'time' alone"
            raise invalid(f"disturbance[{name!r}]", described("others"), want, remedy)
        unit, own = plant.units.get(name), disturbance[name].attrs.get("units")
        if unit is not None and own is not None and unit != own:
            want = f"{unit}, as in the plant"
            remedy = "Convert the variable and its units attribute."
            raise invalid(f"disturbance[{name!r}]", described(f"unit {own}"), want, remedy)
        columns.append(values)
    return time, np.column_stack(columns)


def _dataset(
    plant: GeneralizedPlant, time: Vector, z: Array, u: Array, at_limit: Vector
) -> xr.Dataset:
    found = {}
    for i, name in enumerate(plant.performance_names):
        found[name] = ("time", z[:, i], _unit(plant, name))
    # A z may be called as a control is: then the control gets another name, as in rp.simulate.
    shown = plant.with_control_outputs().performance_names[plant.nz :]
    for i, (name, own) in enumerate(zip(shown, plant.control_names, strict=True)):
        attributes = {**_unit(plant, own), "at_limit": float(at_limit[i])}
        found[name] = ("time", u[:, i], attributes)
    return xr.Dataset(found, coords={"time": ("time", time, {"units": "s"})})


def _unit(plant: GeneralizedPlant, name: str) -> dict[str, str]:
    return {"units": plant.units[name]} if name in plant.units else {}
