"""A time by which a call has to end, which the loops deep inside it look at.

A search counts its work and asks its budget. A certificate has no budget: it is complete, or there
is none. So it is cut by an error, and what was not proven is never returned.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from robustpolish.errors import SolverError
from robustpolish.long_calls import Budget, now

GRACE = 0.5
"""Seconds beyond its limit that a call may take for a proof that is nearly complete."""

_until: ContextVar[float] = ContextVar("until", default=math.inf)


class OutOfTimeError(SolverError):
    """The time of a call was over before its result was proven."""


@contextmanager
def ends_with(budget: Budget, grace: float | None = None) -> Iterator[None]:
    """Cut what the block proves some time after the safety net of a budget is reached.

    Parameters
    ----------
    budget : Budget
    grace : float, optional
        That time, in seconds; :data:`GRACE` by default.

    Raises
    ------
    SolverError
        If :func:`look_at_the_clock` was called in the block after that.

    Examples
    --------
    >>> from robustpolish.long_calls import Budget
    >>> with ends_with(Budget(seconds=10.0)):
    ...     look_at_the_clock()
    """
    ends = now() + budget.seconds - budget.elapsed
    ends += GRACE if grace is None else grace
    token = _until.set(min(_until.get(), ends))
    try:
        yield
    except OutOfTimeError:
        raise SolverError(
            f"The time limit of {budget.seconds:g} s was reached before the controller that was "
            "found had a complete certificate. Raise time_limit."
        ) from None
    finally:
        _until.reset(token)


@contextmanager
def for_a_part(part: float) -> Iterator[None]:
    """Leave the block a part of the time that is left, so that something else can follow it."""
    begins = now()
    token = _until.set(begins + part * (_until.get() - begins))
    try:
        yield
    finally:
        _until.reset(token)


def look_at_the_clock(needed: float = 0.0) -> None:
    """Raise an error if the time is over, or less than the seconds that are needed is left.

    To be called before every step that cannot be cut; a few microseconds outside of calls that
    have to end.
    """
    if is_over(needed):
        raise OutOfTimeError("The time was over before the proof was complete.")


def is_over(needed: float = 0.0) -> bool:
    """Return whether the time is over, for what may end with as much as it has proven."""
    return now() + needed > _until.get()
