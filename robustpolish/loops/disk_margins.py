"""The disk margin: gain and phase that may change together."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg

from robustpolish.base.arrays import AnyMatrix, Matrix, Vector
from robustpolish.linear.norms.hinf import HinfNorm
from robustpolish.loops.response import DelayedLoop, Matrices, Ports, connected

# How far around a frequency a loop with exact delays stays below a level: nothing hides between.
#
# At a frequency the loop is solved with its delays as they are. A step from there turns every
# delay by its length times the step and moves s by the step: a perturbation of known size, whose
# effect on the response is bounded. Beyond some frequency the gains of the states bound all of the
# rest.

_SHORTENINGS = 14
"""Trial steps of one interval: each is a third of the one before."""
_DOUBLINGS = 40
"""Of the frequency from which on sizes of parts are to bound the rest."""


@dataclass(frozen=True, eq=False)
class DelayedIntervals:
    """z = M w with x' = A x + B (w, d), (z, v) = C x + D (w, d), d_i(t) = v_i(t - seconds_i).

    Attributes
    ----------
    A, B, C, D : ndarray
        In balanced coordinates of the states and of the delayed signals.
    seconds : ndarray
        The delays; d and v are the last signals of either side.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    seconds: Vector

    @classmethod
    def of_loop(cls, loop: DelayedLoop, ports: Ports) -> DelayedIntervals:
        """Wire plant and controller.

        Parameters
        ----------
        loop : DelayedLoop
        ports : Ports
        """
        k = len(loop.plant.lines)
        found = connected(loop.plant.matrices, loop.controller, ports, k)
        return cls(*_balanced(*found, k), loop.plant.seconds)

    @property
    def _sizes(self) -> tuple[int, int]:
        """Numbers of inputs w and outputs z."""
        k = len(self.seconds)
        return self.B.shape[1] - k, len(self.C) - k

    @cached_property
    def _lengths(self) -> Vector:
        """What a step of 1 rad/s turns: s by one, each delay by its length."""
        return np.concatenate([np.ones(len(self.A)), self.seconds])

    def response(self, omega: float) -> AnyMatrix:
        """Return M at a frequency in rad/s."""
        return self._solved(omega)[0]

    def _solved(self, omega: float) -> tuple[AnyMatrix, AnyMatrix, AnyMatrix, AnyMatrix]:
        """Return M, from w to (x, v), from what is added to them to z, and to (x, v)."""
        A, B, C, D = self.A, self.B, self.C, self.D
        (m, p), n, k = self._sizes, len(A), len(self.seconds)
        E = np.exp(-1j * omega * self.seconds)[:, None]
        W = np.block(
            [[1j * omega * np.eye(n) - A, -B[:, m:]], [-E * C[p:], np.eye(k) - E * D[p:, m:]]]
        )
        added = np.vstack([np.eye(n, n + k), E * np.eye(k, n + k, k=n)])
        driven = np.vstack([B[:, :m], E * D[p:, :m]])
        both = np.linalg.solve(W, np.hstack([driven, added]))
        on_v = np.hstack([C[p:], D[p:, m:]])
        v = on_v @ both
        v[:, :m] += D[p:, :m]
        z = np.hstack([C[:p], D[:p, m:]]) @ both
        z[:, :m] += D[:p, :m]
        q = np.vstack([both[:n], v])
        return z[:, :m], q[:, :m], z[:, m:], q[:, m:]

    def around(self, omega: float, scales: Vector, level: float) -> tuple[float, float]:
        """Return frequencies in rad/s around one, between which T M T^-1 stays below a level.

        Parameters
        ----------
        omega : float
            In rad/s; infinity too.
        scales : ndarray
            Diagonal of T.
        level : float
        """
        if math.isinf(omega):
            tail = (2.0**i * self._pace for i in range(1, _DOUBLINGS + 1))
            beyond = (w for w in tail if self._far_below(w, scales, level))
            return next(beyond, math.inf), math.inf
        M, on_q, on_z, inner = self._solved(omega)
        lengths = self._lengths[:, None]
        M, on_q = M * scales[:, None] / scales, lengths * on_q / scales
        on_z, inner = on_z * scales[:, None], lengths * inner
        if not all(np.isfinite(part).all() for part in (M, on_q, on_z, inner)):
            return omega, omega
        slope = -1j * on_z @ on_q
        into, out, loop = (float(np.linalg.norm(part, 2)) for part in (on_q, on_z, inner))
        bend = float(sum(
            tau / 2 * np.linalg.norm(on_z[:, -i]) * np.linalg.norm(on_q[-i])
            for i, tau in enumerate(self.seconds[::-1], 1)
        ))  # fmt: skip
        step = min(1 / loop if loop > 0 else math.inf, max(omega, self._pace))
        for _ in range(_SHORTENINGS):
            step /= 3
            rest = step**2 * (bend + into * out * loop / (1 - step * loop))
            # The norm of what is linear in the step is largest at one of its ends.
            ends = max(float(np.linalg.norm(M + turn * slope, 2)) for turn in (step, -step))
            if ends + rest < level:
                last = math.inf if self._far_below(omega + step, scales, level) else omega + step
                return max(omega - step, 0.0), last
        return omega, omega

    @cached_property
    def _pace(self) -> float:
        return float(np.linalg.norm(self.A, 2)) or 1.0

    def _far_below(self, omega: float, scales: Vector, level: float) -> bool:
        """Tell whether T M T^-1 stays below a level from a frequency on, by the sizes of parts."""
        if omega <= self._pace:
            return False
        resolvent, m, p = 1 / (omega - self._pace), *self._sizes
        rows = scales[:, None]
        B, C, D = self.B[:, :m] / scales, self.C[:p] * rows, self.D[:p, :m] * rows / scales
        delayed = self.B[:, m:], self.C[p:], self.D[p:, m:]
        beside = self.D[:p, m:] * rows, self.D[p:, :m] / scales
        bw, cz, dzw, bd, cv, dvd, dzd, dvw = (
            float(np.linalg.norm(part, 2)) if part.size else 0.0
            for part in (B, C, D, *delayed, *beside)
        )
        turned = dvd + cv * bd * resolvent
        if turned >= 1:
            return False
        out, into = dzd + cz * bd * resolvent, dvw + cv * bw * resolvent
        return dzw + cz * bw * resolvent + out * into / (1 - turned) < level


