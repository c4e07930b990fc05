"""Controllability and observability: which modes cannot be moved or seen, and how nearly."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray

from robustpolish.base.checks import described, invalid, matrix, positive, square
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.linear.arithmetic.exact import EXACT_STATES, rational
from robustpolish.linear.scaling import decoupled_blocks, equilibrating_scales, in_units
from robustpolish.linear.stability import (
    EPS,
    eigensystem,
    pair_text,
    poles_by_side,
    unreachable_poles,
)
from robustpolish.linear.systems import Realisation, realisation
from robustpolish.plots.charts import plot_bars

Kind = Literal["controllability", "observability"]


@dataclass(frozen=True)
class ModeTest:
    """The Popov-Belevitch-Hautus test at one eigenvalue.

    Attributes
    ----------
    eigenvalue : complex
        In rad/s, or in discrete time without unit; of a pair the one with positive
        imaginary part.
    distance : float
        Size of a relative change of the scaled matrices (A, B) or (A, C) that makes a
        mode near this eigenvalue deficient: the smallest singular value of (A - lambda I, B),
        minimised over lambda around here, over their norm.
    state : str
        The state that takes the largest part in the mode.
    deficient : bool
        Whether no input moves the mode (no output sees it), exactly or to rounding.
    stable : bool
        Whether the mode dies out by itself, beyond doubt.
    """

    eigenvalue: complex
    distance: float
    state: str
    deficient: bool
    stable: bool


@dataclass(frozen=True, repr=False)
class PbhTest(Displayed):
    """Result of :func:`controllability` or :func:`observability`; true if no mode is deficient.

    Attributes
    ----------
    kind : {"controllability", "observability"}
    modes : tuple of ModeTest
        All modes, the most nearly deficient first.
    distance : float
        The smallest of their distances, an upper bound of the distance to the nearest
        deficient system; infinite without states.
    deficient : tuple of ModeTest
        Those that cannot be moved or seen.
    harmful : tuple of ModeTest
        The deficient ones that are not stable: they rule stabilising (detecting) out.
    reason : str
        The finding in a sentence.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.observability([[-1, 0], [0, -2]], [[0, 1]], states=["drift", "v"])
    not observable: -1 (state drift)
      eigenvalue  state  distance  lacking  stable
      -1          drift         0  yes      yes
      -2          v           ...  no       yes
    """

    kind: Kind
    modes: tuple[ModeTest, ...]

    @property
    def distance(self) -> float:
        """Smallest distance of all modes."""
        return min((mode.distance for mode in self.modes), default=np.inf)

    @property
    def deficient(self) -> tuple[ModeTest, ...]:
        """The modes that no input moves, or no output sees."""
        return tuple(mode for mode in self.modes if mode.deficient)

    @property
    def harmful(self) -> tuple[ModeTest, ...]:
        """The deficient modes that are not stable."""
        return tuple(mode for mode in self.deficient if not mode.stable)

    @property
    def reason(self) -> str:
        """The finding in a sentence."""
        adjective = "controllable" if self.kind == "controllability" else "observable"
        if not self.deficient:
            near = f"; the nearest that is not is {self.distance:.2g} away" if self.modes else ""
            return f"{adjective}{near}"
        listed = ", ".join(
            f"{pair_text(m.eigenvalue)} (state {m.state}{'' if m.stable else ', not stable'})"
            for m in self.deficient
        )
        return f"not {adjective}: {listed}"

    def __bool__(self) -> bool:
        return not self.deficient

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw each mode's distance from being deficient; a mode at distance zero has no bar.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.controllability([[-1, 0], [0, -2]], [[0], [1]]).plot().get_ylabel()
        'mode'
        """
        inputs = self.kind == "controllability"
        name = f"relative distance from being un{'controllable' if inputs else 'observable'}"
        labels = [f"{mode.state}, {pair_text(mode.eigenvalue)}" for mode in self.modes]
        where = {"mode": labels}
        distance = [mode.distance for mode in self.modes]
        lacking = [mode.deficient for mode in self.modes]
        return plot_bars(
            xr.DataArray(distance, where, "mode", name=name),
            xr.DataArray(lacking, where, "mode"),
            ax,
            meaning=("moved by an input", "moved by none") if inputs
            else ("seen by an output", "seen by none"),
        )  # fmt: skip

    def _card(self) -> Card:
        columns = ("eigenvalue", "state", "distance", "lacking", "stable")
        rows = tuple(
            (pair_text(mode.eigenvalue), mode.state, mode.distance, mode.deficient, mode.stable)
            for mode in self.modes
        )
        return Card(self.reason, (Table("", columns, rows),))


