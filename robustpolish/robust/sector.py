"""The circle criterion for uncertain loops with sector-bounded nonlinearities."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import minimize

from robustpolish.base.arrays import Vector
from robustpolish.base.budget import single_threaded_blas
from robustpolish.base.checks import invalid
from robustpolish.base.results import Card, Displayed, quantities
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.plants.uncertain.system import UncertainSystem
from robustpolish.robust.questions import (
    reciprocal_below,
    require_uncertain_system,
    worst_case_gain,
)

# Evaluations of the nominal norm in the search for scalings of several sectors.
_EVALUATIONS = 60


@dataclass(frozen=True, eq=False, repr=False)
class SectorStability(Displayed):
    """Whether a loop is stable with every nonlinear force in its sector, and on every machine.

    Attributes
    ----------
    lower, upper : float
        The criterion bears sectors that are wider about their middle by at least `lower` times, on
        every machine within the bounds; on the machine of `witness` no more than `upper` times.
        That says nothing of instability: the criterion is sufficient.
    proven : bool
        Whether `lower` is proven, in ball arithmetic and for all frequencies.
    critical_frequency : float
        In rad/s, where the criterion is hardest.
    witness : mapping of str to float, complex or control.StateSpace
        The machine on which it is hardest, by what is uncertain.
    sectors : mapping of str to (float, float)

    Examples
    --------
    >>> import robustpolish as rp
    >>> c = rp.uncertain.real("c", 0.4, percent=25)
    >>> mass = rp.uncertain.system(
    ...     [[0, 1], [-1, -c]], [[0], [1]], [[1, 0]], inputs=["spring"], outputs=["spring"])
    >>> found = rp.robust_sector(mass, {"spring": (0.0, 0.5)})
    >>> found.stable, found.proven, round(found.upper, 2)
    (True, True, 1.33)
    """

    lower: float
    upper: float
    proven: bool
    critical_frequency: float
    witness: Mapping[str, Any] = field(default_factory=dict)
    sectors: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def stable(self) -> bool | None:
        """True if the loop is stable with all such forces; None if the criterion does not say."""
        return True if self.proven and self.lower >= 1 else None

    def _card(self) -> Card:
        rows = (
            *((f"sector of {name}", f"{low:.4g} to {high:.4g}")
              for name, (low, high) in self.sectors.items()),
            ("width that it bears, at least", self.lower),
            ("at most", self.upper),
            ("critical frequency [rad/s]", self.critical_frequency),
            ("proven", self.proven),
        )  # fmt: skip
        verdict = "stable" if self.stable else "undecided"
        note = "Stable with any such forces, also if they change with time, while they stay in it."
        return Card(f"Forces in sectors: {verdict}", (quantities(*rows),),
                    (note,) if self.stable else ())  # fmt: skip


@single_threaded_blas
def robust_sector(
    loop: UncertainSystem, sectors: Mapping[str, tuple[float, float]]
) -> SectorStability:
    """Prove a loop stable with nonlinear forces, on every machine within its bounds.

    Parameters
    ----------
    loop : UncertainSystem
        The closed loop without these forces. Each has an input, by which it acts, and an output of
        the same name, of which it is a function: ``u = -f(y, t)``.
    sectors : mapping of str to (float, float)
        By that name, the smallest and largest slope of lines through the origin between which the
        force lies: ``low y^2 <= f(y, t) y <= high y^2``.

    Returns
    -------
    SectorStability
        If it is stable: signals that are square integrable leave all others so.

    Raises
    ------
    InvalidInputError
        If a name is not both an input and an output, or a sector is empty.

    Notes
    -----
    The circle criterion [1]_: with the middle of the sectors put into the loop, what is left of the
    forces has at most their half widths as gain, and the small-gain theorem holds if the largest
    gain of the rest, in units of these, is below 1. That gain is bounded for every machine by
    :func:`worst_case_gain`. Several forces are weighed against each other by constants: scalings
    that change with frequency would prove nothing of nonlinear forces. A sector that holds up to an
    amplitude proves stability while the motion stays below it.

    References
    ----------
    .. [1] G. Zames, "On the input-output stability of time-varying nonlinear feedback systems",
       part II, IEEE Transactions on Automatic Control 11 (1966) 465-476.

    Examples
    --------
    A machine of uncertain damping with a hardening spring of 1 N/m^3 that is stretched by at most
    0.5 m:

    >>> import robustpolish as rp
    >>> c = rp.uncertain.real("c", 0.4, percent=25)
    >>> mass = rp.uncertain.system(
    ...     [[0, 1], [-1, -c]], [[0], [1]], [[1, 0]], inputs=["spring"], outputs=["spring"])
    >>> rp.robust_sector(mass, {"spring": (0.0, 1.0 * 0.5**2)}).stable
    True
    """
    require_uncertain_system(loop)
    if not isinstance(sectors, Mapping) or not sectors:
        raise invalid("sectors", sectors, "a mapping of names to (low, high)", "Name one at least.")
    known = sorted({*loop.input_labels} & {*loop.output_labels})
    ends = []
    for name, sector in sectors.items():
        if name not in known:
            listed = ", ".join(known) or "there is none"
            expected = f"names of both an input and an output: {listed}"
            raise invalid("sectors", name, expected, "Give the force an input and an output.")
        ends.append(_ends(name, sector))
    low, high = np.array(ends).T
    names = [*sectors]
    centred = loop[names, names].feedback(np.diag((low + high) / 2))
    half = (high - low) / 2
    scaled = _scaled(centred, half, _weights(centred, half))
    worst = worst_case_gain(scaled)
    lower, upper = reciprocal_below(worst.upper), reciprocal_below(worst.lower)
    where, told = worst.critical_frequency, dict(zip(names, ends, strict=True))
    return SectorStability(lower, upper, worst.proven, where, worst.witness, told)


def _ends(name: str, sector: Any) -> tuple[float, float]:
    try:
        low, high = (float(end) for end in sector)
    except (TypeError, ValueError):
        low, high = math.nan, math.nan
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        remedy = "Write (0.0, 400.0)."
        raise invalid(("sectors", name), sector, "two numbers, the smaller first", remedy)
    return low, high


def _scaled(centred: UncertainSystem, half: Vector, weights: Vector) -> UncertainSystem:
    """Return the loop from forces to forces in units of half widths, weighed by constants."""
    return np.diag(half * weights) * centred * np.diag(1 / weights)


def _weights(centred: UncertainSystem, half: Vector) -> Vector:
    """Return constants that make the nominal gain small; any prove as much."""
    count = half.size
    if count == 1:
        return np.ones(1)

    def gain(logs: Vector) -> float:
        nominal: Any = _scaled(centred, half, np.exp2([0.0, *logs])).nominal
        system = hasattr(nominal, "poles")
        value = float(hinf_norm(nominal).value if system else np.linalg.norm(nominal, 2))
        return math.log(value) if 0 < value < math.inf else 0.0

    found = minimize(gain, np.zeros(count - 1), method="Nelder-Mead",
                     options={"maxfev": _EVALUATIONS, "xatol": 0.05})  # fmt: skip
    logs = found.x if np.isfinite(found.x).all() else np.zeros(count - 1)
    return np.exp2([0.0, *np.round(logs, 1)])
