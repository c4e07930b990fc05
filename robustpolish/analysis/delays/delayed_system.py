"""A linear system some of whose outputs return to it after a delay."""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from robustpolish.analysis.delays.pade import pade
from robustpolish.arrays import AnyArray, Matrix, Vector
from robustpolish.display import Card, Displayed, quantities
from robustpolish.validation import described, instance_of, invalid, state_space


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
    >>> rp.DelayLine("x", 1e-3)
    DelayLine(name='x', seconds=0.001, order=3)
    """

    name: str
    seconds: float
    order: int = 3

    def __post_init__(self) -> None:
        pade(self.seconds, self.order)  # which checks both


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
    >>> loop = rp.DelayedSystem(H, (rp.DelayLine("x", 0.3),))
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
        s = self.system
        n, m, p = s.nstates, s.ninputs, s.noutputs
        return (
            np.array(s.A, dtype=float).reshape(n, n),
            np.array(s.B, dtype=float).reshape(n, m),
            np.array(s.C, dtype=float).reshape(p, n),
            np.array(s.D, dtype=float).reshape(p, m),
        )

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
        approximations = [pade(line.seconds, line.order) for line in self.lines]
        empty = [(np.zeros((0, 0)),) * 4]
        sections = zip(*(approximations or empty), strict=True)
        Ap, Bp, Cp, Dp = (np.asarray(linalg.block_diag(*M)) for M in sections)
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
    seen: dict[str, int] = {}
    found = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        found.append(name if seen[name] == 1 else f"{name}_{seen[name]}")
    return found
