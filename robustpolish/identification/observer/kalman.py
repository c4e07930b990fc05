"""The Kalman filter of a model with missing forces: how strongly the data lead it, and its gain.

The linear part of a model is augmented with a leaking random-walk force at every place
where a force can be missing. The level of that force decides how much of a prediction
error is taken for a missing force: at level 0 the model runs freely.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.signal import welch

from robustpolish.base.arrays import Array
from robustpolish.base.jit import njit
from robustpolish.identification.record import Record, poles_of
from robustpolish.linear.response import linear_recursion
from robustpolish.machines.mechanical.data import linear_model, port_matrices, port_row
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import ACCELERATION, DISPLACEMENT, FORCE, VELOCITY
from robustpolish.machines.simulation import (
    IntersampleLines,
    NonlinearSystem,
    build_system,
    linear_interpolation,
)
from robustpolish.machines.stepper import step_matrices

_QUIETEST = 1e-5
# Share of the highest density up to which a spectrum may be leakage of its window.
_LEAKS = 1e-4
# Times the noise floor of a spectrum that a motion has to stand above.
ABOVE_FLOOR = 3.0
# Error of the observer's equation, as a share of its solution, from which it is none.
_UNSOLVED = 1e-2
# Of a sensor that counts in steps: share of a step by which distances between values may be off
# whole numbers of them, share of the range below which values are the same, and distances needed.
_OFF, _SAME, _FEWEST = 0.02, 1e-9, 8
# A force that lasts cannot be told from a displacement by a sensor that does not see one.
_USUAL, _PEAK = 98.0, 4.0
"""Percentile of a motion that is its amplitude, and times by which its peak is larger at most:
beyond is a spike, or what an observer makes of drifting accelerometers."""
_LEAK = {VELOCITY: 20.0, ACCELERATION: 4.0}


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
    rounded : ndarray, shape (ny,)
        Standard deviation of what sensors round away that count in steps.
    amplitude : float
        Of displacements, in m or rad.
    """

    noise: Array
    force: Array
    inputs: Array
    bandwidth: float
    leak: float
    rounded: Array
    amplitude: float


@dataclass(frozen=True)
class Level:
    """Strength of the missing force and of noise on the inputs, as shares of their sizes."""

    force: float = 0.0
    input_noise: float = 0.0

    @property
    def free(self) -> bool:
        """Whether the observer does not follow the data at all."""
        return self.force == 0 and self.input_noise == 0


FREE = Level()
"""A free run: the data lead nowhere."""


def force_sites(model: MechanicalModel) -> tuple[Array, list[tuple[str, ...]]]:
    """Return rows and names of the places where a force may be missing.

    These are the free coordinates, and the pairs of imposed ones whose force is measured.
    """
    moved = model.frame.multiples
    pairs = [(name, "ground") for name in model.free] + [
        output.of if not output.drive else (output.of[0], "ground")
        for output in model.outputs
        if output.quantity == FORCE
        and not any(name in moved and moved[name][0] in model.free for name in output.of)
    ]
    return np.array([port_row(model, pair[:1]) for pair in pairs]), pairs


def with_missing_force(
    model: MechanicalModel, system: NonlinearSystem, leak: float
) -> NonlinearSystem:
    """Append the missing forces to the states of a system."""
    rows, pairs = force_sites(model)
    G, H, _ = port_matrices(model.matrices, model.outputs, rows, pairs)
    n, s, w = system.states, len(rows), system.B.shape[1]
    ports = system.G.shape[1]
    A = np.block([[system.A, G], [np.zeros((s, n)), -leak * np.eye(s)]])
    Qs, Qw, Vs, Vw = system.motion
    pad = np.zeros((ports, s))
    return replace(
        system,
        A=A,
        B=np.vstack([system.B, np.zeros((s, w))]),
        C=np.hstack([system.C, H]),
        G=np.vstack([system.G, np.zeros((s, ports))]),
        motion=(np.hstack([Qs, pad]), Qw, np.hstack([Vs, pad]), Vw),
    )


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
    # At level 1 the force wanders by its typical size within one radian of the bandwidth.
    size = np.sqrt(scales.bandwidth / scales.leak) * max(level.force, 1e-7) * scales.force
    Q = np.zeros((n, n))
    Q[n - s :, n - s :] = np.diag((1 - np.exp(-2 * scales.leak * dt)) * size**2)
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

    Raises
    ------
    numpy.linalg.LinAlgError
        If rounding leaves no solution, as with forces without proportion to the motion.
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
    found = P / np.outer(scale, scale)
    gain = np.linalg.solve(C @ found @ C.T + R, C @ found @ F.T)
    error = (F @ found @ F.T - (F @ found @ C.T) @ gain + Q - found) * np.outer(scale, scale)
    if not np.max(np.abs(error)) <= _UNSOLVED * np.max(np.abs(P)):
        raise np.linalg.LinAlgError("the observer's equation has no solution within rounding")
    return found


