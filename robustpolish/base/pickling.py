"""Pickling and copying of linear systems, read-only mappings and balls.

Results hold linear systems, mappings that cannot be changed and balls. A `control.StateSpace`
carries functions that exist in memory alone and lead back to the system that made them; a
`MappingProxyType` and the balls of python-flint have no copy at all. They are registered here, so
that every result can be copied or sent to another process. Files that outlive a version are written
by `save`.
"""

from __future__ import annotations

import copyreg
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import control
import flint

Part = tuple[int, int] | float
"""An integer times a power of two, or what is not finite."""

_REBUILT_ATTRIBUTES = frozenset({"updfcn", "outfcn"})
_MORE_THAN_RADIUS_BITS = 38


def read_only_mapping(content: dict[Any, Any]) -> Mapping[Any, Any]:
    """Return a mapping that cannot be changed; pickle asks for it by this name."""
    return MappingProxyType(content)


def _reduced_system(system: control.StateSpace) -> tuple[Any, ...]:
    # A new system of the same matrices brings functions of its own; all else is as it was.
    kept = {name: value for name, value in vars(system).items() if name not in _REBUILT_ATTRIBUTES}
    return _system, (system.A, system.B, system.C, system.D, system.dt), kept


def _system(*matrices: Any) -> control.StateSpace:
    return control.StateSpace(*matrices, remove_useless_states=False)


def _part(number: Any) -> Part:
    try:
        mantissa, exponent = number.man_exp()
    except ValueError:  # not finite
        return float(number)
    return int(mantissa), int(exponent)


def _reduced_ball(ball: Any) -> tuple[Any, ...]:
    return _ball, (_part(ball.mid()), _part(ball.rad()))


def _ball(middle: Part, radius: Part) -> Any:
    if isinstance(radius, tuple) and radius[0]:
        # A radius that is given is rounded up to thirty bits, at times by a whole unit of them.
        # What lies just below comes back as it was.
        mantissa, exponent = radius
        spare = _MORE_THAN_RADIUS_BITS - mantissa.bit_length()
        radius = (mantissa << spare) - 1, exponent - spare
    return flint.arb(middle, radius)


def register() -> None:
    """Tell `pickle` and `copy` how these types are copied."""
    copyreg.pickle(MappingProxyType, lambda one: (read_only_mapping, (dict(one),)))  # pyright: ignore[reportArgumentType]
    copyreg.pickle(control.StateSpace, _reduced_system)
    copyreg.pickle(flint.arb, _reduced_ball)
    copyreg.pickle(flint.arb_mat, lambda M: (flint.arb_mat, (M.nrows(), M.ncols(), M.entries())))
