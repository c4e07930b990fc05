"""One period of a sampled loop: the flow between two samples, and what happens at a sample.

At t = k h the state s[k] holds the plant's states, the averages of measurement noise over the last
period, the controls that the delay still holds back, and the controller's states. From it follow
the start of the flow, zeta(0) = L s[k], and after it s[k+1] = M zeta(h) + N s[k].
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import control
import numpy as np

from robustpolish.arrays import Matrix
from robustpolish.errors import InvalidInputError
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.blocks import matrices_of
from robustpolish.validation import described, invalid

SAME_INSTANT = 1e-9
"""Instants nearer to each other than this part of a period are one: clocks are not better."""


class Phase(NamedTuple):
    """A stretch of `length` seconds of zeta' = A zeta + B w, z = C zeta + D w."""

    length: float
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix


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


def beyond_a_period(period: float) -> InvalidInputError:
    """Build the error about states that grow beyond doubles in a period; the caller raises it."""
    return invalid(
        "period",
        described(f"{period:.6g} s, in which states grow beyond 1e308"),
        "a period that suits the poles of the plant",
        "Take a shorter one, and check the unit of time of the plant.",
    )


def split_delay(period: float, delay: float) -> tuple[int, float]:
    """Return a delay as whole periods and a rest in s, which is zero or visibly between samples.

    Examples
    --------
    >>> split_delay(1e-3, 2.5e-3)
    (2, 0.0005)
    >>> split_delay(0.1, 0.3)
    (3, 0.0)
    """
    whole = math.floor(delay / period + SAME_INSTANT)
    rest = delay - whole * period
    return whole, rest if rest > SAME_INSTANT * period else 0.0


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
