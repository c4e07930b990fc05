"""A period in coordinates that suit doubles: states of the flow and at the samples, rescaled."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import control
import numpy as np
from scipy import linalg

from robustpolish.base.arrays import ROUNDING, SAME, Matrix, Vector
from robustpolish.base.checks import misfit
from robustpolish.errors import InvalidInputError
from robustpolish.linear.scaling import border_scale
from robustpolish.linear.systems import named_system
from robustpolish.plants.blocks import matrices_of
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.wired import Wiring

# Delays of the plant that every signal round a sampled loop meets, taken as they are.


def without_loop_delay(plant: GeneralizedPlant) -> tuple[GeneralizedPlant, float]:
    """Return the plant without what delays all its controls, or all its measurements, alike.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous.

    Returns
    -------
    plant : GeneralizedPlant
        What is left of its delays are lines as before.
    seconds : float
        The delay that was taken out, for the sampled loop to have between sample and control.

    Notes
    -----
    A hold that is read late by a delay is a hold that acts late. A sampler that reads late by a
    delay samples at earlier instants, and a loop whose clock is shifted has the same poles and
    norms. An output that shows nothing but a control, and a disturbance that is nothing but noise
    of the readings, are shifted in time themselves, which changes no energy.
    """
    wiring, total = plant.wiring, 0.0
    for side in ("control", "measurement"):
        count = wiring.nu if side == "control" else wiring.ny
        chains = [_chain(wiring, side, i) for i in range(count)]
        delays = [sum(wiring.lines[i].seconds for i in chain) for chain in chains]
        common = min(delays, default=0.0)
        if common <= 0:
            continue
        last = {chain[-1]: delay for chain, delay in zip(chains, delays, strict=True)}
        # Of each chain that is longer than the others one line stays, with what it has more.
        kept = {
            i: delay - common for i, delay in last.items() if delay - common > ROUNDING * common
        }
        lines = tuple(
            replace(line, seconds=kept.get(i, line.seconds)) for i, line in enumerate(wiring.lines)
        )
        wiring = replace(wiring, lines=lines)
        for i in sorted({i for chain in chains for i in chain} - kept.keys(), reverse=True):
            wiring = _without_line_delay(wiring, i)
        total += common
    if not total:
        return plant, 0.0
    left: dict[str, float] = {}
    for line in wiring.lines:
        left[line.name] = left.get(line.name, 0.0) + line.seconds
    return plant.rewired(wiring, delays=left), total


def _chain(wiring: Wiring, side: str, signal: int) -> list[int]:
    """Return the lines that a signal runs through with nothing else between, from outside in."""
    _, B, C, D = wiring.arrays()
    k = len(wiring.lines)
    w, z = wiring.nw - k, wiring.nz - k
    if side == "measurement":  # the same question about the transposed system
        B, C, D = C.T, B.T, D.T
        w, z = z, w
    at, found = w + k + signal, []
    while True:
        line = _only_line(B, C, D, at, w, z, k)
        if line is None or line in found:
            return found
        found.append(line)
        at = w + line


def _only_line(B: Matrix, C: Matrix, D: Matrix, at: int, w: int, z: int, k: int) -> int | None:
    """Return the line that an input enters alone; None if it goes anywhere else."""
    rows = np.flatnonzero(D[:, at])
    enters = [int(i) for i in rows if z <= i < z + k]
    if B[:, at].any() or len(enters) != 1 or D[enters[0], at] != 1.0:
        return None
    port = enters[0]
    if C[port].any() or np.flatnonzero(D[port]).tolist() != [at]:
        return None
    # An output beside it may show signals of the outside, and no others.
    beside = rows[rows != port]
    if (beside >= z).any() or C[beside].any() or D[beside, : w + k].any():
        return None
    return port - z


def _without_line_delay(wiring: Wiring, line: int) -> Wiring:
    """Return the wiring with one of its lines without a delay."""
    A, B, C, D = wiring.arrays()
    k = len(wiring.lines)
    i, o = wiring.nw - k + line, wiring.nz - k + line
    enter, out = B[:, [i]], D[:, [i]]
    A, B = A + enter @ C[[o]], B + enter @ D[[o]]
    C, D = C + out @ C[[o]], D + out @ D[[o]]
    matrices = A, np.delete(B, i, 1), np.delete(C, o, 0), np.delete(np.delete(D, i, 1), o, 0)
    inputs, outputs = list(wiring.system.input_labels), list(wiring.system.output_labels)
    del inputs[i], outputs[o]
    system = named_system(matrices, wiring.dt, inputs, outputs, wiring.states)
    lines = (*wiring.lines[:line], *wiring.lines[line + 1 :])
    return Wiring(system, wiring.measurements, wiring.controls, lines)


# A controller of other matrices with the same signals.


# One period of a sampled loop: the flow between two samples, and what happens at a sample.
#
# At t = k h the state s[k] holds the plant's states, the averages of measurement noise over the
# last period, the controls that the delay still holds back, and the controller's states. From it
# follow the start of the flow, zeta(0) = L s[k], and after it s[k+1] = M zeta(h) + N s[k].


DOUBLINGS = 60
"""Of a series in powers of a stable matrix: 2**60 terms."""


class Phase(NamedTuple):
    """A stretch of `length` seconds of zeta' = A zeta + B w, z = C zeta + D w."""

    length: float
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix


