"""Lower bounds of the H-infinity norm, proven in long arithmetic.

Whether the Riccati equations fail is decided by numbers that doubles cannot hold: prices of 1e-12
beside one, zeros beside the axis. With hundreds of digits nothing is decided by rounding.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from robustpolish.deadline import OutOfTimeError, look_at_the_clock
from robustpolish.exact.balls import precision
from robustpolish.exact.riccati import UndecidedError
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.riccati.half_plane import LongPlant

PROVABLE_STATES = 20
"""Up to so many states a bound is proven; the work grows with their fourth power.

At 10 states a norm takes 0.1 s, at 20 states 1 to 5 s, and three norms are the least."""

PROVEN = "by Riccati equations in long arithmetic"
"""How a bound is known that holds for every controller."""


@dataclass(frozen=True)
class ProofPolicy:
    """Limits of the search for a bound that can be proven.

    Attributes
    ----------
    bits : tuple of int
        Precisions that are tried where the digits do not suffice: most plants need the first.
    first : float
        How far below and above a guess is tried first, in tolerances.
    growth : float
        By what factor the step grows where the guess was wrong.
    steps : int
        Norms that are tried at most; most plants need three, a guess wrong by 1e40 needs 30.
    least, most : float
        Smaller bounds, in scaled units, are as good as zero, and larger ones as good as infinite.
    given_away : float
        Share of the bound: the nearer a norm lies to the infimum, the more digits it takes.
    """

    bits: tuple[int, ...] = (768, 1536, 3072)
    first: float = 0.5
    growth: float = 8.0
    steps: int = 40
    least: float = 1e-30
    most: float = 1e30
    given_away: float = 1e-9


_POLICY = ProofPolicy()


def proven_bound(plant: PlantMatrices, guess: float, tolerance: float) -> float:
    """Return a norm that surely no controller reaches, as large as that can be proven.

    Parameters
    ----------
    plant : PlantMatrices
        Scaled, continuous, without D22.
    guess : float
        Where the infimum may be. A wrong one takes longer.
    tolerance : float
        How much, relative, may be given away.

    Returns
    -------
    float
        Zero where nothing could be proven in the time there is.
    """
    lower, upper = 0.0, math.inf
    trials = _Trials(plant)
    step = _POLICY.first * tolerance
    trial = max(guess, _POLICY.least) / (1 + step)
    for _ in range(_POLICY.steps):
        try:
            look_at_the_clock()
            out_of_reach = trials.are_out_of_reach(trial)
        except OutOfTimeError:
            break
        if out_of_reach:
            lower = trial
        else:
            upper = trial
        if upper <= max(lower * (1 + tolerance), _POLICY.least) or lower >= _POLICY.most:
            break
        if lower > 0 and upper < math.inf:
            trial = math.sqrt(lower * upper)
            continue
        # Beside the guess first, then ever farther.
        trial = lower * (1 + step) ** 2 if lower else upper / (1 + step)
        step *= _POLICY.growth
    return lower * (1 - _POLICY.given_away)


class _Trials:
    """A plant in as many bits as its norms have needed."""

    def __init__(self, plant: PlantMatrices) -> None:
        self._plant = plant
        self._bits = list(_POLICY.bits)
        self._long: LongPlant | None = None

    def are_out_of_reach(self, gamma: float) -> bool:
        """Tell whether surely no controller has this norm."""
        while self._bits:
            with precision(self._bits[0]):
                try:
                    self._long = self._long or LongPlant.of(self._plant)
                    return self._long.is_out_of_reach(gamma)
                except UndecidedError:
                    self._bits.pop(0)
                    self._long = None
        return False
