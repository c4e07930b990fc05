"""Stability with the delays as they are, not as Pade says."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.base.arrays import SAME, AnyArray, AnyMatrix, AnyVector, Matrix, Vector
from robustpolish.base.checks import instance_of
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.linear import systems
from robustpolish.linear.arithmetic.exact import refuse_extreme
from robustpolish.linear.norms.hinf import around_resonances
from robustpolish.linear.stability import unstable_poles
from robustpolish.plots.poles import plot_poles

# The rightmost characteristic roots of a system with delays, each with its residual.
#
# What runs through a delay line is a transport along it; Chebyshev polynomials along each line turn
# the system into a matrix whose eigenvalues tend to the roots, spectrally fast: Breda, Maset,
# Vermiglio, "Pseudospectral differencing methods for characteristic roots of delay differential
# equations", SIAM J. Scientific Computing 27 (2005) 482-495, here in the form of lines with ports,
# so that delays may also feed each other directly. Newton steps on the characteristic matrix itself
# then make each root exact, and its smallest singular value tells whether it is one.

MOST_SIZE = 700
"""Largest matrix whose eigenvalues are computed; several seconds."""


# Chebyshev nodes along a line: roots of a few rad per delay come out to twelve digits with the
# least number. More are taken per radian of delay at the highest frequency where a root can be
# unstable; polynomials need pi per wavelength.
_NODES, _NODES_PER_RADIAN = 20, 1.5
# Newton steps; from the eigenvalues three are enough. How far, relative to its size and the unit of
# rate, they may move a start.
_NEWTON, _MOVED = 12, 0.1


Ports = tuple[Matrix, Matrix, Matrix, Matrix]
"""A, B, C, D from delayed signals d to the signals v that enter the lines."""
_COUNT = 6
"""Roots that are told; three times as many starts are followed. Pairs count twice."""


def rightmost_roots(ports: Ports, seconds: Vector, highest: float) -> AnyVector:
    """Return the rightmost roots that were confirmed, from right to left.

    Parameters
    ----------
    ports : tuple of ndarray
    seconds : ndarray, shape (lines,)
    highest : float
        Frequency in rad/s beyond which no root has to be found.

    Returns
    -------
    ndarray of complex
        In rad/s; empty where the system is too large or nothing was confirmed.
    """
    scaled, unit = _scaled(ports)
    delays = seconds * unit
    nodes = _NODES + int(np.ceil(_NODES_PER_RADIAN * highest * seconds.max()))
    if len(scaled[0]) + len(seconds) * nodes > MOST_SIZE:
        return np.zeros(0, complex)
    starts = np.linalg.eigvals(_transport(scaled, delays, nodes))
    found: list[complex] = []
    for start in starts[np.argsort(-starts.real)][: 3 * _COUNT]:
        root = _root(scaled, delays, complex(start))
        if root is not None and not any(abs(root - r) <= 1e-6 * (1 + abs(r)) for r in found):
            found.append(root)
    found.sort(key=lambda root: (-root.real, -root.imag))
    return np.array(found[:_COUNT], dtype=complex) * unit


def _scaled(ports: Ports) -> tuple[Ports, float]:
    """Balance states and lines by powers of two, and choose a unit of rate."""
    A, B, C, D = ports
    n = len(A)
    whole = np.block([[A, B], [C, D]])
    with np.errstate(invalid="ignore"):
        _, (scale, _) = linalg.matrix_balance(whole, permute=False, separate=True)
    whole = whole * scale / scale[:, None]
    through = float(np.linalg.norm(whole[:n, n:] @ whole[n:, :n]))  # gain per second, by the lines
    rates = np.append(np.abs(np.linalg.eigvals(whole[:n, :n])) if n else [], through)
    rates = rates[rates > 0]
    unit = float(np.exp2(np.round(np.log2(np.median(rates))))) if rates.size else 1.0
    return (whole[:n, :n] / unit, whole[:n, n:] / unit, whole[n:, :n], whole[n:, n:]), unit


def _transport(ports: Ports, delays: Vector, nodes: int) -> Matrix:
    """Return the matrix of states and of what is under way along each line.

    Along line i the signal phi(theta) moves by phi' = d phi / d theta, theta from -delay to 0;
    it enters at 0, where phi = v = C x + D d, and leaves at -delay as d.
    """
    A, B, C, D = ports
    n, k = len(A), len(delays)
    points = np.cos(np.pi * np.arange(nodes + 1) / nodes)
    weight = np.ones(nodes + 1)
    weight[[0, -1]] = 2.0
    weight *= (-1.0) ** np.arange(nodes + 1)
    away = points[:, None] - points + np.eye(nodes + 1)
    slope = np.outer(weight, 1 / weight) / away
    slope -= np.diag(slope.sum(axis=1))
    whole = np.zeros((n + k * nodes, n + k * nodes))
    ends = [n + (i + 1) * nodes - 1 for i in range(k)]
    whole[:n, :n], whole[:n, ends] = A, B
    for i, delay in enumerate(delays):
        own = slice(n + i * nodes, n + (i + 1) * nodes)
        along = slope[1:] * (2 / delay)
        whole[own, own] += along[:, 1:]
        whole[own, :n] += np.outer(along[:, 0], C[i])
        whole[own, ends] += np.outer(along[:, 0], D[i])
    return whole


def _root(ports: Ports, delays: Vector, start: complex) -> complex | None:
    """Follow Newton's steps on the characteristic matrix; None if they end at no root."""
    s = start
    for _ in range(_NEWTON):
        T, slope = _characteristic(ports, delays, s)
        if not np.isfinite(T).all():
            return None
        U, _, Vh = np.linalg.svd(T)
        u, v = U[:, -1].conj(), Vh[-1].conj()
        change = u @ slope @ v
        if change == 0:
            return None
        step = (u @ T @ v) / change
        s = complex(s - step)
        if abs(step) <= 1e-14 * (1 + abs(s)):
            break
    T, _ = _characteristic(ports, delays, s)
    if not np.isfinite(T).all() or abs(s - start) > _MOVED * (1 + abs(start)):
        return None
    sizes = np.linalg.svd(T, compute_uv=False)
    # Smallest over largest singular value of the characteristic matrix at what counts as a root.
    return s if sizes[-1] <= SAME * sizes[0] else None


