"""The observer of a model's linear part, and what known forces leave in its innovations."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robustpolish.arrays import Array
from robustpolish.compiling import njit
from robustpolish.identification.observer.kalman import (
    Level,
    Scales,
    observer_gain,
    with_missing_force,
)
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import port_matrices
from robustpolish.simulation.between import Lines, lines_through
from robustpolish.simulation.step import step_matrices
from robustpolish.simulation.system import NonlinearSystem, build_system


@njit(cache=True, nogil=True)
def _forward(F, Kp, C, drive, direct, Y, s0):  # type: ignore[no-untyped-def]  # compiled
    samples, n = drive.shape
    ny = C.shape[0]
    states = np.empty((samples, n))
    errors = np.empty((samples, ny))
    x = s0.copy()
    new = np.empty(n)
    for k in range(samples):
        for i in range(ny):
            total = Y[k, i] - direct[k, i]
            for j in range(n):
                total -= C[i, j] * x[j]
            errors[k, i] = total
        for i in range(n):
            states[k, i] = x[i]
            total = drive[k, i]
            for j in range(n):
                total += F[i, j] * x[j]
            for j in range(ny):
                total += Kp[i, j] * errors[k, j]
            new[i] = total
        x, new = new, x
    return states, errors


@njit(cache=True, nogil=True)
def _backward(L, CS, P, states, errors):  # type: ignore[no-untyped-def]  # compiled
    samples, n = states.shape
    ny = errors.shape[1]
    smoothed = np.empty((samples, n))
    r = np.zeros(n)
    new = np.empty(n)
    for m in range(samples):
        k = samples - 1 - m
        for i in range(n):
            total = 0.0
            for j in range(ny):
                total += CS[i, j] * errors[k, j]
            for j in range(n):
                total += L[j, i] * r[j]
            new[i] = total
        r, new = new, r
        for i in range(n):
            total = states[k, i]
            for j in range(n):
                total += P[i, j] * r[j]
            smoothed[k, i] = total
    return smoothed


@njit(cache=True, nogil=True)
def _respond(L, C, G0, G1, GK, H, columns, out):  # type: ignore[no-untyped-def]  # compiled
    """Innovations that unit columns of port forces leave, shape (columns, samples, ny)."""
    count, ports, samples = columns.shape
    n, ny = L.shape[0], C.shape[0]
    x, new = np.empty(n), np.empty(n)
    for c in range(count):
        x[:] = 0.0
        for k in range(samples):
            for i in range(ny):
                total = 0.0
                for j in range(n):
                    total += C[i, j] * x[j]
                for j in range(ports):
                    total += H[i, j] * columns[c, j, k]
                out[c, k, i] = total
            if k + 1 == samples:
                break
            for i in range(n):
                total = 0.0
                for j in range(n):
                    total += L[i, j] * x[j]
                for j in range(ports):
                    total += (G0[i, j] - GK[i, j]) * columns[c, j, k]
                    total += G1[i, j] * columns[c, j, k + 1]
                new[i] = total
            x, new = new, x


class PortForces(NamedTuple):
    """Forces along rows of the coordinates: (ports, coordinates), ends, (ports, samples)."""

    rows: Array
    pairs: list[tuple[str, ...]]
    values: Array

    def head(self, samples: int) -> PortForces:
        """Return the first samples."""
        return PortForces(self.rows, self.pairs, self.values[:, :samples])


class LinearObserver:
    """The observer of a model's linear part, other forces being known."""

    def __init__(self, model: MechanicalModel, dt: float, level: Level, scales: Scales) -> None:
        self.model, self.dt = model, dt
        self._steps: dict[object, tuple[Array, Array, Array]] = {}
        plain = build_system(model.without_effects(), dt)
        self.system: NonlinearSystem = with_missing_force(model, plain, scales.leak)
        gain = observer_gain(self.system, dt, level, scales)
        self.gain = gain
        self.m = step_matrices(self.system.A, self.system.B, np.zeros((self.states, 0)), dt)
        self.L = np.ascontiguousarray(self.m.full - gain.predictor @ self.system.C)

    @property
    def states(self) -> int:
        """Number of states, missing forces included."""
        return self.system.A.shape[0]

    def innovations(
        self,
        Y: Array,
        W: Array,
        forces: PortForces | None,
        s0: Array | None = None,
        lines: Lines | None = None,
    ) -> tuple[Array, Array]:
        """Return the predicted states and the innovations, some forces being known.

        `lines` says what the inputs do between the samples, where they are not linear.
        """
        begin, end = lines or lines_through(W)
        drive = np.zeros((len(Y), self.states))
        drive[:-1] = begin[:-1] @ self.m.full_now.T + end[:-1] @ self.m.full_later.T
        direct = W @ self.system.D.T
        if forces is not None:
            G0, G1, H = self.port_steps(forces.rows, forces.pairs)
            with np.errstate(over="ignore", invalid="ignore"):  # along a motion that diverged
                drive[:-1] += (G0 @ forces.values[:, :-1] + G1 @ forces.values[:, 1:]).T
                direct = direct + (H @ forces.values).T
        start = np.zeros(self.states) if s0 is None else s0
        return _forward(
            self.m.full, self.gain.predictor, self.system.C, drive, direct,
            np.ascontiguousarray(Y), start,
        )  # fmt: skip

    def port_steps(self, rows: Array, pairs: list[tuple[str, ...]]) -> tuple[Array, Array, Array]:
        """Return the step matrices of forces along rows of the coordinates."""
        key = (rows.tobytes(), tuple(pairs))
        if key not in self._steps:
            self._steps[key] = self._port_steps(rows, pairs)
        return self._steps[key]

    def _port_steps(self, rows: Array, pairs: list[tuple[str, ...]]) -> tuple[Array, Array, Array]:
        G, H, _ = port_matrices(self.model, rows, pairs)
        G = np.vstack([G, np.zeros((self.states - len(G), len(rows)))])
        m = step_matrices(self.system.A, G, np.zeros((self.states, 0)), self.dt)
        return m.full_now, m.full_later, np.ascontiguousarray(H)

    def smooth(self, states: Array, errors: Array) -> Array:
        """Return the smoothed states (de Jong's recursion)."""
        CS = np.ascontiguousarray(np.linalg.solve(self.gain.innovation, self.system.C).T)
        return _backward(self.L, CS, np.ascontiguousarray(self.gain.covariance), states, errors)

    def respond(self, rows: Array, pairs: list[tuple[str, ...]], columns: Array) -> Array:
        """Return the innovations that port forces leave, shape (columns, samples, ny)."""
        G0, G1, H = self.port_steps(rows, pairs)
        out = np.empty((columns.shape[0], columns.shape[2], self.system.C.shape[0]))
        _respond(
            self.L, self.system.C, G0, G1, np.ascontiguousarray(self.gain.predictor @ H), H,
            np.ascontiguousarray(columns), out,
        )  # fmt: skip
        return out

    def respond_outputs(self, columns: Array) -> Array:
        """Return the innovations that additions to the outputs leave.

        `columns` has shape (columns, ny, samples).
        """
        ny = columns.shape[1]
        zero = np.zeros((self.states, ny))
        out = np.empty((columns.shape[0], columns.shape[2], ny))
        _respond(
            self.L, self.system.C, zero, zero, np.ascontiguousarray(self.gain.predictor),
            np.eye(ny), np.ascontiguousarray(columns), out,
        )  # fmt: skip
        return out

    def likeliest_start(self, errors: Array, sizes: Array) -> Array:
        """Return the state at the first sample, from the innovations of a start at zero.

        `sizes` holds what the displacements and velocities may be at most, roughly; infinite
        where nothing is known.
        """
        columns = self.respond_start(len(errors))
        root = np.linalg.cholesky(np.linalg.inv(self.gain.innovation))
        X = (columns @ root).reshape(len(columns), -1)
        size = np.sqrt(np.sum(X**2, axis=1))
        size[size == 0] = 1.0
        X = X / size[:, None]
        variance = np.diag(self.gain.covariance)[2 * len(self.model.free) :]
        known = 1 / np.maximum(np.concatenate([sizes**2, variance]), 1e-300)
        gram = X @ X.T + np.diag(known / size**2)
        return np.linalg.lstsq(gram, X @ (errors @ root).ravel(), rcond=1e-10)[0] / size

    def respond_start(self, samples: int) -> Array:
        """Return the innovations that a unit of each state at the start leaves."""
        n = self.states
        out = np.empty((n, samples, self.system.C.shape[0]))
        power = np.eye(n)
        for k in range(samples):
            out[:, k, :] = (self.system.C @ power).T
            power = self.L @ power
            if np.max(np.abs(power)) < 1e-12:
                out[:, k + 1 :, :] = 0.0
                break
        return out
