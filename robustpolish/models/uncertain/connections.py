"""Systems joined, with what is uncertain kept: functions for operands of any kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from robustpolish.models.uncertain.lft import reduced
from robustpolish.models.uncertain.system import UncertainSystem, as_uncertain
from robustpolish.validation import described, invalid


def feedback(forward: Any, back: Any = 1, sign: int = -1) -> UncertainSystem:
    """Return a closed loop with what is uncertain in it kept.

    Parameters
    ----------
    forward, back : UncertainSystem, control.LTI, array_like or float
        From the input to the output, and from there back.
    sign : {-1, 1}, optional
        Negative feedback by default, as in python-control.

    Returns
    -------
    UncertainSystem

    Raises
    ------
    InvalidInputError
        If the sizes do not fit, or the loop is not well posed.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> gain = rp.uncertain_real("gain", 2.0, percent=50)
    >>> loop = rp.feedback(control.ss([[0.0]], [[1.0]], [[1.0]], 0), gain)
    >>> loop.at({"gain": 3.0}).poles().real
    array([-3.])
    """
    return as_uncertain("forward", forward).feedback(back, sign)


def series(first: Any, *others: Any) -> UncertainSystem:
    """Return systems one after the other, the first one first, as python-control's ``series``.

    Parameters
    ----------
    first : UncertainSystem, control.LTI, array_like or float
        What the input enters.
    *others : UncertainSystem, control.LTI, array_like or float
        What comes after.

    Returns
    -------
    UncertainSystem

    Examples
    --------
    >>> import robustpolish as rp
    >>> gain = rp.uncertain_real("gain", 2.0, percent=50)
    >>> rp.series([[1.0], [2.0]], [[3.0, 4.0]], gain).nominal
    22.0
    """
    result = as_uncertain("first", first)
    for other in others:
        result = as_uncertain("others", other) * result
    return result


def parallel(first: Any, *others: Any) -> UncertainSystem:
    """Return the sum of systems.

    Parameters
    ----------
    first : UncertainSystem, control.LTI, array_like or float
    *others : UncertainSystem, control.LTI, array_like or float

    Returns
    -------
    UncertainSystem

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.parallel(1.0, rp.uncertain_real("b", 2.0, percent=50)).nominal
    3.0
    """
    result = as_uncertain("first", first)
    for other in others:
        result = result + as_uncertain("others", other)
    return result


def append(first: Any, *others: Any) -> UncertainSystem:
    """Return systems side by side, inputs and outputs in their order.

    Parameters
    ----------
    first : UncertainSystem, control.LTI, array_like or float
    *others : UncertainSystem, control.LTI, array_like or float

    Returns
    -------
    UncertainSystem

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.append(1.0, rp.uncertain_real("b", 2.0, percent=50)).nominal
    array([[1., 0.],
           [0., 2.]])
    """
    return as_uncertain("first", first).append(*others)


def lft(upper: Any, lower: Any, nu: int = -1, ny: int = -1) -> UncertainSystem:
    """Return a system whose last signals are closed by another one, with positive sign.

    Parameters
    ----------
    upper : UncertainSystem, control.LTI or array_like
        A generalised plant, for example.
    lower : UncertainSystem, control.LTI, array_like or float
        The controller u = K y.
    nu, ny : int, optional
        Number of inputs and outputs of the plant that are joined; all of the other's by default.

    Returns
    -------
    UncertainSystem

    Raises
    ------
    InvalidInputError
        If there are too few signals, or the loop is not well posed.

    Examples
    --------
    >>> import robustpolish as rp
    >>> k = rp.uncertain_real("k", 2.0, percent=50)
    >>> rp.lft([[0.0, 1.0], [1.0, 0.0]], k).nominal
    2.0
    """
    return as_uncertain("upper", upper).lft(lower, nu, ny)


def uncertain_system(
    A: ArrayLike | Sequence[Any] | UncertainSystem,
    B: ArrayLike | Sequence[Any] | UncertainSystem,
    C: ArrayLike | Sequence[Any] | UncertainSystem,
    D: ArrayLike | Sequence[Any] | UncertainSystem = 0.0,
    dt: float | bool = 0,
    *,
    states: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> UncertainSystem:
    """Return the state-space system of matrices whose entries may be uncertain.

    Parameters
    ----------
    A, B, C, D : array_like or UncertainSystem
        Matrices with numbers and uncertain numbers as entries; D of 0 is a matrix of zeros.
    dt : float or True, optional
        Sampling time in s; 0 in continuous time.
    states, inputs, outputs : sequence of str, optional
        Names.

    Returns
    -------
    UncertainSystem
        An element that occurs in several entries is repeated no more often than it has to be.

    Raises
    ------
    InvalidInputError
        If the matrices do not fit, or an entry is dynamic.

    Examples
    --------
    >>> import robustpolish as rp
    >>> m = rp.uncertain_real("m", 2.0, percent=10)
    >>> k = rp.uncertain_real("k", 8.0, percent=20)
    >>> plant = rp.uncertain_system([[0, 1], [-k / m, -0.4 / m]], [[0], [1 / m]], [[1, 0]])
    >>> [(name, block.copies) for name, block in zip(plant.elements, plant.blocks)]
    [('m', 1), ('k', 1)]
    """
    given = {"A": A, "B": _column(B), "C": C}
    parts = {name: as_uncertain(name, value) for name, value in given.items()}
    n, (ny, nu) = parts["A"].shape[0], (parts["C"].shape[0], parts["B"].shape[1])
    zero = not isinstance(D, UncertainSystem) and not np.ndim(D) and D == 0
    parts["D"] = as_uncertain("D", np.zeros((ny, nu)) if zero else D)
    wanted = {"A": (n, n), "B": (n, nu), "C": (ny, n), "D": (ny, nu)}
    for name, part in parts.items():
        if part.shape != wanted[name]:
            shown = described(f"shape {part.shape}")
            raise invalid(name, shown, f"shape {wanted[name]}", "Check its rows and columns.")
        if not part.is_static:
            shown = described("dynamic entries")
            raise invalid(name, shown, "numbers", "Join systems with feedback or lft.")
    whole = _table([[parts["A"], parts["B"]], [parts["C"], parts["D"]]]).matrices
    F = np.block([[whole.J[:n, :n], whole.H[:n]], [whole.G[:, :n], whole.F]])
    G, H = np.vstack([whole.J[:n, n:], whole.G[:, n:]]), np.hstack([whole.J[n:, :n], whole.H[n:]])
    names = tuple(states) if states is not None else tuple(f"x[{i}]" for i in range(n))
    if len(names) != n:
        raise invalid("states", states, f"{n} names", "Name each state.")
    system = replace(whole, F=F, G=G, H=H, J=whole.J[n:, n:], states=names, dt=dt)
    for argument, given, count in (("inputs", inputs, nu), ("outputs", outputs, ny)):
        if given is not None and len(given) != count:
            raise invalid(argument, given, f"{count} names", "Name each signal.")
    return UncertainSystem(reduced(system).names(tuple(inputs or ()), tuple(outputs or ())))


def _column(B: Any) -> Any:
    """Return a list of entries as a column, as python-control reads B."""
    flat = isinstance(B, list | tuple | np.ndarray) and np.ndim(np.array(B, dtype=object)) == 1
    return np.array(B, dtype=object).reshape(-1, 1) if flat else B


def _table(rows: list[list[UncertainSystem]]) -> UncertainSystem:
    """Return blocks as one matrix."""
    heights = [row[0].shape[0] for row in rows]
    widths = [part.shape[1] for part in rows[0]]
    result = as_uncertain("matrix", np.zeros((sum(heights), sum(widths))))
    for i, row in enumerate(rows):
        left = np.eye(sum(heights))[:, sum(heights[:i]) : sum(heights[: i + 1])]
        for j, part in enumerate(row):
            right = np.eye(sum(widths))[sum(widths[:j]) : sum(widths[: j + 1])]
            if 0 not in part.shape:
                result = result + left * part * right
    return result
