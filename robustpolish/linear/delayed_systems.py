"""Systems with delays: their Pade models, exact responses, roots and stability."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from robustpolish.base.arrays import AnyArray, Matrix, Vector
from robustpolish.base.checks import (
    described,
    instance_of,
    invalid,
    positive,
    state_space,
    whole_number,
)
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.linear.arithmetic.exact import realisation

# The Pade approximation of a delay, as a chain of sections that pass all frequencies.

MOST_ORDER = 20
"""Beyond it the coefficients of the Pade polynomials no longer tell their roots."""


def pade(seconds: float, order: int) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Return A, B, C, D of the Pade approximation of a delay, numerator as long as denominator.

    Its gain is 1 at all frequencies, as that of the delay; its phase is right up to about `order`
    radians of delay.

    Parameters
    ----------
    seconds : float
        Above 0.
    order : int
        1 to 20: states.

    Returns
    -------
    A, B, C, D : ndarray
        Sections of first and second order, each balanced and lossless.

    Raises
    ------
    InvalidInputError
        If delay or order are out of range.

    Examples
    --------
    >>> A, B, C, D = pade(0.5, 1)
    >>> print(A, B @ C, D)
    [[-4.]] [[8.]] [[-1.]]
    """
    seconds = positive("seconds", seconds, "s")
    remedy = "3 is right up to a phase of 3 rad of the delay."
    A, B, C, D = in_a_row(_sections(whole_number("order", order, 1, MOST_ORDER, remedy)))
    return A / seconds, B / math.sqrt(seconds), C / math.sqrt(seconds), D


Section = tuple[Matrix, Matrix, Matrix, float]


