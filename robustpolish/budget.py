"""How much work a search may do: counted, so that every machine gives the same answer."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field


def step_cost(states: int) -> float:
    """Return the work of one step on matrices of this size, in steps on small ones.

    A step is a dense factorisation or what costs as much. On few states it is all
    overhead; on many it grows with the cube.

    Examples
    --------
    >>> step_cost(0), step_cost(40)
    (1.0, 9.0)
    """
    return 1.0 + (states / 20.0) ** 3


@dataclass
class Budget:
    """Work that may be spent, with seconds as a safety net only.

    What a search does may depend on :attr:`exhausted`, which is the same on every machine. That
    the safety net was reached (:attr:`late`) has to be said in status and message.

    Parameters
    ----------
    work : float
        Steps, each weighted by :func:`step_cost`; infinite for no limit.
    seconds : float
        The safety net; infinite for none.

    Examples
    --------
    >>> budget = Budget(10.0)
    >>> half = budget.share(0.5)
    >>> half.spend(5.0)
    >>> half.exhausted, budget.exhausted, budget.work_left
    (True, False, 5.0)
    """

    work: float = math.inf
    seconds: float = math.inf
    spent: float = field(default=0.0, init=False)
    _parent: Budget | None = field(default=None, init=False, repr=False)
    _start: float = field(default_factory=lambda: time.monotonic(), init=False, repr=False)
    _late: bool = field(default=False, init=False, repr=False)

    def spend(self, work: float = 1.0) -> None:
        """Count work, here and in the budgets that this one is a share of."""
        self.spent += work
        if self._parent is not None:
            self._parent.spend(work)

    def share(self, part: float) -> Budget:
        """Return a budget for a part of the work that is left, under the same safety net."""
        own = Budget(part * self.work_left, self.seconds)
        own._parent, own._start = self, self._start
        return own

    @property
    def work_left(self) -> float:
        """Work that may still be done, at least zero."""
        left = max(0.0, self.work - self.spent)
        return left if self._parent is None else min(left, self._parent.work_left)

    @property
    def exhausted(self) -> bool:
        """Whether the work is done; the same on every machine."""
        return self.work_left <= 0

    @property
    def late(self) -> bool:
        """Whether the safety net was reached; once it was, that stays so."""
        self.look()
        return self._late

    def look(self) -> None:
        """Look at the clock, after a call that ends with the safety net by itself."""
        reached: Budget | None = self
        if not self._late and self.elapsed >= self.seconds:
            while reached is not None:
                reached._late, reached = True, reached._parent

    @property
    def stopped(self) -> bool:
        """Whether a search has seen that it was late, and so may have ended for that reason."""
        return self._late

    @property
    def over(self) -> bool:
        """Whether to stop, for whichever reason."""
        return self.exhausted or self.late

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.monotonic() - self._start

    @property
    def seconds_left(self) -> float:
        """Seconds until the safety net, at least zero."""
        return max(0.0, self.seconds - self.elapsed)