def _characteristic(ports: Ports, delays: Vector, s: complex) -> tuple[AnyMatrix, AnyMatrix]:
    """Return the matrix that is singular at a root, and its derivative.

    A line is scaled by 1 + |e^(-s delay)|, lest roots far to the left drown.
    """
    A, B, C, D = ports
    n, k = len(A), len(delays)
    with np.errstate(over="ignore", invalid="ignore"):
        E = np.exp(-s * delays)
        size = 1 + np.abs(E)
        E, one = (E / size)[:, None], np.diag(1 / size)
    T = np.block([[s * np.eye(n) - A, -B.astype(complex)], [-E * C, one - E * D]])
    turned = delays[:, None] * E
    return T, np.block([[np.eye(n), np.zeros((n, k))], [turned * C, turned * D]])


# How many roots of a system with delays are unstable: the argument principle, from Pade on.


# Where the gain through the delay lines is below it no delay whatever moves a root, so that steps
# may be as wide as the system itself allows.
_QUIET = 0.8
# Largest phases in rad between neighbours where it is not: of the determinant, the longest delay.
_TURN, _DELAY = 0.4, 0.3
# Points of the first grid per decade; around each resonance there are more.
_PER_DECADE = 60
MOST_POINTS = 200_000
"""Points beyond which the count is given up: 5 s for 30 states."""
# How far the count may lie from a whole number.
_WHOLE = 0.05


