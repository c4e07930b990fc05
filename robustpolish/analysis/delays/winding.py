"""How many roots of a system with delays are unstable: the argument principle, from Pade on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from robustpolish.analysis.delays.delayed_system import (
    DelayedSystem,
    DelayLine,
    resolvent_response,
)
from robustpolish.analysis.delays.pade import MOST_ORDER, pade
from robustpolish.arrays import AnyArray, AnyVector, Matrix, Vector


@dataclass(frozen=True)
class WindingPolicy:
    """Thresholds of the count.

    Attributes
    ----------
    small : float
        Where the gain through the delay lines is below it no delay whatever moves a root, so
        that steps may be as wide as the system itself allows.
    turn : float
        Largest phase in rad between neighbours where it is not.
    delay : float
        Largest phase in rad of the longest delay between neighbours there.
    per_decade : int
        Points of the first grid; around each resonance there are more.
    most_points : int
        Points beyond which the count is given up: 5 s for 30 states.
    whole : float
        How far the count may lie from a whole number.
    least : float
        A determinant that comes so near to zero is a root on the axis, as far as doubles tell.
    axis : float
        How near to the axis, relative to its size, no eigenvalue of a Pade model may lie.
    """

    small: float = 0.8
    turn: float = 0.4
    delay: float = 0.3
    per_decade: int = 60
    most_points: int = 200_000
    whole: float = 0.05
    least: float = 1e-9
    axis: float = 1e-9


POLICY = WindingPolicy()


class Counted(NamedTuple):
    """The number of unstable roots or None, why none, and where (rad/s) the last can lie."""

    unstable: int | None
    reason: str
    highest: float


def count_unstable(system: DelayedSystem, policy: WindingPolicy = POLICY) -> Counted:
    """Count the characteristic roots to the right of the axis.

    Parameters
    ----------
    system : DelayedSystem
        With at least one line, and lines that feed each other directly with a gain below 1.

    Returns
    -------
    Counted
    """
    lines = _orders(system, policy)
    if lines is None:
        return Counted(None, "every Pade model has a pole on the axis", 0.0)
    system = replace(system, lines=lines)
    loop = _Loop.of(system)
    poles = np.concatenate([np.linalg.eigvals(loop.A), np.linalg.eigvals(loop.ports[0])])
    right = int((np.linalg.eigvals(loop.A).real > 0).sum())
    omega = _grid(poles, system.seconds, policy)
    for _ in range(8):  # until the lines are quiet at the end of the grid
        if loop.gain(omega[-1:])[0] < policy.small:
            break
        omega = np.append(omega, omega[-1] * np.geomspace(1.05, 10, policy.per_decade))
    else:
        return Counted(None, "the gain through the delays does not fall", float(omega[-1]))
    gain, value = loop.gain(omega), loop.value(omega)
    widest = policy.delay / float(system.seconds.max())
    while True:
        loud = (gain[:-1] >= policy.small) | (gain[1:] >= policy.small)
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = np.abs(np.angle(value[1:] / value[:-1]))
        wide = loud & ((np.diff(omega) > widest) | ~(turn <= policy.turn))
        wide &= np.diff(omega) > 1e-13 * omega[1:]
        if not wide.any():
            break
        if omega.size + int(wide.sum()) > policy.most_points:
            return Counted(None, "too many frequencies would be needed", float(omega[-1]))
        at = np.flatnonzero(wide)
        new = (omega[at] + omega[at + 1]) / 2
        omega = np.insert(omega, at + 1, new)
        gain = np.insert(gain, at + 1, loop.gain(new))
        value = np.insert(value, at + 1, loop.value(new))
    heard = np.flatnonzero(gain >= policy.small)
    highest = float(omega[heard[-1]]) if heard.size else 0.0
    if np.abs(value).min() < policy.least:
        return Counted(None, "a root lies on the axis, as far as can be told", highest)
    turned = np.angle(value[1:] / value[:-1])
    # Between quiet neighbours the phase is known by itself: no eigenvalue passes zero.
    quiet = ~loud
    own = loop.quiet_phase(omega)
    turned[quiet] = np.diff(own)[quiet]
    unstable = right - (turned.sum() - own[-1]) / np.pi
    whole = round(unstable)
    if abs(unstable - whole) > policy.whole or whole < 0:
        return Counted(None, f"the count of roots came out as {unstable:.3g}", highest)
    return Counted(whole, "", highest)


class _Loop(NamedTuple):
    """The loop around the difference of exact delays and Pade, and the lines' own gain."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    ports: tuple[Matrix, Matrix, Matrix, Matrix]
    system: DelayedSystem

    @classmethod
    def of(cls, system: DelayedSystem) -> _Loop:
        A, B, C, D = system.ports()
        Ap, Bp, Cp, Dp = _block(system)
        inner = np.linalg.inv(np.eye(len(D)) - Dp @ D)
        # d = Pade(v) + e = inner (Cp xp + Dp C x + e), v = C x + D d
        x, p = inner @ Dp @ C, inner @ Cp
        whole = np.block([[A + B @ x, B @ p], [Bp @ (C + D @ x), Ap + Bp @ D @ p]])
        into = np.vstack([B @ inner, Bp @ D @ inner])
        return cls(whole, into, np.hstack([C + D @ x, D @ p]), D @ inner, (A, B, C, D), system)

    def difference(self, omega: Vector) -> AnyArray:
        """Return exact minus Pade, shape (k, lines)."""
        s = 1j * omega
        exact = np.exp(-np.multiply.outer(s, self.system.seconds))
        return exact - np.stack(
            [
                resolvent_response(*pade(line.seconds, line.order), s)[:, 0, 0]
                for line in self.system.lines
            ],
            axis=1,
        )

    def value(self, omega: Vector) -> AnyVector:
        """Return the determinant, which is 1 at rest and turns about zero for each root."""
        M = resolvent_response(self.A, self.B, self.C, self.D, 1j * omega)
        inside = np.eye(len(self.D)) - M * self.difference(omega)[:, None, :]
        return np.linalg.det(inside)

    def lines_response(self, omega: Vector) -> AnyArray:
        """Return what the delayed signals come back as, without the delays."""
        return resolvent_response(*self.ports, 1j * omega)

    def gain(self, omega: Vector) -> Vector:
        """Return the largest gain through the lines that any phases could make, in any units."""
        size = np.abs(self.lines_response(omega))
        found = np.full(omega.size, np.inf)
        finite = np.isfinite(size).all(axis=(1, 2))
        if finite.any():
            found[finite] = np.abs(np.linalg.eigvals(size[finite])).max(axis=1)
        return found

    def quiet_phase(self, omega: Vector) -> Vector:
        """Return the determinant's phase where the gain is below 1, and anything elsewhere."""
        H = self.lines_response(omega)
        H = np.where(np.isfinite(H), H, 0)
        exact = np.exp(-np.multiply.outer(1j * omega, self.system.seconds))
        models = exact - self.difference(omega)
        phases = []
        for factors in (exact, models):
            phases.append(np.angle(1 - np.linalg.eigvals(H * factors[:, None, :])).sum(axis=1))
        return phases[0] - phases[1]