def _through(phases: tuple[Phase, ...]) -> Matrix:
    """Return the transition matrix of phases one after the other."""
    through = np.eye(len(phases[0].A))
    for phase in phases:
        through = np.asarray(linalg.expm(phase.A * phase.length)) @ through
    return through


@dataclass(frozen=True, eq=False)
class PeriodMap:
    """What a sampled loop does in one period; every entry is one of plant or controller.

    Attributes
    ----------
    period : float
        h, in s.
    phases : tuple of Phase
        Before and after the control changes; one phase if that happens at a sample.
    Y : ndarray
        y[k] = Y s[k], with noise averaged over the last period.
    Dk, Uk : ndarray
        u[k] = Dk y[k] + Uk s[k].
    L0, Lu : ndarray
        zeta(0) = L0 s[k] + Lu u[k].
    N0, Nu, Ny, M : ndarray
        s[k+1] = N0 s[k] + Nu u[k] + Ny y[k] + M zeta(h).
    noisy : tuple of int
        The measurements whose noise is averaged.
    """

    period: float
    phases: tuple[Phase, ...]
    Y: Matrix
    Dk: Matrix
    Uk: Matrix
    L0: Matrix
    Lu: Matrix
    N0: Matrix
    Nu: Matrix
    Ny: Matrix
    M: Matrix
    noisy: tuple[int, ...]

    def connected(
        self,
        matrix: Callable[[Matrix], Any] = np.asarray,
        times: Callable[[Any, Any], Any] = np.matmul,
    ) -> tuple[Any, Any]:
        """Return L and N, in whatever kind of numbers `matrix` makes and `times` multiplies."""
        u = times(matrix(self.Dk), matrix(self.Y)) + matrix(self.Uk)
        start = matrix(self.L0) + times(matrix(self.Lu), u)
        kept = matrix(self.N0) + times(matrix(self.Nu), u)
        return start, kept + times(matrix(self.Ny), matrix(self.Y))

    def transition(self) -> Matrix:
        """Return the matrix from zeta(0) to zeta(h) without disturbance."""
        return _through(self.phases)


def beyond_a_period(period: float) -> InvalidInputError:
    """Build the error about states that grow beyond doubles in a period; the caller raises it."""
    shown, want = f"{period:.6g} s, in which states grow beyond 1e308", "that suits the poles"
    remedy = "Take a shorter one, and check the unit of time of the plant."
    return misfit("period", shown, f"a period {want} of the plant", remedy)


def split_delay(period: float, delay: float) -> tuple[int, float]:
    """Return a delay as whole periods and a rest in s, which is zero or visibly between samples.

    Examples
    --------
    >>> split_delay(1e-3, 2.5e-3)
    (2, 0.0005)
    >>> split_delay(0.1, 0.3)
    (3, 0.0)
    """
    # Instants nearer to each other than this part of a period are one: clocks are not better.
    whole = math.floor(delay / period + SAME)
    rest = delay - whole * period
    return whole, rest if rest > SAME * period else 0.0


