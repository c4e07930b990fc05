"""One line of the benchmark: a task, our time, a peer's time in the same run, and why."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from robustpolish.synthesis.lmi.program import run_with_time_limit


@dataclass(frozen=True)
class Row:
    """What was timed, on one thread, in milliseconds of the processor.

    Attributes
    ----------
    family : str
        The table that it belongs to.
    task : str
        What was done.
    ours, peer : str
        Who did it; `peer` is empty where there is none.
    our_ms, peer_ms : float or None
        None where there was no answer.
    answers : str
        How the two answers compare, or how good ours is.
    asked : float or None
        The largest ratio of our time to the peer's (or, with `seconds`, the longest time of ours)
        that is aimed at.
    seconds : bool
        Whether `asked` is a time in seconds.
    reason : str
        Why the peer is quicker, or why a time is missing. Kept only where one of them is so.
    """

    family: str
    task: str
    ours: str
    our_ms: float | None
    peer: str = ""
    peer_ms: float | None = None
    answers: str = ""
    asked: float | None = None
    seconds: bool = False
    reason: str = ""

    @property
    def ratio(self) -> float | None:
        """Our time over the peer's."""
        if self.our_ms is None or self.peer_ms is None:
            return None
        return self.our_ms / self.peer_ms

    @property
    def needs_reason(self) -> bool:
        """Whether the peer is quicker, or one of the times is missing."""
        missing = self.our_ms is None or (bool(self.peer) and self.peer_ms is None)
        return missing or (self.ratio or 0.0) > 1.0

    @property
    def met(self) -> bool | None:
        """Whether what is aimed at was reached; None where nothing is."""
        found = self.our_ms if self.seconds else self.ratio
        if self.asked is None or found is None:
            return None
        return found <= self.asked * (1e3 if self.seconds else 1.0)

    def as_json(self) -> dict[str, Any]:
        """Return the fields, the ratio and the verdict, numbers to four digits."""
        fields = asdict(self) | {"ratio": self.ratio, "met": self.met}
        if not self.needs_reason:
            fields["reason"] = ""
        return {
            name: float(f"{value:.4g}") if isinstance(value, float) else value
            for name, value in fields.items()
        }


def milliseconds(repeats: int, call: Callable[..., Any], *given: Any, **named: Any) -> float:
    """Return the least time of the processor that a call takes, after one that warms up."""
    call(*given, **named)
    return min(once(call, *given, **named)[0] for _ in range(repeats))


def once(call: Callable[..., Any], *given: Any, **named: Any) -> tuple[float, Any]:
    """Return the time of the processor in ms that a call takes, and what it returns."""
    start = time.process_time()
    found = call(*given, **named)
    return 1e3 * (time.process_time() - start), found


def limited(seconds: float, call: Callable[..., Any], *given: Any) -> tuple[float | None, Any]:
    """Do the same in a process of its own; None and the kind of end where there is no answer.

    What comes back is to be a number or another small thing that can be pickled.
    """

    def attempt() -> tuple[float | None, Any]:
        try:
            return once(call, *given)
        except Exception as error:
            return None, type(error).__name__

    return run_with_time_limit(attempt, seconds) or (None, f"no answer in {seconds:g} s")


def differ(ours: float, theirs: float) -> str:
    """Say by how much two answers differ, relative to the larger."""
    largest = max(abs(ours), abs(theirs))
    return f"differ by {abs(ours - theirs) / largest:.0e}" if largest else "both zero"