def count_unstable(system: systems.DelayedSystem) -> tuple[int | None, str, float]:
    """Count the characteristic roots to the right of the axis.

    Parameters
    ----------
    system : DelayedSystem
        With at least one line, and lines that feed each other directly with a gain below 1.

    Returns
    -------
    unstable : int or None
    reason : str
        Why they could not be counted.
    highest : float
        Where the last of them can lie, in rad/s.
    """
    loop = _Loop.of(system)
    if loop is None:
        return None, "every Pade model has a pole on the axis", 0.0
    poles = np.concatenate([np.linalg.eigvals(M) for M in (loop.closed[0], loop.ports[0])])
    omega = _grid(poles, system.seconds)
    for _ in range(8):  # until the lines are quiet at the end of the grid
        if loop.gain(omega[-1:])[0] < _QUIET:
            break
        omega = np.append(omega, omega[-1] * np.geomspace(1.05, 10, _PER_DECADE))
    else:
        return None, "the gain through the delays does not fall", float(omega[-1])
    gain, value = loop.gain(omega), loop.value(omega)
    widest = _DELAY / float(system.seconds.max())
    while True:
        loud = (gain[:-1] >= _QUIET) | (gain[1:] >= _QUIET)
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = np.abs(np.angle(value[1:] / value[:-1]))
        wide = loud & ((np.diff(omega) > widest) | ~(turn <= _TURN))
        at = np.flatnonzero(wide & (np.diff(omega) > 1e-13 * omega[1:]))
        if not at.size:
            break
        if omega.size + at.size > MOST_POINTS:
            return None, "too many frequencies would be needed", float(omega[-1])
        new = (omega[at] + omega[at + 1]) / 2
        omega = np.insert(omega, at + 1, new)
        gain = np.insert(gain, at + 1, loop.gain(new))
        value = np.insert(value, at + 1, loop.value(new))
    heard = np.flatnonzero(gain >= _QUIET)
    highest = float(omega[heard[-1]]) if heard.size else 0.0
    # A determinant that comes so near to zero is a root on the axis, as far as doubles tell.
    if np.abs(value).min() < SAME:
        return None, "a root lies on the axis, as far as can be told", highest
    # Between quiet neighbours the phase is known by itself: no eigenvalue passes zero.
    own = loop.quiet_phase(omega)
    turned = np.where(loud, np.angle(value[1:] / value[:-1]), np.diff(own))
    unstable = loop.right - (turned.sum() - own[-1]) / np.pi
    whole = round(unstable)
    if abs(unstable - whole) > _WHOLE or whole < 0:
        return None, f"the count of roots came out as {unstable:.3g}", highest
    return whole, "", highest


