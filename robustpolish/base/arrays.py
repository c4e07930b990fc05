"""The array types that signatures name, by what they hold and how many axes they have.

Types do not know shapes: Vector and Matrix tell the reader what Array leaves open. Shapes stand in
the docstrings, and `robustpolish.base.checks` checks them.
"""

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
"""Spacing of doubles at one."""
