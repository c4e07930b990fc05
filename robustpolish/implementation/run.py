"""A sampled loop run over time: exact between its events, with the limits of its actuators."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import control
import numpy as np
import xarray as xr

from robustpolish.base.arrays import AGREE, Array, Matrix, Vector
from robustpolish.base.checks import described, instance_of, invalid, misfit
from robustpolish.implementation.sampled.lifting import split_delay
from robustpolish.linear.response import first_order_hold
from robustpolish.plants.blocks import matrices_of
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.signals.read import read_measurement

# The plant of a sampled loop through many periods at once, from the start of each to its end.


_Step = tuple[Matrix, Matrix, Matrix]


@dataclass(frozen=True, eq=False)
class PeriodFlow:
    """A period in equal steps, at one of which the control changes, or within it.

    Attributes
    ----------
    plant : GeneralizedPlant
        Continuous, with its filter.
    count : int
        Steps of a period.
    whole : int
        Whole periods of delay: after the change acts what was put out so many samples ago.
    cut : int
        The step at whose beginning, or within which, the control changes.
    steps : tuple
        The exact maps of a step, and of its parts before and after the change if that is within.
    left : float
        Seconds from the beginning of the step `cut` to the change.
    """

    plant: GeneralizedPlant
    count: int
    whole: int
    cut: int
    steps: tuple[_Step, ...]
    left: float

    @classmethod
    def of(cls, plant: GeneralizedPlant, period: float, count: int, delay: float) -> PeriodFlow:
        """Divide a period, and discretise its parts."""
        whole, rest = split_delay(period, delay)
        step = period / count
        # Part of a step below which the control's change falls onto the grid.
        cut = int(rest / step + AGREE)
        left = rest - cut * step
        if cut == count:
            whole, cut, left = whole + 1, 0, 0.0
        n, ny = plant.nx, plant.ny
        # What w adds directly to y cannot be sampled: its average over the period is a state.
        A = np.zeros((n + ny, n + ny))
        A[:n, :n] = plant.A
        B = np.block([[plant.B1, plant.B2], [plant.D21 / period, np.zeros((ny, plant.nu))]])
        split = left > AGREE * step
        lengths = (step, left, step - left) if split else (step,)
        steps = tuple(first_order_hold(A, B, length) for length in lengths)
        return cls(plant, count, whole, cut, steps, left if split else 0.0)

    @property
    def states(self) -> int:
        """Of the plant, and an average per measurement."""
        return self.plant.nx + self.plant.ny

    def through(
        self, w: Array, middle: Array, starts: Array, before: Array, after: Array
    ) -> tuple[Array, Array]:
        """Go through periods, each from a start of its own.

        Parameters
        ----------
        w : ndarray, shape (periods count + 1, nw)
            At the steps.
        middle : ndarray, shape (periods, nw)
            Where the control changes; only used if that is within a step.
        starts : ndarray, shape (periods, states)
        before, after : ndarray, shape (periods, nu)
            The control before and after its change.

        Returns
        -------
        ends : ndarray, shape (periods, states)
        z : ndarray, shape (periods count, nz)
        """
        plant, count = self.plant, self.count
        periods, n = len(starts), plant.nx
        now = w[:-1].reshape(periods, count, plant.nw)
        later = w[1:].reshape(periods, count, plant.nw)
        z = np.empty((periods, count, plant.nz))
        x = starts
        for j in range(count):
            changes = j == self.cut and self.left > 0
            u = before if j < self.cut or changes else after
            z[:, j] = x[:, :n] @ plant.C1.T + now[:, j] @ plant.D11.T + u @ plant.D12.T
            if changes:
                x = _advanced(self.steps[1], x, now[:, j], middle, u)
                x = _advanced(self.steps[2], x, middle, later[:, j], after)
            else:
                x = _advanced(self.steps[0], x, now[:, j], later[:, j], u)
        return x, z.reshape(periods * count, plant.nz)

    def held(self, before: Array, after: Array) -> Array:
        """Return the control at the steps, shape (periods count, nu)."""
        changed = np.arange(self.count) >= self.cut + (self.left > 0)
        u = np.where(changed[:, None], after[:, None], before[:, None])
        return u.reshape(-1, self.plant.nu)

    def maps(self) -> tuple[Matrix, Matrix, Matrix]:
        """Return what start, control before and control after its change make of the end."""
        n, nu, nw = self.states, self.plant.nu, self.plant.nw
        each = np.eye(n + 2 * nu)
        still = np.zeros((len(each) * self.count + 1, nw))
        parts = each[:, :n], each[:, n : n + nu], each[:, n + nu :]
        ends, _ = self.through(still, still[: len(each)], *parts)
        return ends[:n].T, ends[n : n + nu].T, ends[n + nu :].T


def _advanced(step: _Step, x: Array, now: Array, later: Array, u: Array) -> Array:
    """Return states after a step with w linear and u constant."""
    nw = now.shape[1]
    transition, first, last = step
    by_u = first[:, nw:] + last[:, nw:]
    return x @ transition.T + now @ first[:, :nw].T + later @ last[:, :nw].T + u @ by_u.T


LEAST_STEPS = 10
"""Steps per period at least, so that what happens between samples is seen."""

MOST_STEPS = 2000


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
    time, w = disturbance_columns(disturbance, plant.disturbance_names, plant.units)
    period = float(controller.dt)
    count = _steps(period, time)
    step = period / count
    total = max(1, math.floor((time[-1] - time[0]) / step + AGREE)) + 1
    grid = step * np.arange(total)
    flow = PeriodFlow.of(plant, period, count, delay)
    # whole periods, w staying as it is at the end: what lies beyond is thrown away again
    periods = math.ceil(total / count)
    instants = (
        step * np.arange(periods * count + 1, dtype=float),
        period * np.arange(periods, dtype=float) + step * flow.cut + flow.left,
    )
    driven, between = (
        np.column_stack([np.interp(at, time - time[0], c) for c in w.T]) for at in instants
    )
    still = np.zeros((periods, plant.nu))
    pushed, _ = flow.through(driven, between, np.zeros((periods, flow.states)), still, still)
    starts, sent, at_limit = _from_sample_to_sample(flow, controller, pushed, limits, feedback)
    before, after = sent[:periods], sent[1 : periods + 1]
    _, z = flow.through(driven, between, starts, before, after)
    u, share = flow.held(before, after), at_limit / periods
    # A z may be called as a control is: then the control gets another name, as in rp.simulate.
    shown = plant.with_control_outputs().performance_names
    own = (*plant.performance_names, *plant.control_names)
    found = {}
    for i, (name, column) in enumerate(zip(shown, (*z.T, *u.T), strict=True)):
        attributes: dict[str, Any] = {"units": plant.units[own[i]]} if own[i] in plant.units else {}
        if i >= plant.nz:
            attributes["at_limit"] = float(share[i - plant.nz])
        found[name] = ("time", column[:total], attributes)
    return xr.Dataset(found, coords={"time": ("time", grid + time[0], {"units": "s"})})


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
        raise misfit("disturbance", "a single sample", "two or more", "Simulate a longer time.")
    ratio = period / (time[-1] - time[0]) * (time.size - 1)
    count = max(1, round(ratio)) if abs(ratio - round(ratio)) < AGREE * ratio else math.ceil(ratio)
    count *= max(1, math.ceil(LEAST_STEPS / count))
    if count > MOST_STEPS:
        want = f"at most {MOST_STEPS} samples per period of {period:.6g} s"
        shown = f"a disturbance with {ratio:.0f} samples per period"
        raise misfit("disturbance", shown, want, "Decimate it, or check the unit of its time.")
    return count


def disturbance_columns(
    disturbance: xr.Dataset,
    names: Sequence[str],
    units: Mapping[str, str],
    argument: str = "disturbance",
) -> tuple[Vector, Array]:
    """Return the time in s and a column for each disturbance, zero where none is given.

    Raises
    ------
    InvalidInputError
        If the dataset has none of them, one that is not over `time` alone, or another unit.
    """
    table = hasattr(disturbance, "keys") and not isinstance(disturbance, xr.Dataset)
    if table and any(np.ndim(disturbance[key]) for key in disturbance):
        disturbance = _table(disturbance, names)
    remedy = "Build one with a variable per disturbance, or take simulate_brush(...)."
    instance_of(argument, disturbance, xr.Dataset, "an xarray.Dataset over time", remedy)
    if "time" not in disturbance.coords:
        remedy = "Add the coordinate with .assign_coords(time=...)."
        raise misfit(argument, "no coordinate 'time'", "samples over 'time', in s", remedy)
    time = np.asarray(disturbance["time"].to_numpy(), dtype=float)
    if time.ndim != 1 or not np.isfinite(time).all() or (np.diff(time) <= 0).any():
        raise misfit(argument, "its time", "a rising grid", "Sort the samples.")
    if names and not any(name in disturbance for name in names):
        shown = described(f"variables {', '.join(map(str, disturbance.data_vars)) or 'none'}")
        expected = f"one of {', '.join(map(repr, names))} or several"
        remedy = "Rename the variables; those that are left out are zero."
        raise invalid(argument, shown, expected, remedy)
    columns = np.zeros((time.size, len(names)))
    for i, name in enumerate(names):
        if name in disturbance:
            columns[:, i] = _column(argument, disturbance[name], units.get(name))
            continue
        for other in map(str, disturbance.data_vars):
            if _bare(other) == _bare(name):
                shown = described(f"a variable {other!r}")
                raise invalid(argument, shown, f"one named {name!r}", "Rename the variable.")
    return time, columns


def _table(given: Any, names: Sequence[str]) -> xr.Dataset:
    """Read a table or a mapping of columns; u[0] is a name there, 0 no unit."""
    own = {name: f"column {i}" for i, name in enumerate(names)}
    if hasattr(given, "rename"):
        given = given.rename(columns=own)
    else:
        given = {own.get(name, name): column for name, column in given.items()}
    found = read_measurement(given)
    return found.rename({there: name for name, there in own.items() if there in found})


def _bare(name: str) -> str:
    """Return a name without case and separators, by which misspelt ones are known."""
    return "".join(c for c in name.lower() if c.isalnum())


def _column(argument: str, variable: xr.DataArray, unit: str | None) -> Vector:
    where = f"{argument}[{variable.name!r}]"
    if variable.dims != ("time",):
        shown = described(f"dimensions {variable.dims}")
        raise invalid(where, shown, "('time',)", "Select one trajectory.")
    values = np.asarray(variable.to_numpy(), dtype=float)
    if not np.isfinite(values).all():
        raise misfit(where, "others", "finite numbers", "Remove or replace them.")
    own = variable.attrs.get("units")
    if unit is not None and own is not None and unit != own:
        remedy = "Convert the variable and its units attribute."
        raise misfit(where, f"unit {own}", f"{unit}, as in the plant", remedy)
    return values