@dataclass(frozen=True, repr=False)
class Feasibility(Displayed):
    """Result of :func:`is_stabilizable` or :func:`is_detectable`; true if it is.

    Attributes
    ----------
    possible : bool
    modes : tuple of ModeTest
        The modes that rule it out.
    reason : str
        The finding in a sentence.
    test : PbhTest
        The test of all modes.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.linear.is_stabilizable([[1, 0], [0, -2]], [[0], [1]])
    not stabilisable: no input moves 1 (state x[0])
      eigenvalue  state  distance  lacking  stable
      1           x[0]          0  yes      no
      -2          x[1]        ...  no       yes
    """

    possible: bool
    modes: tuple[ModeTest, ...]
    reason: str
    test: PbhTest

    def __bool__(self) -> bool:
        return self.possible

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw each mode's distance from being deficient, as :meth:`PbhTest.plot`.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.linear.is_detectable([[-1, 0], [0, 2]], [[0, 1]]).plot().get_ylabel()
        'mode'
        """
        return self.test.plot(ax)

    def _card(self) -> Card:
        return Card(self.reason, self.test._card().tables)


# Distance of each mode from being unreachable, and which modes are.


def _mode_tests(
    model: Realisation, names: Sequence[str], tolerance: float | None
) -> Iterator[ModeTest]:
    """Test the pair (A, B) mode by mode, block by block."""
    for block in decoupled_blocks(model.A, model.B, np.zeros((0, model.states))):
        n, m = len(block.states), len(block.inputs)
        if n:
            A = model.A[np.ix_(block.states, block.states)]
            B = model.B[np.ix_(block.states, block.inputs)]
            part = Realisation(A, B, np.zeros((0, n)), np.zeros((0, m)), model.discrete)
            # Units of states, time and of each input do not change what is reachable.
            part = in_units(part, equilibrating_scales(part, [np.array([i]) for i in range(m)], []))
            yield from _block_tests(part, [names[i] for i in block.states], tolerance)


def _block_tests(
    model: Realisation, names: Sequence[str], tolerance: float | None
) -> Iterator[ModeTest]:
    A, B, n = model.A, model.B, model.states
    spectrum = eigensystem(A)
    values = spectrum.values
    size = float(np.linalg.norm(np.hstack([A, B]), 2))
    limit = (100 * n * EPS if tolerance is None else tolerance) * size
    margins = 1 - np.abs(values) if model.discrete else -values.real
    matched: dict[int, tuple[complex, bool]] = {}
    sides: dict[int, tuple[complex, bool]] = {}
    if n <= EXACT_STATES:
        matched = _matched(values, unreachable_poles(rational(A), rational(B), model.discrete))
        if (np.abs(margins) <= spectrum.errors).any():
            poles = poles_by_side(rational(A), model.discrete)
            sides = _matched(values, [(pole, side < 0) for pole, side in poles])
    for i, value in enumerate(values):
        if value.imag < 0:
            continue
        distance = _distance(A, B, values, i)
        deficient = distance <= limit
        stable = bool(margins[i] > spectrum.errors[i])
        if i in matched:
            value, stable = matched[i]
            distance, deficient = 0.0, True
        elif i in sides:
            stable = sides[i][1]
        relative = distance / size if size else 0.0
        state = names[int(spectrum.shares[:, i].argmax())]
        yield ModeTest(complex(value) * model.time, relative, state, deficient, stable)


def _matched(
    values: NDArray[np.complex128], exact: list[tuple[complex, bool]]
) -> dict[int, tuple[complex, bool]]:
    """Assign each exact eigenvalue to the nearest computed one that is left."""
    free = set(range(len(values)))
    matched = {}
    for pole, stable in exact:
        nearest = min(free, key=lambda i: abs(values[i] - pole))
        free.remove(nearest)
        matched[nearest] = (pole, stable)
    return matched


def _distance(
    A: NDArray[np.float64], B: NDArray[np.float64], values: NDArray[np.complex128], which: int
) -> float:
    """Minimise the smallest singular value of (A - x I, B) over x near one eigenvalue.

    For the left singular vector u at x, the best x is u* A u: it can
    only lessen the norm of u* (A - x I, B), so every step is downhill. It
    ends where another eigenvalue becomes the nearest.
    """
    n = A.shape[0]
    x, best = complex(values[which]), np.inf
    for _ in range(30):
        pencil = np.hstack([A - x * np.eye(n), B])
        u, s, _ = np.linalg.svd(pencil, full_matrices=False)
        smallest = float(s[-1])
        if smallest >= best * (1 - 1e-3):
            return min(best, smallest)
        best = smallest
        x = complex(u[:, -1].conj() @ A @ u[:, -1])
        if np.abs(values - x).min() < abs(values[which] - x):
            break
    return best


# The public tests.


def controllability(
    system: control.StateSpace | ArrayLike,
    B: ArrayLike | None = None,
    *,
    states: list[str] | tuple[str, ...] | None = None,
    dt: float | bool = 0,
    tolerance: float | None = None,
) -> PbhTest:
    r"""Test every mode for controllability, with its distance from losing it.

    States, time and inputs are scaled first, so the verdicts do not depend on units and
    the distances depend on them little (more where states are barely coupled). A
    mode is deficient if exact arithmetic finds it outside the reachable subspace, or if its
    distance is within the tolerance. The distance is minimised over
    complex lambda by alternating between the smallest singular vector of
    (A - lambda I, B) and the best lambda for it, which never increases it; the global
    minimum may be smaller [1]_.

    Parameters
    ----------
    system : control.StateSpace or array_like, shape (n, n)
        A system, or its matrix A.
    B : array_like, shape (n, m), optional
        Only with a matrix A.
    states : sequence of str, optional
        Names, only with a matrix A.
    dt : float or True, optional
        Sampling time, only with a matrix A: 0 is continuous time.
    tolerance : float, optional
        Distance up to which a mode counts as deficient; 100 n times the rounding unit by
        default.

    Returns
    -------
    PbhTest

    Raises
    ------
    InvalidInputError
        If the shapes do not fit, an entry is not finite or the number of names is wrong.

    References
    ----------
    .. [1] R. Eising, "Between controllable and uncontrollable", Systems & Control
       Letters 4 (1984) 263-264.

    Examples
    --------
    >>> import robustpolish as rp
    >>> test = rp.controllability([[1, 0], [0, -2]], [[0], [1]], states=["drift", "v"])
    >>> test.reason
    'not controllable: 1 (state drift, not stable)'
    """
    return _test("controllability", system, B, states, dt, tolerance)


def observability(
    system: control.StateSpace | ArrayLike,
    C: ArrayLike | None = None,
    *,
    states: list[str] | tuple[str, ...] | None = None,
    dt: float | bool = 0,
    tolerance: float | None = None,
) -> PbhTest:
    """Test every mode for observability, with its distance from losing it.

    The dual of :func:`controllability`: the same for A and C transposed.

    Parameters
    ----------
    system : control.StateSpace or array_like, shape (n, n)
        A system, or its matrix A.
    C : array_like, shape (p, n), optional
        Only with a matrix A.
    states, dt, tolerance
        As for :func:`controllability`.

    Returns
    -------
    PbhTest

    Raises
    ------
    InvalidInputError
        If the shapes do not fit, an entry is not finite or the number of names is wrong.

    Examples
    --------
    >>> import robustpolish as rp
    >>> A = [[0, 1], [0, 0]]
    >>> bool(rp.observability(A, [[1, 0]])), bool(rp.observability(A, [[0, 1]]))
    (True, False)
    """
    return _test("observability", system, C, states, dt, tolerance)


def is_stabilizable(
    system: control.StateSpace | ArrayLike,
    B: ArrayLike | None = None,
    *,
    states: list[str] | tuple[str, ...] | None = None,
    dt: float | bool = 0,
    tolerance: float | None = None,
) -> Feasibility:
    """Say whether inputs can stabilise the system; if not, which modes forbid it.

    Parameters
    ----------
    system, B, states, dt, tolerance
        As for :func:`controllability`.

    Returns
    -------
    Feasibility
        True in a condition if every mode that is not strictly stable can be moved.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.linear.is_stabilizable([[1, 0], [0, -2]], [[0], [1]], states=["drift", "v"]).reason
    'not stabilisable: no input moves 1 (state drift)'
    """
    return _feasible(controllability(system, B, states=states, dt=dt, tolerance=tolerance))


def is_detectable(
    system: control.StateSpace | ArrayLike,
    C: ArrayLike | None = None,
    *,
    states: list[str] | tuple[str, ...] | None = None,
    dt: float | bool = 0,
    tolerance: float | None = None,
) -> Feasibility:
    """Say whether outputs show every mode that is not stable; if not, which they miss.

    Parameters
    ----------
    system, C, states, dt, tolerance
        As for :func:`observability`.

    Returns
    -------
    Feasibility
        True in a condition if every mode that is not strictly stable is seen.

    Examples
    --------
    >>> import robustpolish as rp
    >>> bool(rp.linear.is_detectable([[-1, 0], [0, 2]], [[0, 1]]))
    True
    """
    return _feasible(observability(system, C, states=states, dt=dt, tolerance=tolerance))


def _feasible(test: PbhTest) -> Feasibility:
    inputs = test.kind == "controllability"
    word, lack = ("stabilisable", "no input moves") if inputs else ("detectable", "no output sees")
    if not test.harmful:
        return Feasibility(True, (), word, test)
    listed = ", ".join(f"{pair_text(m.eigenvalue)} (state {m.state})" for m in test.harmful)
    return Feasibility(False, test.harmful, f"not {word}: {lack} {listed}", test)


def _test(kind: Kind, system, signals, states, dt, tolerance) -> PbhTest:
    inputs = kind == "controllability"
    other = "B" if inputs else "C"
    if signals is None or isinstance(system, control.LTI):
        if signals is not None:
            text = f"a matrix beside a system, which has its own {other}"
            raise invalid(other, described(text), "None", "Pass either a system or two matrices.")
        given = realisation("system", system)
        A, signals, discrete = given.A, given.B if inputs else given.C, given.discrete
        names = list(given.source.state_labels)
    else:
        A = square("A", system)
        n, discrete = len(A), bool(dt)
        names = [f"x[{i}]" for i in range(n)] if states is None else list(states)
        if len(names) != n:
            raise invalid("states", names, f"{n} names", "Give one name per state.")
        signals = matrix(other, signals, (n, None) if inputs else (None, n))
    if tolerance is not None:
        tolerance = positive("tolerance", tolerance, zero=True)
    A, B = (A, signals) if inputs else (A.T, signals.T)
    none = np.zeros((0, len(A))), np.zeros((0, B.shape[1]))
    found = _mode_tests(Realisation(A, B, *none, discrete), names, tolerance)
    return PbhTest(kind, tuple(sorted(found, key=lambda mode: mode.distance)))
