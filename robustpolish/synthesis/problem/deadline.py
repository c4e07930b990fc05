"""A limit on time that every search obeys."""

from __future__ import annotations

import time
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Deadline:
    """Seconds that a call may take, counted from now.

    Parameters
    ----------
    seconds : float
        The limit; infinite for none.

    Examples
    --------
    >>> Deadline(60.0).expired
    False
    >>> Deadline(0.0).expired
    True
    """

    seconds: float
    start: float = field(default_factory=lambda: time.monotonic())

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.monotonic() - self.start

    @property
    def remaining(self) -> float:
        """Seconds left, at least zero."""
        return max(0.0, self.seconds - self.elapsed)

    @property
    def expired(self) -> bool:
        """Whether no time is left."""
        return self.elapsed >= self.seconds

    def share(self, part: float) -> Deadline:
        """Return a deadline after a part of the time that is left."""
        return Deadline(part * self.remaining)
