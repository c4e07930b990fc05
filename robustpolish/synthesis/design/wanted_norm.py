"""Which norm was asked for: any below a number, or the smallest within a range."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from robustpolish.errors import InfeasibleError
from robustpolish.synthesis.certificate.certificate import Norm
from robustpolish.validation import invalid

Gamma = float | Sequence[float]
"""A norm to stay below, or the range of a search."""

_EXPECTED = "a positive number, or (low, high) with 0 <= low <= high and high > 0"
_REMEDY = (
    "Pass gamma=2.0 for any controller with a norm below 2, or gamma=(1.0, 2.0) to search the "
    "smallest norm between these."
)
# Proven bounds lie a little above the norm: what is aimed at lies by this share below.
_ROOM = 2e-4


@dataclass(frozen=True)
class WantedNorm:
    """Which norms will do.

    Attributes
    ----------
    enough : float
        The search need not go below.
    below : float
        The norm must not lie above; infinite if nothing was asked.
    """

    enough: float = 0.0
    below: float = np.inf

    @classmethod
    def checked(cls, gamma: Any) -> WantedNorm:
        """Read the argument ``gamma`` of a method.

        Raises
        ------
        InvalidInputError
            If it is neither a positive number nor a range.

        Examples
        --------
        >>> WantedNorm.checked(2.0)
        WantedNorm(enough=2.0, below=2.0)
        >>> WantedNorm.checked((0.5, 2.0))
        WantedNorm(enough=0.5, below=2.0)
        """
        if gamma is None:
            return ANY_NORM
        numbers = np.asarray(gamma, dtype=object).ravel().tolist()
        if any(isinstance(number, bool | np.bool_ | str | bytes | complex) for number in numbers):
            raise invalid("gamma", gamma, _EXPECTED, _REMEDY)
        try:
            ends = [float(number) for number in numbers]
        except (TypeError, ValueError):
            raise invalid("gamma", gamma, _EXPECTED, _REMEDY) from None
        if len(ends) == 1 and np.isfinite(ends[0]) and ends[0] > 0:
            return cls(ends[0], ends[0])
        if len(ends) != 2 or not 0 <= ends[0] <= ends[1] or np.isinf(ends[0]) or ends[1] == 0:
            raise invalid("gamma", gamma, _EXPECTED, _REMEDY)
        return cls(*ends)

    @property
    def asks(self) -> bool:
        """Whether anything was asked for."""
        return self.enough > 0 or np.isfinite(self.below)

    def in_unit(self, unit: float) -> WantedNorm:
        """Return it for norms that are counted in units of `unit`."""
        return WantedNorm(self.enough / unit, self.below / unit)

    def limited(self, goal: float) -> float:
        """Return the norm that a search aims at that would aim at `goal` by itself."""
        if not self.asks:
            return goal
        return min(max(goal, self.enough), self.below) * (1 - _ROOM)

    def in_words(self) -> str:
        """Return what was asked for, as it is told in messages; empty if nothing was."""
        if not self.asks:
            return ""
        if self.enough == self.below:
            return f"a norm below gamma = {self.below:.6g}"
        above = f"{self.below:.6g}" if np.isfinite(self.below) else "infinity"
        return f"a norm within gamma = {self.enough:.6g} to {above}"


ANY_NORM = WantedNorm()
"""Nothing was asked for."""


def norm_in_words(norm: Norm) -> str:
    """Return the name of a norm as messages have it."""
    return "H-infinity" if norm == "hinf" else "H2"


def out_of_reach(wanted: WantedNorm, bound: float, norm: Norm, how: str) -> InfeasibleError:
    """Return the error for a norm that no controller reaches."""
    return InfeasibleError(
        f"gamma: no controller has {wanted.in_words()}. The {norm_in_words(norm)} norm of every "
        f"stabilising controller's loop is at least {bound:.6g}, {how}. Ask for more than that."
    )
