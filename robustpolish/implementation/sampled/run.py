"""A sampled loop run over time: exact between its events, with the limits of its actuators."""

from __future__ import annotations

import math

import control
import numpy as np
import xarray as xr

from robustpolish.arrays import Array, Matrix, Vector
from robustpolish.implementation.sampled.period_map import split_delay
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.blocks import matrices_of
from robustpolish.simulation import first_order_hold
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
    whole, rest = split_delay(period, delay)
    cut, left = int(rest / step + _SAME), rest - int(rest / step + _SAME) * step
    split = left > _SAME * step

    loop = _Flow(plant, period)
    nw, nu = plant.nw, plant.nu
    steps = {
        length: loop.step(length) for length in {step, *((left, step - left) if split else ())}
    }
    drive = np.column_stack([np.interp(grid, time - time[0], w[:, i]) for i in range(nw)])
    middle = np.zeros((0, nw))
    if split:
        middle = np.column_stack(
            [np.interp(grid + left, time - time[0], w[:, i]) for i in range(nw)]
        )
    A, B, C, D = matrices_of(controller)
    low, high = limits if limits is not None else (-np.inf, np.inf)
    x, xk = np.zeros(loop.states), np.zeros(len(A))
    queue = np.zeros((whole + 2, nu))
    acting = np.zeros(nu)
    z, u = np.zeros((total, plant.nz)), np.zeros((total, nu))
    at_limit = np.zeros(nu)
    for k in range(total):
        phase = k % count
        if phase == 0:
            y = loop.measured(x, acting)
            wanted = C @ xk + D @ y
            given = np.clip(wanted, low, high)
            at_limit += given != wanted
            xk = A @ xk + B @ y + feedback @ (given - wanted)
            queue = np.vstack([given, queue[:-1]])
        if phase == cut and not split:
            acting = queue[whole]
        z[k] = loop.see[:, : loop.plain] @ x[: loop.plain] + loop.direct @ np.concatenate(
            [drive[k], acting]
        )
        u[k] = acting
        if k + 1 == total:
            break
        if phase == cut and split:
            x = loop.advance(steps[left], x, drive[k], middle[k], acting)
            acting = queue[whole]
            x = loop.advance(steps[step - left], x, middle[k], drive[k + 1], acting)
        else:
            x = loop.advance(steps[step], x, drive[k], drive[k + 1], acting)
    return _dataset(plant, grid + time[0], z, u, at_limit / max(1, math.ceil(total / count)))


class _Flow:
    """The plant between events, with the integrals of what w adds directly to y."""

    def __init__(self, plant: GeneralizedPlant, period: float) -> None:
        n, ny = plant.nx, plant.ny
        self.plain, self.states = n, n + ny
        self.A = np.zeros((n + ny, n + ny))
        self.A[:n, :n] = plant.A
        self.B = np.block([[plant.B1, plant.B2], [plant.D21 / period, np.zeros((ny, plant.nu))]])
        self.see = np.hstack([plant.C1, np.zeros((plant.nz, ny))])
        self.direct = np.hstack([plant.D11, plant.D12])
        self.C2, self.D22 = plant.C2, plant.D22

    def step(self, length: float) -> tuple[Matrix, Matrix, Matrix]:
        return first_order_hold(self.A, self.B, length)

    def advance(
        self, step: tuple[Matrix, Matrix, Matrix], x: Vector, now: Vector, later: Vector, u: Vector
    ) -> Vector:
        first = np.concatenate([now, u])
        return step[0] @ x + step[1] @ first + step[2] @ np.concatenate([later, u])

    def measured(self, x: Vector, acting: Vector) -> Vector:
        """Read the sensors and start a new average."""
        y = self.C2 @ x[: self.plain] + x[self.plain :] + self.D22 @ acting
        x[self.plain :] = 0.0
        return y


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
    for i, name in enumerate(plant.control_names):
        attributes = {**_unit(plant, name), "at_limit": float(at_limit[i])}
        found[name] = ("time", u[:, i], attributes)
    return xr.Dataset(found, coords={"time": ("time", time, {"units": "s"})})


def _unit(plant: GeneralizedPlant, name: str) -> dict[str, str]:
    return {"units": plant.units[name]} if name in plant.units else {}