def scales_of(model: MechanicalModel, record: Record) -> Scales:
    """Return the sizes that an observer of this record needs."""
    W, m = record.own(record.signals(model)), model.matrices
    rounded = np.array([rounding(y) for y in record.Y.T])
    noise = np.ones(len(rounded))
    for i, least in enumerate(rounded):
        # of several records the one with the least motion shows it; and where a sensor counts in
        # steps, what stands still shows less noise than what moves
        moving = [part.Y[:, i] for part in record.parts if np.ptp(part.Y[:, i]) > 0]
        seen = (white_noise(y, record.dt, record.honest) for y in moving)
        noise[i] = max(min(seen, default=1.0), least)
    bandwidth = excited_bandwidth(model, record)
    amplitude = displacement_amplitude(model, record, bandwidth)
    # motions and forces of unlike coordinates that a ratio joins are compared as shares of the
    # travel of each: as if all were referred to one side
    travel = model.frame.travel
    forces = W[:, : m.B.shape[1]] @ m.B.T * model.frame.sizes
    driving = float(np.sqrt(np.mean(np.sum(forces**2, axis=1)))) if forces.size else 0.0
    rows, sites = force_sites(model)
    measured = [
        float(np.std(y)) * travel(o.of)
        for y, o in zip(record.Y.T, model.outputs, strict=True)
        if o.quantity == FORCE
    ]
    if driving > 0 or measured:
        force = (driving or max(measured)) / np.array([travel(site) for site in sites])
    else:
        elastic = np.abs(np.diag(m.K)) + np.diag(m.M) * bandwidth**2 / 4
        elastic = elastic * model.frame.sizes
        force = np.array([abs(row) @ elastic for row in rows]) * amplitude / np.sqrt(2)
    leak = bandwidth / max(_LEAK.get(o.quantity, 60.0) for o in model.outputs)
    force, inputs = np.maximum(force, 1e-300), np.std(W, axis=0)
    return Scales(noise, force, inputs, bandwidth, leak, rounded, amplitude)


