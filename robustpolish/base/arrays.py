"""The array types that signatures name, by what they hold and how many axes they have; exponents.

Types do not know shapes: Vector and Matrix tell the reader what Array leaves open. Shapes stand in
the docstrings, and `robustpolish.base.checks` checks them.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Doubles along any number of axes, such as samples by signals."""

Vector = NDArray[np.float64]
"""Doubles along one axis."""

Matrix = NDArray[np.float64]
"""Doubles in rows and columns."""

AnyArray = NDArray[Any]
"""Numbers of any kind along any number of axes, real or complex."""

AnyMatrix = NDArray[Any]
"""Numbers of any kind in rows and columns, real or complex."""

AnyVector = NDArray[Any]
"""Numbers of any kind along one axis, real or complex."""

EPS = float(np.finfo(float).eps)
"""Spacing of doubles at one."""

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
