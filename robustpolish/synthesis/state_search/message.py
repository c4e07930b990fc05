"""What a state feedback says about itself: status and message."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from robustpolish.synthesis.design.status import Status
from robustpolish.synthesis.design.wanted_norm import ANY_NORM, WantedNorm


def message(
    status: Status,
    achieved: float,
    lower_bound: float,
    gain: float,
    tolerance: float,
    gain_bound: float | None,
    has_region: bool,
    exhausted: bool,
    history: Sequence[Mapping[str, Any]],
    wanted: WantedNorm = ANY_NORM,
) -> str:
    """Say what happened and what to try next.

    Parameters
    ----------
    status : str
    achieved, lower_bound, gain : float
        Norm of the loop, what none falls below, and largest singular value of F, in the plant's
        units.
    tolerance : float
    gain_bound : float or None
    has_region : bool
    exhausted : bool
        Whether the search ended with its work and not by itself.
    history : sequence of mapping
        The trade-off is read from the entries with a price.
    wanted : WantedNorm, optional
    """
    found = f"Norm {achieved:.6g} with a gain of {gain:.4g} (largest singular value)."
    if lower_bound > 0:
        found += f" No state feedback has a norm below {lower_bound:.6g}."
    if status == "optimal":
        return f"{found} That is within {tolerance:.0e} of it: the design is optimal."
    if status == "time_limit":
        return (
            f"{found} Time ran out before the search ended: another run may find another gain. "
            "Raise time_limit for a better one."
        )
    if status == "infimum_not_attained":
        return (
            f"{found} The infimum is not attained: smaller norms need ever larger gains"
            f"{_trade_off(history)}. Set control_weight, gain_bound or pole_region to ask for a "
            "problem that has an optimum."
        )
    if exhausted:
        return f"{found} The search ended with its work, because the plant is large."
    if wanted.asks:
        found += f" It was asked for {wanted.in_words()}."
        if achieved <= wanted.enough:
            return found + " What lies below that was given away for a smaller gain."
    if gain_bound is not None:
        return (
            f"{found} The bound {gain_bound:.6g} on the gain is kept. It makes the problem "
            "nonconvex: this is a local optimum, and a better gain is not ruled out."
        )
    if has_region:
        return (
            f"{found} The poles lie in the region. One Lyapunov matrix serves norm and region, "
            "which is sufficient but not necessary: a better gain is not ruled out."
        )
    return (
        f"{found} It could not be shown to be within {tolerance:.0e} of the optimum: gains next to "
        "it are too large to compute with, or a control has no price. Try the other method, or set "
        "control_weight."
    )


def _trade_off(history: Sequence[Mapping[str, Any]]) -> str:
    rungs = [e for e in history if "price" in e and e.get("part") == 0]
    shown = [f"{e['achieved']:.2g} at {e['gain']:.2g}" for e in rungs if "gain" in e]
    return f" (norm at gain of the first part: {', '.join(shown[:12])})" if shown else ""
