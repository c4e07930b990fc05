"""Powers of two as factors that round nothing, and the refusal where doubles end.

A double has exponents from -1074 to 1023. A factor that is a power of two changes the exponent
alone, unless the product leaves that range: then something became infinite, or zero, or lost bits.
Nothing that is computed afterwards would be true, so that is an error and not a result.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from robustpolish.base.arrays import Matrix
from robustpolish.base.checks import described, invalid
from robustpolish.errors import InvalidInputError

LARGEST = 1e100
"""Entries above it, in units that make a system as even as it can be, are refused: the third power
of what is computed with them still has to be a double."""

MOST_EXPONENT = 1000
"""Of powers of two that anything is scaled by."""


# The smallest double with all its bits.
_LEAST = float(np.finfo(float).tiny)


class FloatRangeError(InvalidInputError):
    """A number that is computed on the way and that no double holds."""

    def __init__(self) -> None:
        super().__init__(
            "the numbers of the system are too far apart for double precision. Choose other units "
            "for states, signals or time, and write 0 for what is nothing."
        )


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


def scaled(M: Any, *factors: Any) -> Matrix:
    """Return a matrix times powers of two, exactly.

    Parameters
    ----------
    M : ndarray
    *factors : float or ndarray
        Powers of two, broadcast against `M`; their own product may leave the range of doubles.

    Returns
    -------
    ndarray

    Raises
    ------
    FloatRangeError
        If an entry overflows, vanishes or loses bits.

    Examples
    --------
    >>> import numpy as np
    >>> scaled(np.array([[3.0]]), 2.0**1000, 2.0**-999)
    array([[6.]])
    >>> scaled(np.array([[1.0]]), 2.0**-1000, 2.0**-1000)
    Traceback (most recent call last):
    ...
    robustpolish.linear.arithmetic.powers_of_two.FloatRangeError: the numbers of the system...
    """
    by: Any = 0
    for factor in factors:
        if not np.all((factor > 0) & np.isfinite(factor)):
            raise FloatRangeError
        by = by + np.frexp(factor)[1] - 1
    with np.errstate(over="ignore", under="ignore"):
        found = np.ldexp(M, by)
        if not np.array_equal(np.ldexp(found, -by), M):
            raise FloatRangeError
    return found


def bracket(value: float, lower: float, upper: float, factor: float) -> tuple[float, float, float]:
    """Return a number and its bounds times a factor, bounds that stay true where doubles end.

    Parameters
    ----------
    value, lower, upper : float
        At least zero.
    factor : float
        Above zero; what is smaller than all normal doubles has lost bits and bounds nothing.

    Returns
    -------
    tuple of float
        value, lower, upper.

    Raises
    ------
    FloatRangeError
        If a finite bound is no longer finite.

    Examples
    --------
    >>> bracket(1.0, 0.5, 2.0, 4.0)
    (4.0, 2.0, 8.0)
    >>> bracket(1.0, 0.5, 2.0, 1e-320)[1:]
    (0.0, 2.2250738585072014e-308)
    """
    most = upper * factor
    if math.isinf(most) and not math.isinf(upper):
        raise FloatRangeError
    if upper > 0:
        most = max(most, _LEAST)
    least = lower * factor
    return value * factor, least if least >= _LEAST else 0.0, most


@contextmanager
def range_errors_as_input_errors(argument: str, matrices: Mapping[str, Any]) -> Iterator[None]:
    """Turn :class:`FloatRangeError` into an error about the largest and the smallest entry.

    Parameters
    ----------
    argument : str
        Whose matrices they are, for the message.
    matrices : mapping of str to ndarray
        The matrices as they came.

    Raises
    ------
    InvalidInputError

    Examples
    --------
    >>> import numpy as np
    >>> with range_errors_as_input_errors(
    ...     "system", {"A": np.array([[1e300]]), "B": np.array([[1e-300]])}
    ... ):
    ...     raise FloatRangeError
    Traceback (most recent call last):
    ...
    robustpolish.errors.InvalidInputError: system: got entries from 1e-300 (B[0, 0]) to 1e+300...
    """
    try:
        yield
    except FloatRangeError:
        raise entry_range_error(argument, matrices) from None


def entry_range_error(argument: str, matrices: Mapping[str, Any]) -> InvalidInputError:
    """Build the error about numbers that doubles cannot multiply; the caller raises it."""
    sizes = [
        (abs(float(M[place])), f"{name}[{', '.join(map(str, place))}]")
        for name, M in matrices.items()
        for place in np.ndindex(np.shape(M))
        if M[place]
    ]
    (low, first), (high, last) = min(sizes, default=(0.0, "")), max(sizes, default=(0.0, ""))
    shown = described(f"entries from {low:.3g} ({first}) to {high:.3g} ({last})")
    want = "numbers whose products and ratios double precision can hold"
    remedy = "Choose other units for states, signals or time, and write 0 for what is nothing."
    return invalid(argument, shown, want, remedy)


def refuse_extreme(argument: str, matrices: Mapping[str, Any]) -> None:
    """Refuse matrices of which the largest entry is not zero, yet absurd: for given units.

    That is one above :data:`LARGEST` or below its inverse. For what is not scaled before it is
    computed with. Small entries beside larger ones are what matrix exponentials leave.

    Raises
    ------
    InvalidInputError

    Examples
    --------
    >>> import numpy as np
    >>> refuse_extreme("system", {"A": np.array([[-1.0, 1e200]])})
    Traceback (most recent call last):
    ...
    robustpolish.errors.InvalidInputError: system: got entries from 1 (A[0, 0]) to 1e+200...
    """
    with range_errors_as_input_errors(argument, matrices):
        refuse_out_of_range(*matrices.values())
        for M in matrices.values():
            if 0 < np.abs(M).max(initial=0.0) < 1 / LARGEST:
                raise FloatRangeError


def refuse_out_of_range(*matrices: Any) -> None:
    """Refuse scaled matrices with entries above :data:`LARGEST`, or that are not finite.

    Raises
    ------
    FloatRangeError
    """
    for M in matrices:
        if M.size and not np.abs(M).max() <= LARGEST:
            raise FloatRangeError