def in_a_row(sections: Sequence[Section]) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Return A, B, C, D of sections of one input and one output, each fed by the one before.

    Parameters
    ----------
    sections : sequence of (A, B, C, d)

    Returns
    -------
    A, B, C, D : ndarray
    """
    A, B, C, D = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1))
    for a, b, c, d in sections:
        A = np.block([[A, np.zeros((len(A), len(a)))], [b @ C, a]])
        B = np.vstack([B, b @ D])
        C, D = np.hstack([d * C, c]), d * D
    return A, B, C, D


def _sections(order: int) -> list[Section]:
    """Return lossless sections for the delay 1, one per real root or pair of roots."""
    f = math.factorial
    # Ascending: the sum of (2n - k)! n! / ((2n)! k! (n - k)!) s^k.
    coefficients = [
        f(2 * order - k) * f(order) / (f(2 * order) * f(k) * f(order - k)) for k in range(order + 1)
    ]
    roots = np.roots(coefficients[::-1])
    found = []
    for root in sorted(roots, key=abs):
        if abs(root.imag) < 1e-9 * abs(root):
            a, r = -root.real, math.sqrt(-2 * root.real)
            found.append((*(np.array([[v]]) for v in (-a, r, r)), -1.0))
        elif root.imag > 0:
            size, a = abs(root), -2 * root.real
            r = math.sqrt(2 * a)
            column, row = np.array([[0.0], [r]]), np.array([[0.0, -r]])
            found.append((np.array([[0.0, size], [-size, -a]]), column, row, 1.0))
    return found


# A linear system some of whose outputs return to it after a delay.


@dataclass(frozen=True)
class DelayLine:
    """One delay.

    Attributes
    ----------
    name : str
        The signal that is delayed.
    seconds : float
        Above 0.
    order : int
        Order of its Pade approximation, for whoever wants a system without delays.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.simulation.DelayLine("x", 1e-3)
    DelayLine(name='x', seconds=0.001, order=3)
    """

    name: str
    seconds: float
    order: int = 3

    def __post_init__(self) -> None:
        pade(self.seconds, self.order)  # which checks both


def pade_sections(lines: tuple[DelayLine, ...]) -> list[Matrix]:
    """Return the Pade approximations of all lines as one system."""
    empty = [(np.zeros((0, 0)),) * 4]
    models = [pade(line.seconds, line.order) for line in lines] or empty
    return [np.asarray(linalg.block_diag(*M)) for M in zip(*models, strict=True)]


@dataclass(frozen=True, eq=False, repr=False)
class DelayedSystem(Displayed):
    r"""A system whose last outputs return to its last inputs after a delay.

    ::

        w --->| H  |---> z        H(s) = C (sI - A)^-1 B + D
        d --->|    |---> v        d_i(t) = v_i(t - seconds_i)

    Every interconnection of linear systems and delays has this form.

    Attributes
    ----------
    system : control.StateSpace
        H, continuous, with one further input and output per delay line, behind the others.
    lines : tuple of DelayLine

    Raises
    ------
    InvalidInputError
        If there are more lines than inputs or outputs, or if time is discrete, in which a delay is
        a chain of states.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> # x' = -x(t) + w - 2 x(t - 0.3), z = x
    >>> H = control.ss([[-1.0]], [[1.0, -2.0]], [[1.0], [1.0]], 0)
    >>> loop = rp.simulation.DelayedSystem(H, (rp.simulation.DelayLine("x", 0.3),))
    >>> print(loop.response([0.0])[0].real, loop.pade_model().nstates)
    [[0.33333333]] 4
    >>> loop
    System with delays
      states of H      1
      inputs w         u[0]
      outputs z        y[0]
      delay of x [s]   0.3
    >>> loop.ports()[1]
    array([[-2.]])
    """

    system: control.StateSpace
    lines: tuple[DelayLine, ...]

    def __post_init__(self) -> None:
        state_space("system", self.system)
        remedy = "Write DelayLine(name, seconds)."
        object.__setattr__(self, "lines", tuple(self.lines))
        for line in self.lines:
            instance_of("lines", line, DelayLine, "DelayLine objects", remedy)
        ports = min(self.system.ninputs, self.system.noutputs)
        if len(self.lines) > ports:
            shown = described(f"{len(self.lines)} delay lines and {ports} signals for them")
            raise invalid("lines", shown, "one input and one output per line", "Append them last.")
        if self.system.isdtime(strict=True):
            shown = described("a discrete-time system")
            raise invalid("system", shown, "continuous time", "There a delay is a chain of states.")

    def _card(self) -> Card:
        s, count = self.system, len(self.lines)
        rows = (
            ("states of H", s.nstates),
            ("inputs w", ", ".join(s.input_labels[: s.ninputs - count]) or "none"),
            ("outputs z", ", ".join(s.output_labels[: s.noutputs - count]) or "none"),
            *((f"delay of {line.name} [s]", line.seconds) for line in self.lines),
        )
        return Card("System with delays", (quantities(*rows),))

    @property
    def matrices(self) -> tuple[Matrix, Matrix, Matrix, Matrix]:
        """A, B, C and D of H as plain arrays of consistent shapes."""
        A, B, C, D = realisation("system", self.system).matrices.values()
        return A, B, C, D

    @property
    def seconds(self) -> Vector:
        """The delays, in s."""
        return np.array([line.seconds for line in self.lines], dtype=float)

    def ports(self) -> tuple[Matrix, Matrix, Matrix, Matrix]:
        """Return A, B, C and D from d to v, what the stability rests on.

        Examples
        --------
        See :class:`DelayedSystem`.
        """
        A, B, C, D = self.matrices
        m, p = B.shape[1] - len(self.lines), C.shape[0] - len(self.lines)
        return A, B[:, m:], C[p:], D[p:, m:]

    def response(self, omega: ArrayLike) -> AnyArray:
        """Return the response from w to z with the delays as they are.

        Parameters
        ----------
        omega : array_like, shape (k,)
            Frequencies in rad/s.

        Returns
        -------
        ndarray of complex, shape (k, outputs, inputs)
            Infinite at a pole.

        Raises
        ------
        InvalidInputError
            If a frequency is not finite.
        """
        A, B, C, D = self.matrices
        k = len(self.lines)
        m, p, n = B.shape[1] - k, C.shape[0] - k, len(A)
        s = 1j * frequencies("omega", omega)
        # States and lines at once: a pole of H alone need not be one of the whole.
        E = np.exp(-s[:, None] * self.seconds)[:, :, None]
        whole = np.zeros((s.size, n + k, n + k), dtype=complex)
        whole[:, :n, :n] = s[:, None, None] * np.eye(n) - A
        whole[:, :n, n:] = -B[:, m:]
        whole[:, n:, :n] = -E * C[p:]
        whole[:, n:, n:] = np.eye(k) - E * D[p:, m:]
        entries = np.zeros((s.size, n + k, m), dtype=complex)
        entries[:, :n] = B[:, :m]
        entries[:, n:] = E * D[p:, :m]
        inside = _solved(whole, entries)
        with np.errstate(invalid="ignore"):
            values = np.hstack([C[:p], D[:p, m:]]) @ inside + D[:p, :m]
        values[~np.isfinite(inside).all(axis=(1, 2))] = np.inf
        return values

    def pade_model(self) -> control.StateSpace:
        """Return the system with every delay replaced by its Pade approximation.

        Returns
        -------
        control.StateSpace
            The states of the approximations come last, named for their signals.

        Raises
        ------
        InvalidInputError
            If the approximated loop is not well posed.
        """
        A, B, C, D = self.matrices
        k = len(self.lines)
        m, p = B.shape[1] - k, C.shape[0] - k
        Ap, Bp, Cp, Dp = pade_sections(self.lines)
        inner = np.eye(k) - Dp @ D[p:, m:]
        if k and np.linalg.cond(inner) > 1 / np.finfo(float).eps:
            shown = described("a loop without solution at infinite frequency")
            raise invalid("system", shown, "a well-posed loop", "Use another order of the Pade.")
        # d = inner^-1 (Cp xp + Dp (C x + D_vw w))
        on_x = np.linalg.solve(inner, Dp @ C[p:]) if k else np.zeros((0, len(A)))
        on_p = np.linalg.solve(inner, Cp) if k else np.zeros((0, 0))
        on_w = np.linalg.solve(inner, Dp @ D[p:, :m]) if k else np.zeros((0, m))
        Bd, Dd = B[:, m:], D[:, m:]
        E = Dd[p:]
        names = [f"{line.name}_delay[{i}]" for line in self.lines for i in range(line.order)]
        return control.StateSpace(
            np.block([[A + Bd @ on_x, Bd @ on_p], [Bp @ (C[p:] + E @ on_x), Ap + Bp @ E @ on_p]]),
            np.vstack([B[:, :m] + Bd @ on_w, Bp @ (D[p:, :m] + E @ on_w)]),
            np.hstack([C[:p] + Dd[:p] @ on_x, Dd[:p] @ on_p]),
            D[:p, :m] + Dd[:p] @ on_w,
            0,
            inputs=self.system.input_labels[:m],
            outputs=self.system.output_labels[:p],
            states=_different([*self.system.state_labels, *names]),
            remove_useless_states=False,
        )


def frequencies(argument: str, given: ArrayLike) -> Vector:
    """Return frequencies as a vector of finite numbers."""
    remedy = "Pass a list of frequencies."
    try:
        lines = np.atleast_1d(np.asarray(given, dtype=float))
    except (TypeError, ValueError):
        raise invalid(argument, given, "finite numbers", remedy) from None
    if lines.ndim != 1 or not np.isfinite(lines).all():
        shown = described(f"an array of shape {lines.shape} with {lines.ravel()[:3]}")
        raise invalid(argument, shown, "a list of finite numbers", remedy)
    return lines


def resolvent_response(A: Matrix, B: Matrix, C: Matrix, D: Matrix, s: AnyArray) -> AnyArray:
    """Return C (sI - A)^-1 B + D at points s, shape (k, p, m); infinite at a pole."""
    values = np.broadcast_to(D.astype(complex), (s.size, *D.shape)).copy()
    if not A.size or not D.size:
        return values
    pencils = s[:, None, None] * np.eye(len(A)) - A
    inside = _solved(pencils, np.broadcast_to(B.astype(complex), (s.size, *B.shape)))
    with np.errstate(invalid="ignore"):
        values += C @ inside
    values[~np.isfinite(inside).all(axis=(1, 2))] = np.inf
    return values


def _solved(matrices: AnyArray, right: AnyArray) -> AnyArray:
    """Solve many equations at once; infinite where a matrix is singular."""
    try:
        return np.linalg.solve(matrices, right)
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.full(right.shape, np.inf, dtype=complex)
        half = len(matrices) // 2
        parts = (slice(None, half), slice(half, None))
        return np.concatenate([_solved(matrices[part], right[part]) for part in parts])


def _different(names: list[str]) -> list[str]:
    """Return the names, those that occur again with a number behind."""
    seen = [names[: i + 1].count(name) for i, name in enumerate(names)]
    return [f"{name}_{n}" if n > 1 else name for name, n in zip(names, seen, strict=True)]