class _Loop(NamedTuple):
    """The loop around the difference of exact delays and Pade, and the lines' own gain."""

    closed: Ports
    ports: Ports
    lines: tuple[systems.DelayLine, ...]
    right: int
    """Poles of the Pade model to the right of the axis."""

    @classmethod
    def of(cls, system: systems.DelayedSystem) -> _Loop | None:
        """Choose Pade orders whose model is well posed and has no pole on the axis."""
        A, B, C, D = system.ports()
        names = [line.name for line in system.lines]
        for more in range(6):
            orders = [min(line.order + more, systems.MOST_ORDER) for line in system.lines]
            lines = tuple(map(systems.DelayLine, names, system.seconds.tolist(), orders))
            Ap, Bp, Cp, Dp = systems.pade_sections(lines)
            back = np.eye(len(D)) - Dp @ D
            if np.linalg.cond(back) > 1e8:
                continue
            # d = Pade(v) + e = inner (Cp xp + Dp C x + e), v = C x + D d
            inner = np.linalg.inv(back)
            x, p = inner @ Dp @ C, inner @ Cp
            whole = np.block([[A + B @ x, B @ p], [Bp @ (C + D @ x), Ap + Bp @ D @ p]])
            right = unstable_poles(whole)
            if right is not None:
                into = np.vstack([B @ inner, Bp @ D @ inner])
                closed = whole, into, np.hstack([C + D @ x, D @ p]), D @ inner
                return cls(closed, (A, B, C, D), lines, right)
        return None

    def factors(self, omega: Vector) -> tuple[AnyArray, AnyArray]:
        """Return exact delays and their Pade models, shape (k, lines)."""
        s = 1j * omega
        exact = [np.exp(-s * line.seconds) for line in self.lines]
        models = [
            systems.resolvent_response(*systems.pade(d.seconds, d.order), s)[:, 0, 0]
            for d in self.lines
        ]
        return np.stack(exact, axis=1), np.stack(models, axis=1)

    def value(self, omega: Vector) -> AnyVector:
        """Return the determinant, which is 1 at rest and turns about zero for each root."""
        M = systems.resolvent_response(*self.closed, 1j * omega)
        exact, models = self.factors(omega)
        return np.linalg.det(np.eye(M.shape[1]) - M * (exact - models)[:, None, :])

    def gain(self, omega: Vector) -> Vector:
        """Return the largest gain through the lines that any phases could make, in any units."""
        size = np.abs(systems.resolvent_response(*self.ports, 1j * omega))
        found = np.full(omega.size, np.inf)
        finite = np.isfinite(size).all(axis=(1, 2))
        if finite.any():
            found[finite] = np.abs(np.linalg.eigvals(size[finite])).max(axis=1)
        return found

    def quiet_phase(self, omega: Vector) -> Vector:
        """Return the determinant's phase where the gain is below 1, and anything elsewhere."""
        H = systems.resolvent_response(*self.ports, 1j * omega)
        H = np.where(np.isfinite(H), H, 0)
        exact, model = (
            np.angle(1 - np.linalg.eigvals(H * factors[:, None, :])).sum(axis=1)
            for factors in self.factors(omega)
        )
        return exact - model


def _grid(poles: Any, seconds: Vector) -> Vector:
    """Return frequencies from 0 to far beyond the fastest pole, dense around resonances."""
    rates = np.concatenate([np.abs(poles), 1 / seconds])
    rates = rates[rates > 1e-12 * rates.max()]
    low, high = rates.min() / 100, rates.max() * 100
    many = int(np.ceil(_PER_DECADE * np.log10(high / low)))
    grid = [np.zeros(1), np.geomspace(low, high, many), *around_resonances(poles)]
    return np.unique(np.concatenate(grid))


