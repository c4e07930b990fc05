"""Simulate a mechanical model with its physical effects."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from robustpolish.effects import Effect
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.parts import DISPLACEMENT
from robustpolish.simulation.step import run
from robustpolish.simulation.system import NonlinearSystem, build_system, port_rows
from robustpolish.validation import described, invalid, matrix

Array = NDArray[np.float64]
_MOST_SUBSTEPS = 32


class NonlinearResponse(NamedTuple):
    """Outputs (samples, ny), states (samples, n) and internal states of effects (samples, nz)."""

    outputs: Array
    states: Array
    internal: Array


def simulate(
    model: MechanicalModel,
    data: xr.Dataset,
    initial_state: ArrayLike | None = None,
    internal_state: ArrayLike | None = None,
    substeps: int | None = None,
) -> NonlinearResponse:
    """Run a model freely on measured inputs.

    Parameters
    ----------
    model : MechanicalModel
    data : xarray.Dataset
        Uniform ``time`` in s and the model's inputs by name, in SI units. Outputs are used
        only for their amplitude, which decides on substeps.
    initial_state : array_like, shape (n,), optional
        Free displacements, then their velocities; zero by default.
    internal_state : array_like, shape (nz,), optional
        Internal states of the effects; zero by default.
    substeps : int, optional
        Steps per sample; chosen from the effects' stiffness by default.

    Returns
    -------
    NonlinearResponse

    Raises
    ------
    InvalidInputError
        If an input is missing or a state has the wrong size.

    Examples
    --------
    >>> import numpy as np, xarray as xr
    >>> import robustpolish as rp
    >>> model = rp.MechanicalModel(
    ...     [rp.Dof("x", 1.0)],
    ...     [rp.Spring(("x", "ground"), 4.0)],
    ...     outputs=[rp.Output("x", ("x", "ground"))],
    ... )
    >>> data = xr.Dataset(coords={"time": np.arange(101) * 0.01})
    >>> response = simulate(model, data, initial_state=[1.0, 0.0])
    >>> bool(np.allclose(response.outputs[:, 0], np.cos(2 * data.time)))
    True
    """
    time = np.asarray(data["time"].values, dtype=float)
    dt = (time[-1] - time[0]) / max(time.size - 1, 1)
    W = signals(model, data)
    n = substeps or needed_substeps(model, dt, _output_amplitudes(model, data))
    system = build_system(model, dt / n)
    s0 = _state("initial_state", initial_state, system.states)
    z0 = _state("internal_state", internal_state, system.internal)
    outputs, states, internal = free_run(system, W, dt, n, s0, z0, time[0])
    return NonlinearResponse(measured(model, outputs), states, internal)


def free_run(
    system: NonlinearSystem, W: Array, dt: float, substeps: int, s0: Array, z0: Array, t0: float
) -> tuple[Array, Array, Array]:
    """Step a system without feedback; outputs are before sensor gains and offsets."""
    ny = system.C.shape[0]
    return run(
        system.steps(dt / substeps), system.motion, (system.C, system.D, system.H), system.laws,
        system.layout, system.values, W, np.zeros((1, ny)), np.zeros((system.states, ny)),
        s0, z0, t0, dt, substeps, True,
    )  # fmt: skip


def _state(argument: str, value: ArrayLike | None, size: int) -> Array:
    if value is None:
        return np.zeros(size)
    return matrix(argument, np.reshape(np.asarray(value, dtype=float), (1, -1)), (1, size))[0]


def signals(model: MechanicalModel, data: xr.Dataset) -> Array:
    """Return the columns of `MechanicalMatrices.signals`, effects on inputs applied."""
    for name in model.input_names:
        if name not in data:
            raise invalid(
                "data", described(f"no column {name!r}"), "every input", "Check the column names."
            )
    time = np.asarray(data["time"].values, dtype=float)
    m = model.matrices
    columns = [np.asarray(data[name].values, dtype=float) for name in m.force_inputs]
    for name, coordinate, quantity, _ in m.imposed_signals:
        if name in data:
            columns.append(np.asarray(data[name].values, dtype=float))
            continue
        base = next(
            i.name for i in model.inputs
            if i.imposes == DISPLACEMENT and i.on[0] == m.coordinates[coordinate]
        )  # fmt: skip
        order = 1 if quantity == "velocity" else 2
        columns.append(CubicSpline(time, data[base].values)(time, order))
    W = np.column_stack(columns) if columns else np.zeros((time.size, 0))
    for added in model.effects:
        effect = Effect(added.kind, added.at, added.parameters)
        if effect.definition.domain == "input":
            _change_input(W, m.signals, time, effect)
    return np.ascontiguousarray(W)


def _change_input(W: Array, names: tuple[str, ...], time: Array, effect: Effect) -> None:
    values = effect.values
    for j, name in enumerate(names):
        if name.removesuffix("_dot").removesuffix("_ddot") != effect.at[0]:
            continue
        W[:, j] *= values.get("gain", 1.0)
        W[:, j] = _held(W[:, j], values.get("order", 1.0))
        if values.get("delay"):
            late = np.maximum(time - values["delay"], time[0])
            W[:, j] = CubicSpline(time, W[:, j])(late)


def _held(u: Array, order: float) -> Array:
    """Return the record whose linear interpolation acts like `u` with another hold."""
    if order == 1.0:
        return u
    padded = np.concatenate([u[:1], u[:1], u, u[-1:], u[-1:]])
    far, last, now, later, farther = (padded[i : i + u.size] for i in range(5))
    if order == 0.0:
        return (7 * (now + last) - later - far) / 12
    second = last - 2 * now + later
    fourth = far - 4 * last + 6 * now - 4 * later + farther
    return now - second / 12 + fourth / 90


def measured(model: MechanicalModel, outputs: Array) -> Array:
    """Apply the effects on outputs: gains, then offsets."""
    result = outputs.copy()
    for added in model.effects:
        effect = Effect(added.kind, added.at, added.parameters)
        if effect.definition.domain == "output":
            j = model.output_names.index(effect.at[0])
            values = effect.values
            result[:, j] = result[:, j] * values.get("gain", 1.0) + values.get("offset", 0.0)
    return result


def raw_outputs(model: MechanicalModel, Y: Array) -> Array:
    """Take the gains and offsets of the effects on outputs out of measured outputs."""
    if not any(e.kind.startswith("sensor_") for e in model.effects):
        return Y
    zero = measured(model, np.zeros((1, Y.shape[1])))
    gain = measured(model, np.ones((1, Y.shape[1]))) - zero
    return np.ascontiguousarray((Y - zero) / np.where(gain == 0, 1.0, gain))


def _output_amplitudes(model: MechanicalModel, data: xr.Dataset) -> float:
    """Return the largest displacement amplitude in the data, 0 if none is measured."""
    shown = [
        float(np.percentile(np.abs(data[o.name].values), 99))
        for o in model.outputs
        if o.name in data and o.quantity == DISPLACEMENT
    ]
    return max(shown, default=0.0)


def needed_substeps(model: MechanicalModel, dt: float, amplitude: float) -> int:
    """Return steps per sample that resolve the effects' own stiffness and damping.

    Parameters
    ----------
    model : MechanicalModel
    dt : float
        Sampling step in s.
    amplitude : float
        Displacement amplitude in m or rad.
    """
    if not model.effects:
        return 1
    fastest, least = 0.0, 1
    m = model.matrices
    omega = np.sqrt(max(np.max(np.abs(np.diag(m.K) / np.maximum(np.diag(m.M), 1e-300))), 0.0))
    for added in model.effects:
        effect = Effect(added.kind, added.at, added.parameters)
        if effect.definition.law is None:
            continue
        stiffness, damping, rate = effect.definition.gains(
            effect.values, amplitude, min(omega, 1 / dt) * amplitude
        )
        inverse = np.sum(port_rows(model, effect)[:, m.free] ** 2 / np.diag(m.M)[m.free])
        fastest = max(
            fastest, np.sqrt(abs(stiffness) * inverse), abs(damping) * inverse, 0.3 * rate
        )
        least = max(least, 4 if effect.definition.sharp else 2)
    return int(np.clip(np.ceil(2.0 * dt * fastest), least, _MOST_SUBSTEPS))
