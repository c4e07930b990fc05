"""What a loop certified with Pade models is with its delays as they are."""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np

from robustpolish.analysis import DelayedSystem, DelayStability, delay_stability, singular_values
from robustpolish.models import GeneralizedPlant


@dataclass(frozen=True, eq=False)
class ExactDelays:
    """A loop with its delays as they are.

    Attributes
    ----------
    stability : DelayStability
        Whether it is stable, and how that was decided.
    gain : float or None
        The largest singular value from w to z that was found over frequency, a lower bound of the
        norm; None if the loop was not found stable, or where it is not asked for.
    orders : mapping of str to int
        Order of the Pade approximation of each delayed signal, on which the proof rests.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> lag = control.tf([1], [1, 1], inputs="u", outputs="y")
    >>> plant = rp.GeneralizedPlant.from_loop(lag).with_delay("u", 0.5)
    >>> print(rp.certify(plant, [[-1.0]]).exact_delays)
    proven for Pade models of the delays (u of order 3);
    with the exact delays the loop is stable and its gain reaches 2.0...
    """

    stability: DelayStability
    gain: float | None
    orders: dict[str, int]

    def __str__(self) -> str:
        models = ", ".join(f"{name} of order {order}" for name, order in self.orders.items())
        found = {
            "stable": "the loop is stable",
            "unstable": "the loop is UNSTABLE",
            "undecided": f"it was not decided whether the loop is stable: {self.stability.reason}",
        }[self.stability.verdict]
        reached = "" if self.gain is None else f" and its gain reaches {self.gain:.6g}"
        proven = f"proven for Pade models of the delays ({models})"
        return f"{proven}; with the exact delays {found}{reached}"


def exact_delays(
    plant: GeneralizedPlant, controller: control.StateSpace, norm: str
) -> ExactDelays | None:
    """Check a loop with its delays as they are; None for a plant whose model is exact.

    Parameters
    ----------
    plant : GeneralizedPlant
    controller : control.StateSpace
    norm : {"hinf", "h2"}
        The gain is looked for with the first only.

    Returns
    -------
    ExactDelays or None
    """
    lines = plant.wiring.lines
    if not lines:
        return None
    loop = plant.delayed_loop(controller)
    stability = delay_stability(loop)
    gain = _gain(loop) if stability and norm == "hinf" and plant.nw and plant.nz else None
    orders: dict[str, int] = {}
    for line in lines:  # the least of a signal that is delayed twice
        orders[line.name] = min(line.order, orders.get(line.name, line.order))
    return ExactDelays(stability, gain, orders)


def _gain(loop: DelayedSystem) -> float:
    """Return the largest gain over the frequencies that matter to the Pade model, and near it."""
    omega = 2 * np.pi * singular_values(loop.pade_model())["frequency"].to_numpy()
    omega = np.concatenate([[0.0], omega])
    best = 0.0
    for _ in range(3):
        gains = np.linalg.norm(loop.response(omega), 2, axis=(1, 2))
        gains[~np.isfinite(gains)] = 0.0
        at = int(gains.argmax())
        best = max(best, float(gains[at]))
        omega = np.linspace(omega[max(at - 1, 0)], omega[min(at + 1, omega.size - 1)], 41)
    return best