@dataclass(frozen=True, repr=False)
class DelayStability(Displayed):
    """Whether a system with delays is stable; true in a condition only if that was shown.

    Attributes
    ----------
    verdict : {"stable", "unstable", "undecided"}
    unstable_roots : int or None
        How many characteristic roots lie to the right of the axis, by the argument principle; None
        if they could not be counted.
    rightmost : complex or None
        The rightmost root that was found and confirmed, in rad/s.
    reason : str
        How it was decided.
    roots : ndarray of complex
        The rightmost roots that were confirmed, in rad/s.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> H = control.ss([[-1.0]], [[1.0, -2.0]], [[1.0], [1.0]], 0)
    >>> rp.linear.delay_stability(
    ...     rp.simulation.DelayedSystem(H, (rp.simulation.DelayLine("x", 0.3),))
    ... )
    stable
      rightmost root      -2.54819+4.00697j rad/s
      roots on the right  0
      no root right of the axis, counted by the argument principle from Pade to exact delays
    """

    verdict: Literal["stable", "unstable", "undecided"]
    unstable_roots: int | None
    rightmost: complex | None
    reason: str
    roots: NDArray[np.complex128] = field(
        default_factory=lambda: np.zeros(0, complex), compare=False
    )

    def __bool__(self) -> bool:
        return self.verdict == "stable"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the rightmost roots.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import control
        >>> import robustpolish as rp
        >>> H = control.ss([[-1.0]], [[1.0, -2.0]], [[1.0], [1.0]], 0)
        >>> found = rp.linear.delay_stability(
        ...     rp.simulation.DelayedSystem(H, (rp.simulation.DelayLine("x", 0.3),))
        ... )
        >>> found.plot().get_xlabel()
        'real part [1/s]'
        """
        return plot_poles({"rightmost roots": self.roots}, ax=ax)

    def _card(self) -> Card:
        root = self.rightmost
        shown = None if root is None else f"{root.real:.6g}{root.imag:+.6g}j rad/s"
        rows = (("rightmost root", shown), ("roots on the right", self.unstable_roots))
        return Card(self.verdict, (quantities(*rows),), (self.reason,))


def delay_stability(system: systems.DelayedSystem) -> DelayStability:
    r"""Decide whether a system with delays is stable.

    The roots to the right of the axis are counted by the argument principle: those of the Pade
    model, which are eigenvalues, and the turns that

    .. math:: \det(I - M(i\omega) (e^{-i\omega\tau} - \mathrm{Pade}(i\omega)))

    makes about zero, with M the loop around the difference. Independently, the rightmost roots are
    computed by Chebyshev polynomials along the delay lines and confirmed by their residuals.
    Stable is only what both find stable.

    Parameters
    ----------
    system : DelayedSystem
        What its inputs and outputs do does not matter, only what runs through its delays.

    Returns
    -------
    DelayStability

    Raises
    ------
    InvalidInputError
        If it is no ``DelayedSystem``.

    Notes
    -----
    Delays that feed each other directly (D between them) leave a chain of roots at ever higher
    frequencies. A system counts as stable only if it stays so under any small change of the
    delays: Hale, Verduyn Lunel, "Strong stabilization of neutral functional differential
    equations", IMA J. Mathematical Control and Information 19 (2002) 5-23.

    Examples
    --------
    x' = -x(t - T) is stable up to T = pi / 2.

    >>> import control
    >>> import robustpolish as rp
    >>> H = control.ss([[0.0]], [[-1.0]], [[1.0]], 0)
    >>> [rp.linear.delay_stability(
    ...     rp.simulation.DelayedSystem(H, (rp.simulation.DelayLine("x", T),))
    ... ).verdict
    ...  for T in (1.57, 1.5709)]
    ['stable', 'unstable']
    """
    remedy = "Use plant.delayed_loop(controller), or build a DelayedSystem."
    instance_of("system", system, systems.DelayedSystem, "a DelayedSystem", remedy)
    refuse_extreme("system", dict(zip("ABCD", system.matrices, strict=True)))
    ports = system.ports()
    if not system.lines:
        poles: Any = np.linalg.eigvals(ports[0]).astype(complex)
        poles = poles[np.argsort(-poles.real)]
        right = int((poles.real >= 0).sum())
        verdict = "unstable" if right else "stable"
        first = complex(poles[0]) if poles.size else None
        return DelayStability(verdict, right, first, "there are no delays", poles)
    direct = float(np.abs(np.linalg.eigvals(np.abs(ports[3]))).max())
    if direct >= 1:
        surely = len(system.lines) == 1 and direct > 1
        text = f"delays feed each other with a gain of {direct:.4g}, not below 1"
        return DelayStability("unstable" if surely else "undecided", None, None, text)
    unstable, text, highest = count_unstable(system)
    roots: Any = rightmost_roots(ports, system.seconds, highest)
    first, found = (complex(roots[0]) if roots.size else None), (roots.real >= 0).any()
    verdict, counted = "undecided", "right of the axis, counted by the argument principle"
    if unstable:
        verdict, text = "unstable", f"{unstable} roots {counted}"
    elif found and unstable is None:
        verdict, text = "unstable", "a root right of the axis was found and confirmed"
    elif found:
        unstable = None
        text = "the argument principle counts no root on the right, yet one was found"
    elif unstable == 0:
        verdict, text = "stable", f"no root {counted} from Pade to exact delays"
    return DelayStability(verdict, unstable, first, text, roots)
