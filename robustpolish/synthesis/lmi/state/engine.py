"""State feedback by linear matrix inequalities, solved again in better coordinates."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.long_calls import Budget
from robustpolish.synthesis.lmi.state.coordinates import Coordinates
from robustpolish.synthesis.lmi.state.program import Demand, SolvedProgram, StatePrograms
from robustpolish.synthesis.problem.full_state import compressed, state_gain_norm, with_price
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.riccati.state import lqr_gain
from robustpolish.synthesis.state_search.engine import StateEngine, StateGain
from robustpolish.synthesis.state_search.policy import POLICY


class LmiStateEngine(StateEngine):
    """Inequalities in Y and F Y, each answer verified from its loop.

    The first solve is made in the given states. Each further one uses states in which the
    last Y is the identity, controls in which the last gain is of order one, and a congruence
    that evens out the Lyapunov inequality, so that nothing near the optimum is small.
    """

    def search(self, plant: PlantMatrices, budget: Budget) -> StateGain | None:
        """Minimise the norm; see :class:`StateEngine`."""
        p = compressed(plant)
        programs = StatePrograms(p, self, budget, [])
        first = state_gain_norm(p, lqr_gain(plant), self.norm)
        start = Coordinates.plain(p, first if 0 < first < math.inf else 1.0)
        found = _rounds(programs, start)
        if (found is None or not found.agreed) and not budget.over:
            other = _rounds(programs, _approached(programs, start))
            if found is None or (other is not None and other.better_than(found)):
                found = other
        if found is None:
            return None
        gain = found.best.gain
        if self.norm == "h2":
            # The smallest bound of (10.28) for this gain, without noise, is the Gramian's.
            gain = replace(gain, claimed=gain.achieved)
        else:
            claimed = found.claimed
            near = 0.5 * gain.achieved < claimed < gain.achieved
            gain = _smaller(programs, found, claimed if near else gain.achieved)
        claimed = max(gain.claimed, gain.achieved)
        return replace(gain, claimed=claimed, history=tuple(programs.history))


@dataclass(frozen=True, eq=False)
class _Rounds:
    """The best of several rounds, the next coordinates, the last claim, and whether to trust."""

    best: SolvedProgram
    coordinates: Coordinates
    claimed: float
    agreed: bool

    def better_than(self, other: _Rounds) -> bool:
        less = self.best.gain.achieved < other.best.gain.achieved
        return less or (self.agreed and not other.agreed)


def _rounds(programs: StatePrograms, coordinates: Coordinates) -> _Rounds | None:
    """Solve again and again, each time in the coordinates that the last answer suggests."""
    engine, older = programs.engine, coordinates
    best: SolvedProgram | None = None
    agreed = False
    claimed, tolerance = math.inf, POLICY.solver_tolerance
    for number, noise in enumerate(POLICY.noise, start=1):
        if programs.budget.over:
            break
        step = f"inequalities, round {number}"
        solved = _solved_somehow(programs, coordinates, older, noise, tolerance, step)
        if solved is None:
            break
        older, coordinates = coordinates, solved.next
        achieved, claimed = solved.gain.achieved, solved.gain.claimed
        settled = best is not None and _settled(solved.gain, best.gain, engine)
        if achieved > claimed * (1 + engine.slack):
            # The solver went so near the edge that its gain is wrong: stay further inside.
            tolerance = min(30 * tolerance, POLICY.tightest_stay * engine.slack)
        near = best.gain.achieved if best is not None and engine.norm == "h2" else claimed
        if achieved == 0:  # nothing is below that
            return _Rounds(solved, coordinates, 0.0, True)
        agreed = agreed or settled or abs(near / achieved - 1) < POLICY.agreement * engine.slack
        if best is None or achieved < best.gain.achieved:
            best = solved
        if settled:
            break
    if best is None or not math.isfinite(best.gain.achieved):
        return None
    return _Rounds(best, coordinates, claimed, agreed)


def _solved_somehow(
    programs: StatePrograms,
    coordinates: Coordinates,
    older: Coordinates,
    noise: float,
    tolerance: float,
    step: str,
) -> SolvedProgram | None:
    """Solve in new coordinates; where the solver breaks down, more plainly, then in the old."""
    plain = coordinates.without_congruence()
    attempts = (
        (coordinates, tolerance),
        (plain, max(tolerance, POLICY.eased_tolerance)),
        (replace(plain, T=older.T), POLICY.solver_tolerance),
    )
    for attempt, eased in attempts:
        solved = programs.solve(attempt, Demand(noise=noise), step, eased)
        if solved is not None or programs.budget.over:
            return solved
    return None


def _approached(programs: StatePrograms, coordinates: Coordinates) -> Coordinates:
    """Return coordinates for a hard problem from easier ones, in which u has a higher price."""
    for price in POLICY.higher_prices:
        easier = compressed(with_price(programs.plant, price))
        unit = state_gain_norm(easier, lqr_gain(easier), programs.engine.norm)
        if not 0 < unit < math.inf or programs.budget.over:
            continue
        solved = replace(programs, plant=easier).solve(
            replace(coordinates, unit=unit),
            Demand(noise=POLICY.noise[0]),
            f"inequalities with a price of {price:.0e}",
        )
        if solved is not None:
            coordinates = solved.next
    return coordinates


def _settled(gain: StateGain, best: StateGain, engine: StateEngine) -> bool:
    """Whether a gain agrees with the best so far, and its claim with its achievement."""
    near = 0.1 * engine.slack
    if not abs(gain.achieved / best.achieved - 1) < near:
        return False
    # With noise the claim is for a larger norm.
    return engine.norm == "h2" or abs(gain.claimed / gain.achieved - 1) < near


def _smaller(programs: StatePrograms, found: _Rounds, estimate: float) -> StateGain:
    """Give the slack away for a smaller gain.

    The gain often grows without limit towards the optimum, until it is too large for its
    loop to be computed. A gain of small effort under twice the slack is joined to the best one by a
    line in (Y, M), along which the inequalities hold, and the last point of that line within the
    slack is taken. `estimate` is where the solver sees the optimum: at most the norm of the best.
    """
    best, slack = found.best.gain, programs.engine.slack
    for base in dict.fromkeys((estimate, best.achieved)):
        if programs.plant.nu == 0 or programs.budget.over:
            break
        end, limit = _least_effort(programs, found, base)
        if end is None:
            continue
        if slack > POLICY.coarse_slack and end.gain.achieved <= limit * (1 + slack):
            return replace(end.gain, claimed=max(limit, end.gain.achieved))
        smaller = _along_the_line(programs, found.best, end, base)
        if smaller is not best:
            return smaller
    return best


def _least_effort(
    programs: StatePrograms, found: _Rounds, base: float
) -> tuple[SolvedProgram | None, float]:
    slack, eased = programs.engine.slack, POLICY.eased_tolerance
    # Far from the optimum the gain itself can be minimised, near it only the effort.
    size = float(np.linalg.norm(found.best.gain.F, 2)) or None
    size = size if slack > POLICY.coarse_slack else None
    plain = found.coordinates.without_congruence()
    # The last resort is an inner point: the norm minimised with a loose tolerance.
    attempts = (
        (found.coordinates, 2, eased),
        (plain, 2, 10 * eased),
        (plain, 0, max(10 * slack, eased)),
    )
    limit = base
    for attempt, share, tolerance in attempts:
        limit = base * (1 + share * slack)
        demand = Demand(limit=limit, gain=size) if share else Demand()
        solved = programs.solve(attempt, demand, "smallest effort near the optimum", tolerance)
        if solved is not None and math.isfinite(solved.gain.achieved):
            return solved, limit
    return None, limit


def _along_the_line(
    programs: StatePrograms, best: SolvedProgram, end: SolvedProgram, base: float
) -> StateGain:
    """Return the last point within the slack; without one, the point of the smallest norm."""
    slack = programs.engine.slack
    claim = base * (1 + slack)
    # A norm below the optimum is a rounding error of a loop with too large a gain.
    floor = base * (1 - slack)
    chosen, low, high, share = best.gain, 0.0, 1.0, 1.0
    for _ in range(POLICY.halvings):
        Y = (1 - share) * best.Y + share * end.Y
        M = (1 - share) * best.gain.F @ best.Y + share * end.gain.F @ end.Y
        try:
            F: Matrix = np.linalg.solve(Y, M.T).T.astype(float)
        except linalg.LinAlgError:
            break
        achieved = programs.judged(F)
        if achieved < floor:
            achieved = math.inf
        if achieved <= claim:
            chosen, low = StateGain(F, claim, achieved), share
        else:
            high = share
            if achieved < chosen.achieved and chosen.achieved > claim:
                chosen = StateGain(F, achieved, achieved)
        share = (low + high) / 2
        if low == high:
            break
    return chosen