def _block(system: DelayedSystem) -> list[Matrix]:
    """Return the Pade approximations of all lines as one system."""
    models = [pade(line.seconds, line.order) for line in system.lines]
    return [np.asarray(block_diag(*M)) for M in zip(*models, strict=True)]


def _orders(system: DelayedSystem, policy: WindingPolicy) -> tuple[DelayLine, ...] | None:
    """Return lines whose Pade model is well posed and has no pole on the axis."""
    for more in range(6):
        lines = tuple(
            replace(line, order=min(line.order + more, MOST_ORDER)) for line in system.lines
        )
        trial = replace(system, lines=lines)
        D = system.ports()[3]
        Dp = _block(trial)[3]
        if np.linalg.cond(np.eye(len(D)) - Dp @ D) > 1e8:
            continue
        poles = np.linalg.eigvals(_Loop.of(trial).A)
        if (np.abs(poles.real) > policy.axis * np.abs(poles).max(initial=0.0)).all():
            return lines
    return None


def _grid(poles: Any, seconds: Vector, policy: WindingPolicy) -> Vector:
    """Return frequencies from 0 to far beyond the fastest pole, dense around resonances."""
    rates = np.concatenate([np.abs(poles), 1 / seconds])
    rates = rates[rates > 1e-12 * rates.max()]
    low, high = rates.min() / 100, rates.max() * 100
    many = int(np.ceil(policy.per_decade * np.log10(high / low)))
    grid = [np.zeros(1), np.geomspace(low, high, many)]
    for pole in poles[np.abs(poles.imag) > 0]:
        width = abs(pole.real / pole.imag)
        away = np.geomspace(max(width, 1e-12) / 10, 0.3, 40)
        grid.append(abs(pole.imag) * np.concatenate([1 - away[::-1], [1.0], 1 + away]))
    return np.unique(np.concatenate(grid))