def period_map(
    plant: GeneralizedPlant, controller: control.StateSpace, period: float, delay: float
) -> PeriodMap:
    """Put the loop of a continuous plant and a discrete controller together.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous, with the anti-aliasing filter, if any, among its states.
    controller : control.StateSpace
        Discrete, u[k] = K y[k].
    period, delay : float
        h and the time from a sample until its control acts, in s.

    Returns
    -------
    PeriodMap

    Notes
    -----
    A sensor reads y just before the control changes, so that D22 acts with the control of the
    period before. What w adds directly to y cannot be sampled as it is, for it may have any
    value at an instant: its average over the period before counts. Noise of a given density then
    has the variance of a discrete noise of the same density, density over h.
    """
    whole, rest = split_delay(period, delay)
    nx, nu, nw = plant.nx, plant.nu, plant.nw
    noisy = tuple(int(i) for i in np.flatnonzero(plant.D21.any(axis=1)))
    na, two = len(noisy), rest > 0
    direct = bool(plant.D22.any())
    held = whole + max(int(two), int(direct))
    Ak, Bk, Ck, Dk = matrices_of(controller)
    nk = Ak.shape[0]

    flow = nx + na + nu * (2 if two else 1)
    late = slice(flow - nu, flow)  # the control after the change
    early = slice(nx + na, nx + na + nu)  # the one before it, if they differ
    accumulate = np.vstack([plant.B1, plant.D21[list(noisy)] / period])

    def phase(length: float, acting: slice) -> Phase:
        A, B = np.zeros((flow, flow)), np.zeros((flow, nw))
        C = np.zeros((plant.nz, flow))
        A[:nx, :nx], A[:nx, acting], B[: nx + na] = plant.A, plant.B2, accumulate
        C[:, :nx], C[:, acting] = plant.C1, plant.D12
        return Phase(length, A, B, C, plant.D11)

    phases = (phase(rest, early), phase(period - rest, late)) if two else (phase(period, late),)

    n = nx + na + held * nu + nk
    past = [slice(nx + na + i * nu, nx + na + (i + 1) * nu) for i in range(held)]
    xk = slice(n - nk, n)
    eye = np.eye(nu)
    Y, Uk = np.zeros((plant.ny, n)), np.zeros((nu, n))
    Y[:, :nx], Uk[:, xk] = plant.C2, Ck
    for j, i in enumerate(noisy):
        Y[i, nx + j] = 1.0
    if direct:
        Y[:, past[whole]] = plant.D22
    L0, Lu = np.zeros((flow, n)), np.zeros((flow, nu))
    L0[:nx, :nx] = np.eye(nx)
    if whole:
        L0[late, past[whole - 1]] = eye
    else:
        Lu[late] = eye
    if two:
        L0[early, past[whole]] = eye
    N0, Nu, Ny = np.zeros((n, n)), np.zeros((n, nu)), np.zeros((n, plant.ny))
    N0[xk, xk], Ny[xk] = Ak, Bk
    if held:
        Nu[past[0]] = eye
    for i in range(1, held):
        N0[past[i], past[i - 1]] = eye
    M = np.eye(n, flow)[:, : nx + na]
    M = np.hstack([M, np.zeros((n, flow - nx - na))])
    return PeriodMap(period, phases, Y, Dk, Uk, L0, Lu, N0, Nu, Ny, M, noisy)


@dataclass(frozen=True, eq=False)
class ScaledMap:
    """A period map with zeta = flow * zeta', s = sample * s'; all factors are powers of two.

    Attributes
    ----------
    map : PeriodMap
        In its own coordinates, which proofs start from.
    flow, sample : ndarray
        Factors.
    phases : tuple of Phase
    L, N, M : ndarray
        zeta(0) = L s, s+ = N s + M zeta(h), in the new coordinates.
    """

    map: PeriodMap
    flow: Vector
    sample: Vector
    phases: tuple[Phase, ...]
    L: Matrix
    N: Matrix
    M: Matrix

    def transition(self) -> Matrix:
        """Return the matrix from s[k] to s[k+1] without disturbance."""
        return self.N + self.M @ _through(self.phases) @ self.L


def scaled(found: PeriodMap) -> ScaledMap:
    """Choose coordinates in which flow, inputs and outputs are alike in size.

    Parameters
    ----------
    found : PeriodMap

    Returns
    -------
    ScaledMap
    """
    h, phases = found.period, found.phases
    flow = border_scale(
        np.max([np.abs(p.A) * h for p in phases], axis=0),
        np.max([np.linalg.norm(p.B, axis=1) * np.sqrt(h) for p in phases], axis=0),
        np.max([np.linalg.norm(p.C, axis=0) * np.sqrt(h) for p in phases], axis=0),
    )
    phases = tuple(
        Phase(p.length, p.A * flow / flow[:, None], p.B / flow[:, None], p.C * flow, p.D)
        for p in phases
    )
    L, N = found.connected()
    L, M = L / flow[:, None], found.M * flow
    # What a state at a sample means: how it starts the flow, and how the flow and it come back.
    back = np.abs(N) + np.abs(M) @ np.abs(L)
    sample = border_scale(back, np.abs(M).max(axis=1), np.abs(L).max(axis=0))
    rows = sample[:, None]
    return ScaledMap(found, flow, sample, phases, L * sample, N * sample / rows, M / rows)
