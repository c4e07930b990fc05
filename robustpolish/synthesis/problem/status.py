"""How good a design is known to be, in one word, and which word a whole of several parts gets."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

Status = Literal["optimal", "suboptimal", "infimum_not_attained", "time_limit"]

# The word that says least comes first. After "time_limit" another machine may find something else;
# "suboptimal" leaves open how much is to be gained, and by what; "infimum_not_attained" says both:
# as much as wanted, by larger gains; "optimal" says that nothing is.
_WORST_FIRST: tuple[Status, ...] = (
    "time_limit",
    "suboptimal",
    "infimum_not_attained",
    "optimal",
)


def worst_status(statuses: Iterable[str]) -> Status:
    """Return the status of a whole: that of the part about which least is known.

    Examples
    --------
    >>> worst_status(["optimal", "infimum_not_attained", "suboptimal"])
    'suboptimal'
    >>> worst_status([])
    'optimal'
    """
    found = set(statuses)
    words: list[Status] = [status for status in _WORST_FIRST if status in found]
    return words[0] if words else "optimal"
