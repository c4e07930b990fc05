"""Linear observers with a missing force: how strongly a model is led by the data.

The linear part of a model is augmented with a leaking random-walk force at every place
where a force can be missing. The level of that force decides how much of a prediction
error is taken for a missing force: at level 0 the model runs freely.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.parts import FORCE
from robustpolish.models.mechanical.ports import port_matrices
from robustpolish.simulation.step import step_matrices
from robustpolish.simulation.system import NonlinearSystem

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Scales:
    """Sizes that the observers need; none of them is absolute.

    Attributes
    ----------
    noise : ndarray, shape (ny,)
        Standard deviation of the sensor noise.
    force : ndarray, shape (sites,)
        Typical size of the forces at each site.
    inputs : ndarray, shape (signals,)
        Standard deviation of each input signal.
    bandwidth : float
        Excited bandwidth in rad/s.
    leak : float
        Rate in 1/s at which a missing force is forgotten.
    """

    noise: Array
    force: Array
    inputs: Array
    bandwidth: float
    leak: float


@dataclass(frozen=True)
class Level:
    """Strength of the missing force and of noise on the inputs, as shares of their sizes."""

    force: float = 0.0
    input_noise: float = 0.0

    @property
    def free(self) -> bool:
        """Whether the observer does not follow the data at all."""
        return self.force == 0 and self.input_noise == 0


def force_sites(model: MechanicalModel) -> tuple[Array, list[tuple[str, ...]]]:
    """Return rows and names of the places where a force may be missing.

    These are the free coordinates, and the pairs of imposed ones whose force is measured.
    """
    names = model.dof_names
    rows, pairs = [], []
    for name in model.free:
        rows.append(np.eye(len(names))[names.index(name)])
        pairs.append((name, "ground"))
    free = set(model.free)
    for output in model.outputs:
        if output.quantity == FORCE and not free.intersection(output.of):
            row = np.zeros(len(names))
            row[names.index(output.of[0])] = 1.0
            rows.append(row)
            pairs.append(output.of if not output.drive else (output.of[0], "ground"))
    return np.array(rows).reshape(-1, len(names)), pairs


def with_missing_force(
    model: MechanicalModel, system: NonlinearSystem, leak: float
) -> NonlinearSystem:
    """Append the missing forces to the states of a system."""
    rows, pairs = force_sites(model)
    G, H, _ = port_matrices(model, rows, pairs)
    n, s, w = system.states, len(rows), system.B.shape[1]
    ports = system.G.shape[1]
    A = np.block([[system.A, G], [np.zeros((s, n)), -leak * np.eye(s)]])
    Qs, Qw, Vs, Vw = system.motion
    pad = np.zeros((ports, s))
    return replace(
        system,
        A=np.ascontiguousarray(A),
        B=np.ascontiguousarray(np.vstack([system.B, np.zeros((s, w))])),
        C=np.ascontiguousarray(np.hstack([system.C, H])),
        G=np.ascontiguousarray(np.vstack([system.G, np.zeros((s, ports))])),
        motion=(
            np.ascontiguousarray(np.hstack([Qs, pad])), Qw,
            np.ascontiguousarray(np.hstack([Vs, pad])), Vw,
        ),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Gain:
    """Steady-state gains: `filter` corrects the state, `predictor` the next one."""

    filter: Array
    predictor: Array
    innovation: Array
    covariance: Array


def observer_gain(system: NonlinearSystem, dt: float, level: Level, scales: Scales) -> Gain:
    """Return the steady-state Kalman gain of an augmented system at a level."""
    ny, n, s = system.C.shape[0], system.states, scales.force.size
    R = np.diag(scales.noise**2)
    if level.free:
        zero = np.zeros((n, ny))
        return Gain(zero, zero, R, np.zeros((n, n)))
    m = step_matrices(system.A, system.B, np.zeros((n, 0)), dt)
    leak = scales.leak
    Q = np.zeros((n, n))
    # At level 1 the force wanders by its typical size within one radian of the bandwidth.
    size = np.sqrt(scales.bandwidth / leak) * max(level.force, 1e-7) * scales.force
    walk = (1 - np.exp(-2 * leak * dt)) * size**2
    Q[n - s :, n - s :] = np.diag(walk)
    into = (m.full_now + m.full_later) * (level.input_noise * scales.inputs)
    through = system.D * (level.input_noise * scales.inputs)
    Q += into @ into.T
    R = R + through @ through.T
    P = riccati(m.full, system.C, Q, R, into @ through.T)
    S = system.C @ P @ system.C.T + R
    predictor = np.linalg.solve(S, (m.full @ P @ system.C.T + into @ through.T).T).T
    corrector = np.linalg.solve(m.full, predictor)
    return Gain(corrector.astype(float), predictor.astype(float), S, P)


def riccati(F: Array, C: Array, Q: Array, R: Array, N: Array) -> Array:
    """Solve the filter's discrete Riccati equation by doubling, states and outputs scaled.

    Structure-preserving doubling: Chu, Fan, Lin, Wang (2004), Int. J. Control 77(8), 767-788.
    """
    F = F - N @ np.linalg.solve(R, C)
    Q = Q - N @ np.linalg.solve(R, N.T)
    n = len(F)
    A, G = F.T.copy(), C.T @ np.linalg.solve(R, C)
    scale = np.sqrt(np.maximum(np.diag(G), 1e-300 + 1e-24 * np.max(np.diag(G))))
    # in the scaled states the information of one sample is at most one
    A = A / scale[:, None] * scale
    G = G / np.outer(scale, scale)
    P = Q * np.outer(scale, scale)
    eye = np.eye(n)
    for _ in range(60):
        W = eye + G @ P
        VA = np.linalg.solve(W, A)
        change = A.T @ P @ VA
        G = G + A @ np.linalg.solve(W, G @ A.T)
        P = P + change
        A = A @ VA
        P, G = (P + P.T) / 2, (G + G.T) / 2
        if np.max(np.abs(np.diag(change))) <= 1e-12 * np.max(np.abs(np.diag(P))):
            break
    return P / np.outer(scale, scale)