def _balanced(A: Matrix, B: Matrix, C: Matrix, D: Matrix, k: int) -> Matrices:
    """Scale states and delayed signals so that none is far larger than the others."""
    m, p, n = B.shape[1] - k, len(C) - k, len(A)
    inner = np.block([[A, B[:, m:]], [C[p:], D[p:, m:]]])
    _, (scale, _) = linalg.matrix_balance(inner, permute=False, separate=True)
    T = np.asarray(scale, dtype=float)
    x, left, right = T[:n, None], np.append(np.ones(m), T[n:]), np.append(np.ones(p), T[n:])
    right = right[:, None]
    return A * T[:n] / x, B * left / x, C * T[:n] / right, D * left / right


@dataclass(frozen=True)
class DiskMargin:
    r"""A disk of complex factors f in every broken loop, none of which makes it unstable.

    The disk is :math:`f = (1 + \delta \alpha / 2) / (1 - \delta \alpha / 2)` with
    :math:`|\delta| < 1`: symmetric in gain and phase, the "balanced" one of [1]_, python-control's
    ``skew=0`` and MATLAB's ``diskmargin``.

    Attributes
    ----------
    alpha : float
        Its size, 2 over the peak of S - T: for one loop to nine digits; for several a lower
        bound, within 0.1 % where no more than three signals change.
    frequency_hz : float
        Where the loop comes nearest; infinite if only the limit does, nan if nowhere.
    proven : bool
        Whether no frequency at all, not only none of a grid, comes nearer.

    References
    ----------
    .. [1] P. Seiler, A. Packard, P. Gahinet, "An Introduction to Disk Margins", IEEE Control
       Systems Magazine 40 (2020) 78-95.

    Examples
    --------
    >>> from robustpolish.loops import DiskMargin
    >>> margin = DiskMargin(alpha=2 / 3, frequency_hz=10.0, proven=True)
    >>> [round(factor, 3) for factor in margin.gain], round(margin.phase_deg, 2)
    ([0.5, 2.0], 36.87)
    >>> round(margin.gain_db, 2)
    6.02
    """

    alpha: float
    frequency_hz: float
    proven: bool

    @property
    def gain(self) -> tuple[float, float]:
        """Factors between which every gain may lie; 0 and infinity from alpha = 2 on."""
        if self.alpha >= 2:
            return 0.0, math.inf
        return (2 - self.alpha) / (2 + self.alpha), (2 + self.alpha) / (2 - self.alpha)

    @property
    def gain_db(self) -> float:
        """The upper factor in dB; the lower is its negative."""
        return decibel(self.gain[1])

    @property
    def phase_deg(self) -> float:
        """Degrees by which the phase may turn either way."""
        return math.degrees(2 * math.atan(self.alpha / 2))


def disk_of(norm: HinfNorm) -> DiskMargin:
    """Return the disk margin of one loop from the norm of its S - T.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> from robustpolish.loops.disk_margins import disk_of
    >>> disk_of(rp.hinf_norm(control.ss([], [], [], [[4.0]]))).alpha
    0.5
    """
    alpha = 2 / norm.value if norm.value else math.inf
    return DiskMargin(alpha, norm.frequency / (2 * math.pi), math.isfinite(norm.upper))


def decibel(factor: float) -> float:
    """Return a gain in dB: infinite for 0 and infinity, with the sign that belongs to it.

    Examples
    --------
    >>> from robustpolish.loops.disk_margins import decibel
    >>> round(decibel(2.0), 2), decibel(0.0)
    (6.02, -inf)
    """
    return 20 * math.log10(factor) if factor > 0 else -math.inf
