"""Controllability and observability: which modes cannot be moved or seen, and how nearly."""

from __future__ import annotations

import control
import numpy as np
from numpy.typing import ArrayLike

from robustpolish.analysis.poles.eigen import pair_text
from robustpolish.analysis.poles.pbh_distance import deficiencies
from robustpolish.analysis.poles.pbh_result import Feasibility, Kind, ModeTest, PbhTest
from robustpolish.exact.realisation import Realisation, realisation
from robustpolish.validation import described, invalid, matrix, positive, square


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
    >>> rp.is_stabilizable([[1, 0], [0, -2]], [[0], [1]], states=["drift", "v"]).reason
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
    >>> bool(rp.is_detectable([[-1, 0], [0, 2]], [[0, 1]]))
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
    model, names = _read(kind, system, signals, states, dt)
    if tolerance is not None:
        tolerance = positive("tolerance", tolerance, zero=True)
    if kind == "observability":
        none = np.zeros((0, model.states))
        empty = np.zeros((0, model.C.shape[0]))
        model = Realisation(model.A.T, model.C.T, none, empty, model.discrete)
    found = [
        ModeTest(mode.eigenvalue, mode.distance, names[mode.state], mode.deficient, mode.stable)
        for mode in deficiencies(model, tolerance)
    ]
    return PbhTest(kind, tuple(sorted(found, key=lambda mode: mode.distance)))


def _read(kind: Kind, system, signals, states, dt) -> tuple[Realisation, list[str]]:
    other = "B" if kind == "controllability" else "C"
    if isinstance(system, control.StateSpace) or signals is None:
        if signals is not None:
            text = f"a matrix beside a system, which has its own {other}"
            raise invalid(other, described(text), "None", "Pass either a system or two matrices.")
        model = realisation("system", system)
        return model, list(system.state_labels)
    A = square("A", system)
    n = A.shape[0]
    names = [f"x[{i}]" for i in range(n)] if states is None else list(states)
    if len(names) != n:
        raise invalid("states", names, f"{n} names", "Give one name per state.")
    shape = (n, None) if kind == "controllability" else (None, n)
    given = matrix(other, signals, shape)
    B, C = (given, np.zeros((0, n))) if kind == "controllability" else (np.zeros((n, 0)), given)
    return Realisation(A, B, C, np.zeros((C.shape[0], B.shape[1])), bool(dt)), names
