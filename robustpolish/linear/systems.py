"""Whatever users call a system, read as a state-space system: this is the one place for it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import control
import numpy as np
from control.exception import ControlMIMONotImplemented
from numpy.typing import ArrayLike
from scipy import linalg

from robustpolish.base.arrays import AGREE, EPS, AnyArray, AnyVector, Array, Matrix, Vector
from robustpolish.base.checks import (
    described,
    instance_of,
    invalid,
    matrix,
    misfit,
    positive,
    state_space,
    whole_number,
)
from robustpolish.base.results import Card, Displayed, quantities

_SYSTEMS = (
    "a control.StateSpace, a control.TransferFunction, a system of scipy.signal or an object with "
    "a method state_space()"
)
_KINDS = f"{_SYSTEMS}; or a gain"
_PARTS = ("system", "closed_loop", "controller", "open_loop", "pade_model()")
"""Where results keep the systems they hold."""


def named_system(
    matrices: Sequence[ArrayLike],
    dt: float | bool,
    inputs: Sequence[str],
    outputs: Sequence[str],
    states: Sequence[str] = (),
) -> control.StateSpace:
    """Return the system of A, B, C, D with these names, states without effect kept.

    Parameters
    ----------
    matrices : sequence of array_like
        A, B, C and D.
    dt : float or True
        Sampling time in s; 0 is continuous time.
    inputs, outputs, states : sequence of str
        Names.

    Returns
    -------
    control.StateSpace
    """
    names = {"inputs": list(inputs), "outputs": list(outputs), "states": list(states)}
    A, B, C, D = matrices
    if not names["inputs"]:
        # python-control loses a single row without columns: an input stands in for it.
        n, p = len(names["states"]), len(names["outputs"])
        padded = (A, np.zeros((n, 1)), C, np.zeros((p, 1)))
        names["inputs"] = ["none"]
        system = control.StateSpace(*padded, dt, remove_useless_states=False, **names)
        system.set_inputs([])
        system.B, system.D = np.zeros((n, 0)), np.zeros((p, 0))
        return system
    return control.StateSpace(A, B, C, D, dt, remove_useless_states=False, **names)


def is_system(value: Any) -> bool:
    """Return whether :func:`as_state_space` takes a value for a system rather than a gain."""
    known = isinstance(value, control.InputOutputSystem | control.LTI) or _is_of_scipy(value)
    return known or hasattr(value, "state_space")


def as_system(argument: str, value: Any) -> control.StateSpace:
    """Return a system as :func:`as_state_space` does; a gain is refused."""
    if not is_system(value):
        parts = [f".{name}" for name in _PARTS if name.rstrip("()") in dir(value)]
        remedy = f"Take its {' or '.join(parts)}." if parts else "Convert it with control.ss(...)."
        raise invalid(argument, described(type(value).__name__), _SYSTEMS, remedy)
    return as_state_space(argument, value)


def _is_of_scipy(value: Any) -> bool:
    return type(value).__module__.startswith("scipy.signal")  # whose import takes long


def as_state_space(
    argument: str,
    value: Any,
    dt: float | bool | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> control.StateSpace:
    """Return a system of any kind, or a gain, as a state-space system.

    Parameters
    ----------
    argument : str
        Name of the argument, for messages.
    value : control.StateSpace, control.TransferFunction, scipy.signal.lti or dlti or array_like
        Or an object with a method ``state_space()``, such as a MechanicalModel, or an
        UncertainSystem in which nothing is uncertain.
        A state-space system comes back as it is. The states of a realised transfer function
        have no meaning; one of several inputs or outputs takes slycot, which realises it with the
        fewest states.
    dt : float, True or None, optional
        Sampling time of what has none of its own.
    inputs, outputs : sequence of str, optional
        Names of what is no state-space system; those of the transfer function by default.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    InvalidInputError
        If it is of another kind, has entries that are not finite, or is improper.
    """
    if isinstance(value, control.StateSpace):
        return state_space(argument, value)
    if isinstance(value, control.TransferFunction):
        return _realised(argument, value, dt, inputs, outputs)
    if hasattr(value, "state_space"):
        return as_state_space(argument, value.state_space(), dt)
    if _is_of_scipy(value):
        return _of_scipy(argument, value, dt)
    if isinstance(value, control.InputOutputSystem | control.LTI) or hasattr(value, "dims"):
        remedy = "Fit or linearise it first. Of a response loop_analysis gives the margins."
        raise misfit(argument, type(value).__name__, _KINDS, remedy)
    if value is None or isinstance(value, str):
        raise invalid(argument, value, _KINDS, "Pass one of these.")
    gain = matrix(argument, value)
    rows, columns = gain.shape
    if (rows == 0) != (columns == 0):
        shown = described(f"shape {gain.shape}")
        raise invalid(argument, shown, "a gain with entries", "Give a row per output.")
    inputs = inputs or [f"u[{i}]" for i in range(columns)]
    outputs = outputs or [f"y[{i}]" for i in range(rows)]
    return named_system(([], [], [], gain), dt or 0, inputs, outputs)


def _realised(
    argument: str, system: control.TransferFunction, dt: Any, inputs: Any, outputs: Any
) -> control.StateSpace:
    """Realise a proper transfer function; see :func:`as_state_space`."""
    every = [n for pair in (system.num_list, system.den_list) for row in pair for n in row]
    if not all(np.isfinite(n).all() for n in every):
        shown = described("coefficients that are not finite")
        raise invalid(argument, shown, "finite numbers", "Check its coefficients.")
    pairs = zip(system.num_list, system.den_list, strict=True)
    if any(n.size > d.size for row in pairs for n, d in zip(*row, strict=True)):
        want, remedy = "one with no more zeros than poles", "Add a lag to its derivative action."
        raise invalid(argument, described("an improper TransferFunction"), want, remedy)
    time = system.dt if system.dt is not None else dt
    timed = control.TransferFunction(system.num_list, system.den_list, time)
    single = system.ninputs == system.noutputs == 1
    try:
        found: Any = control.ss(
            timed,
            method="scipy" if single else None,
            inputs=list(system.input_labels if inputs is None else inputs),
            outputs=list(system.output_labels if outputs is None else outputs),
        )
    except (ControlMIMONotImplemented, ImportError):
        shown = "a TransferFunction of several inputs or outputs, and slycot is missing"
        remedy = "Install slycot, or pass a state-space realisation."
        raise invalid(argument, described(shown), "a control.StateSpace", remedy) from None
    if single:
        return found
    # No routine is believed: the realisation has to have the response that it realises.
    dens = [np.roots(d) for row in system.den_list for d in row]
    sizes = np.abs(np.concatenate([*dens, [1.0]]))
    scale = float(np.median(sizes[sizes > 0]))
    for factor in (0.03, 0.4, 1.1, 3.0, 40.0):
        s = 1.2 * np.exp(0.7j * factor) if timed.isdtime(strict=True) else scale * factor * 1j
        s = complex(s) + 0.1 * scale * factor  # off the axis, where poles may lie
        want, have = np.atleast_2d(timed(s)), np.atleast_2d(found(s))
        # How far, relative, a realisation may lie from its transfer function at the points of the
        # check.
        if not np.abs(want - have).max() <= AGREE * np.abs(want).max():
            shown = described("a TransferFunction whose realisation has another response")
            remedy = "Build it as a control.StateSpace."
            raise invalid(argument, shown, "one that can be realised in double precision", remedy)
    return found


def _of_scipy(argument: str, value: Any, dt: Any) -> control.StateSpace:
    """Return a system of scipy.signal, whose zeros and poles need no polynomials."""
    time = value.dt if value.dt is not None else dt or 0
    if hasattr(value, "A") or np.ndim(getattr(value, "num", ())) > 1:
        found = value.to_ss()
        matrices = found.A, found.B, found.C, found.D
        return as_state_space(argument, control.StateSpace(*matrices, time))
    if hasattr(value, "gain") and len(value.zeros) <= len(value.poles):
        zeros, poles = (np.array(roots, dtype=complex) for roots in (value.zeros, value.poles))
        return of_roots(zeros, poles, float(value.gain), time)
    found = value.to_tf()
    return as_state_space(argument, control.TransferFunction(found.num, found.den, time))


def of_roots(
    zeros: AnyVector, poles: AnyVector, gain: float, dt: Any = 0, about: float = 0.0
) -> control.StateSpace:
    """Return the system of zeros and poles, counted from `about`, as sections in a row.

    Polynomials of degree two at most keep the digits of roots that are small beside the others.
    """
    found = control.StateSpace([], [], [], [[gain]], dt)
    for den, num in itertools.zip_longest(
        real_factors(poles), real_factors(zeros), fillvalue=np.ones(1)
    ):
        n = len(den) - 1  # controllable form, in time units of its own rate
        rate = float(np.abs(den[-1]) ** (1 / n)) or 1.0
        powers = rate ** np.arange(n + 1)
        num, den = np.pad(num, (n + 1 - len(num), 0)) / powers, den / powers
        A = about * np.eye(n) + np.vstack([-den[1:], np.eye(n - 1, n)]) * rate
        row = num[1:] - num[0] * den[1:]
        found = control.StateSpace(A, np.eye(n, 1) * rate, row, num[0], dt) * found
    return found


def real_factors(roots: AnyVector) -> list[Vector]:
    """Return real polynomials of degree two, and at last one of degree one if the number is odd."""
    upper = sorted((s for s in roots.tolist() if s.imag > 1e-9 * abs(s)), key=abs)
    real = sorted((s.real for s in roots.tolist() if abs(s.imag) <= 1e-9 * abs(s)), key=abs)
    double = [np.array([1.0, -2 * s.real, abs(s) ** 2]) for s in upper]
    double += [np.poly(real[i : i + 2]) for i in range(0, len(real) - 1, 2)]
    ordered = sorted(double, key=lambda p: p[-1])
    return ordered + ([np.poly(real[-1:])] if len(real) % 2 else [])


# Systems with delays: their Pade models, exact responses, roots and stability.


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
        if k and np.linalg.cond(inner) > 1 / EPS:
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


@dataclass(frozen=True, eq=False)
class Realisation:
    """The matrices of a system in scaled units, and how to come back.

    Attributes
    ----------
    A, B, C, D : ndarray
        Scaled matrices; every scale is a power of two, so they are exact.
    discrete : bool
        True for discrete time.
    step : float
        Sampling time in s (1 if none was given); 1 in continuous time.
    time : float
        Scaled frequency times `time` is rad/s; 1 in discrete time.
    gain : float
        Scaled gain times `gain` is the gain of the original system.
    source : control.StateSpace or None
        What :func:`realisation` read.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    discrete: bool
    step: float = 1.0
    time: float = 1.0
    gain: float = 1.0
    source: Any = None

    @property
    def states(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    @property
    def matrices(self) -> dict[str, Matrix]:
        """A, B, C and D by name."""
        return {"A": self.A, "B": self.B, "C": self.C, "D": self.D}


def realisation(argument: str, system: Any) -> Realisation:
    """Read a system of any kind; an unspecified `dt` means continuous time."""
    system = as_system(argument, system)
    n, m, p = system.nstates, system.ninputs, system.noutputs
    discrete = bool(system.isdtime(strict=True))
    step = 1.0 if system.dt is None or system.dt is True or not discrete else float(system.dt)
    shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
    A, B, C, D = (
        np.array(getattr(system, name), dtype=float).reshape(s) for name, s in shapes.items()
    )
    return Realisation(A, B, C, D, discrete, step, source=system)


@np.errstate(over="ignore", invalid="ignore")
def hamiltonian(model: Realisation, gamma: float) -> Array | None:
    """Return the matrix whose imaginary eigenvalues are crossings; None at the gain of D.

    Entries beyond doubles are infinite.
    """
    A, B, C, D = model.A, model.B, model.C, model.D
    if not D.any():
        return np.block([[A, B @ B.T / gamma], [-(C.T @ C) / gamma, -A.T]])
    R = gamma * gamma * np.eye(B.shape[1]) - D.T @ D
    try:
        X = np.linalg.solve(R, np.hstack([D.T @ C, B.T]))
    except np.linalg.LinAlgError:
        return None
    RDC, RB = X[:, : A.shape[0]], X[:, A.shape[0] :]
    closed = A + B @ RDC
    return np.block([[closed, gamma * B @ RB], [-(C.T @ (C + D @ RDC)) / gamma, -closed.T]])


def named_like(
    system: control.StateSpace, matrices: Any, dt: float | bool | None
) -> control.StateSpace:
    """Return the system of these matrices with the inputs and outputs of another.

    Parameters
    ----------
    system : control.StateSpace
        Gives the names, those of its states only if there are as many.
    matrices : sequence of ndarray
    dt : float, True or None

    Returns
    -------
    control.StateSpace
    """
    n = len(matrices[0])
    states = system.state_labels if n == system.nstates else [f"x[{i}]" for i in range(n)]
    time = 0 if dt is None else dt
    return named_system(matrices, time, system.input_labels, system.output_labels, states)


MOST_EXPONENT = 1000
"""Of powers of two that anything is scaled by."""


def nearest_exponent(value: float) -> int:
    """Return the exponent of the power of two nearest to a positive number; 0 for others.

    Compiled code takes it, too.

    Examples
    --------
    >>> [nearest_exponent(x) for x in (3.1, 0.3, 0.0, math.inf)]
    [2, -2, 0, 0]
    """
    if not (value > 0 and math.isfinite(value)):
        return 0
    return min(max(round(math.log2(value)), -MOST_EXPONENT), MOST_EXPONENT)