def white_noise(y: Array, dt: float, honest: float = 1.0) -> float:
    """Return the standard deviation of white noise that the quietest band allows for.

    Parameters
    ----------
    y : ndarray, shape (samples,)
    dt : float
        Sampling step in s.
    honest : float, optional
        Share of half the sampling rate in which bands are looked at, see :class:`Record`.
    """
    y = y - np.mean(y)
    total = float(np.std(y))
    if total == 0:
        return 1.0
    _, density = welch(y, 1 / dt, nperseg=min(256, len(y) // 4), detrend="linear")
    density = density[: round(honest * (density.size - 1)) + 1]
    bands = np.array_split(density[1:], min(16, density.size - 1))
    lowest = min(float(np.mean(band)) for band in bands)
    return max(float(np.sqrt(lowest * 0.5 / dt)), _QUIETEST * total)


def rounding(y: Array) -> float:
    """Return the standard deviation of what rounding to the steps of a sensor does to its signal.

    Parameters
    ----------
    y : ndarray, shape (samples,)

    Returns
    -------
    float
        A step over the square root of 12; 0 if the values lie on no grid.

    Examples
    --------
    >>> y = np.round(np.sin(np.arange(100.0)), 1)
    >>> round(rounding(y) * 12**0.5, 6)
    0.1
    >>> rounding(np.sin(np.arange(100.0)))
    0.0
    """
    distances = np.diff(np.unique(y))
    distances = distances[distances > _SAME * np.ptp(y)] if distances.size else distances
    if distances.size < _FEWEST:
        return 0.0
    step = float(np.min(distances))
    step = float(np.mean(distances[distances < 1.5 * step]))
    counts = distances / step
    if np.max(np.abs(counts - np.round(counts))) > _OFF:
        return 0.0
    return step / float(np.sqrt(12))


def excited_bandwidth(model: MechanicalModel, record: Record) -> float:
    """Return the frequency in rad/s below which the motion happens.

    A machine without inputs swings no slower than its slowest mode: what creeps behind a law that
    nearly holds it is no motion to go by.
    """
    poles = poles_of(model)
    swinging = np.abs(poles[np.imag(poles) > 0])
    highest = 0.0 if model.inputs else float(np.min(swinging, initial=np.inf))
    highest = highest if np.isfinite(highest) else 0.0
    for i, output in enumerate(model.outputs):
        frequency, density = _spectrum(record, i)
        shown = motion_bandwidth(output.quantity, frequency, density)
        highest = max(highest, 2 * np.pi * shown)
    return highest or 0.2 / record.dt


def motion_bandwidth(quantity: str, frequency: Array, density: Array) -> float:
    """Return the frequency in Hz below which the displacement lies that a spectrum shows.

    What leaks from a strong line towards zero frequency would pass for a large displacement.
    """
    order = {DISPLACEMENT: 0, VELOCITY: 2, ACCELERATION: 4}.get(quantity, 0)
    floor = max(np.percentile(density, 10), _LEAKS * np.max(density))
    seen = np.maximum(density[1:] - ABOVE_FLOOR * floor, 0) / frequency[1:] ** order
    return power_bandwidth(frequency[1:], seen, 0.98)


def power_bandwidth(frequency: Array, density: Array, share: float) -> float:
    """Return the frequency below which this share of the power lies, 0 if there is none."""
    power = np.cumsum(density)
    if not power.size or not power[-1] > 0:
        return 0.0
    return float(frequency[np.searchsorted(power, share * power[-1])])


def _spectrum(record: Record, i: int) -> tuple[Array, Array]:
    """Return frequencies in Hz and the density of an output, the mean over all records."""
    parts = record.parts
    lines = min(2048, max(max(part.samples for part in parts) // 2, 1))
    total: Array = np.zeros(lines // 2 + 1)
    for part in parts:
        length = min(lines, max(part.samples // 2, 1))
        _, density = welch(part.Y[:, i], 1 / record.dt, nperseg=length, nfft=lines)
        total += part.samples / record.samples * density
    return np.arange(total.size) / (lines * record.dt), total


def displacement_amplitude(
    model: MechanicalModel, record: Record, bandwidth: float, percentile: float = _USUAL
) -> float:
    """Return a displacement amplitude from outputs or imposed motions: a share of `travels`."""
    found = []
    for output, y in zip(model.outputs, record.Y.T, strict=True):
        order = {DISPLACEMENT: 0, VELOCITY: 1, ACCELERATION: 2}.get(output.quantity)
        if order is not None:
            away = np.abs(y - np.median(y))
            scale = bandwidth**order * model.frame.travel(output.of)
            found.append(float(np.percentile(away, percentile)) / scale)
    for item in model.inputs:
        if item.imposes == DISPLACEMENT and item.on[0] not in model.channels:
            imposed = np.abs(record.data[item.name].values) / model.frame.travel(item.on)
            found.append(float(np.percentile(imposed, percentile)))
    return max(found, default=0.0)


def displacement_peak(
    model: MechanicalModel, record: Record, bandwidth: float, smoothed: Array | None = None
) -> float:
    """Return the largest displacement: steps have to resolve laws there, too.

    Parameters
    ----------
    model : MechanicalModel
    record : Record
    bandwidth : float
        In rad/s.
    smoothed : ndarray, optional
        Displacements that an observer made of the record: accelerometers tell none.
    """
    smoothed = np.zeros(0) if smoothed is None else smoothed / model.frame.sizes[:, None]
    moved = float(np.max(np.abs(smoothed), initial=0.0))
    usual = displacement_amplitude(model, record, bandwidth)
    return min(max(displacement_amplitude(model, record, bandwidth, 100.0), moved), _PEAK * usual)


# The observer of a model's linear part, and what known forces leave in its innovations.


@njit(cache=True, nogil=True)
def _respond(L, C, G0, G1, GK, H, columns, out):  # type: ignore[no-untyped-def]  # compiled
    """Innovations that unit columns (samples, ports, columns) of port forces leave."""
    samples, ports, count = columns.shape
    n, ny = L.shape[0], C.shape[0]
    x, new = np.zeros((n, count)), np.empty((n, count))
    # the innermost loops go over the columns: processors take several at a time
    for k in range(samples):
        for i in range(ny):
            y = out[k, i]
            y[:] = 0.0
            for j in range(n):
                w, xj = C[i, j], x[j]
                if w != 0.0:
                    for c in range(count):
                        y[c] += w * xj[c]
            for j in range(ports):
                w, u = H[i, j], columns[k, j]
                if w != 0.0:
                    for c in range(count):
                        y[c] += w * u[c]
        if k + 1 == samples:
            break
        for i in range(n):
            xi = new[i]
            xi[:] = 0.0
            for j in range(n):
                w, xj = L[i, j], x[j]
                for c in range(count):
                    xi[c] += w * xj[c]
            for j in range(ports):
                now, later = G0[i, j] - GK[i, j], G1[i, j]
                u, ahead = columns[k, j], columns[k + 1, j]
                for c in range(count):
                    xi[c] += now * u[c] + later * ahead[c]
        x, new = new, x


class PortForces(NamedTuple):
    """Forces along rows of the coordinates: (ports, coordinates), ends, (ports, samples)."""

    rows: Array
    pairs: list[tuple[str, ...]]
    values: Array


class LinearObserver:
    """The observer of a model's linear part, other forces being known."""

    def __init__(self, model: MechanicalModel, dt: float, level: Level, scales: Scales) -> None:
        self.model, self.dt = model, dt
        self._steps: dict[object, tuple[Array, Array, Array]] = {}
        plain = build_system(linear_model(model), dt)
        self.system: NonlinearSystem = with_missing_force(model, plain, scales.leak)
        self.gain = observer_gain(self.system, dt, level, scales)
        self.m = step_matrices(self.system.A, self.system.B, np.zeros((self.states, 0)), dt)
        self.L = self.m.full - self.gain.predictor @ self.system.C

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
        lines: IntersampleLines | None = None,
    ) -> tuple[Array, Array]:
        """Return the predicted states and the innovations, some forces being known.

        `lines` says what the inputs do between the samples, where they are not linear.
        """
        begin, end = lines or linear_interpolation(W)
        drive = np.zeros((len(Y), self.states))
        drive[:-1] = begin[:-1] @ self.m.full_now.T + end[:-1] @ self.m.full_later.T
        seen = Y - W @ self.system.D.T
        with np.errstate(over="ignore", invalid="ignore"):  # along a motion that diverged
            if forces is not None:
                G0, G1, H = self.port_steps(forces.rows, forces.pairs)
                drive[:-1] += (G0 @ forces.values[:, :-1] + G1 @ forces.values[:, 1:]).T
                seen = seen - (H @ forces.values).T
            drive += seen @ self.gain.predictor.T
            states = linear_recursion(self.L, drive[:-1], s0)
            return states, seen - states @ self.system.C.T

    def port_steps(self, rows: Array, pairs: list[tuple[str, ...]]) -> tuple[Array, Array, Array]:
        """Return the step matrices of forces along rows of the coordinates."""
        key = (rows.tobytes(), tuple(pairs))
        if key not in self._steps:
            G, H, _ = port_matrices(self.model.matrices, self.model.outputs, rows, pairs)
            G = np.vstack([G, np.zeros((self.states - len(G), len(rows)))])
            m = step_matrices(self.system.A, G, np.zeros((self.states, 0)), self.dt)
            self._steps[key] = m.full_now, m.full_later, np.ascontiguousarray(H)
        return self._steps[key]

    def smooth(self, states: Array, errors: Array) -> Array:
        """Return the smoothed states (de Jong's recursion, backwards)."""
        by_sample = np.linalg.solve(self.gain.innovation, self.system.C)
        ahead = linear_recursion(self.L.T, (errors @ by_sample)[::-1])[:0:-1]
        return states + ahead @ self.gain.covariance

    def respond(self, rows: Array, pairs: list[tuple[str, ...]], columns: Array) -> Array:
        """Return the innovations that port forces leave, shape (columns, samples, ny)."""
        return self._respond(*self.port_steps(rows, pairs), columns)

    def respond_outputs(self, columns: Array) -> Array:
        """Return the innovations that additions to the outputs leave.

        `columns` has shape (columns, ny, samples).
        """
        zero = np.zeros((self.states, columns.shape[1]))
        return self._respond(zero, zero, np.eye(columns.shape[1]), columns)

    def _respond(self, G0: Array, G1: Array, H: Array, columns: Array) -> Array:
        C, GK = self.system.C, np.ascontiguousarray(self.gain.predictor @ H)
        out = np.empty((columns.shape[2], C.shape[0], columns.shape[0]))
        forces = np.ascontiguousarray(columns.transpose(2, 1, 0))
        _respond(self.L, C, G0, G1, GK, H, forces, out)
        return out.transpose(2, 0, 1)

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
        seen, power = self.system.C[None], self.L
        while len(seen) < samples:  # C, C L, C L^2, ..., twice as many in each round
            seen, power = np.concatenate([seen, seen @ power]), power @ power
        return np.moveaxis(seen[:samples], 2, 0)
