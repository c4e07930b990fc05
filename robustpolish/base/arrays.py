"""The array types that signatures name, by what they hold and how many axes they have; tolerances.

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

# Relative sizes below which a computed number is none, or two of them are one.

SUMMED = 1e-14
"""What rounding leaves of one sum of products."""

SOLVED = 1e-13
"""What it leaves of one factorisation or solution."""

ROUNDING = 1e-12
"""What it leaves of a computation in several such steps."""

SAME = 1e-9
"""Numbers of separate computations that differ by less are one: nobody asks for more digits."""

AGREE = 1e-6
"""Two methods, or a value and its copy in a file, agree to this."""

NOTHING = 1e-30
"""In scaled units, smaller numbers are as good as zero."""
