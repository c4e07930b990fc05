"""H-infinity output feedback by Riccati equations on a ladder of regularised plants.

A regularised plant has a solution of its two Riccati equations whatever the rank of D12 and D21
and whatever zeros lie on the axis. Its norm bounds the true one from above, and
falls to it as epsilon goes to zero. So epsilon descends from 0.1 in half decades until the norms
of the true loops, which alone are believed, no longer improve.
"""

from __future__ import annotations

import numpy as np

from robustpolish.budget import Budget
from robustpolish.synthesis.output_search.candidates import Candidate, Findings, examine
from robustpolish.synthesis.problem.deadline import Deadline
from robustpolish.synthesis.problem.matrices import Matrix, PlantMatrices, regularise
from robustpolish.synthesis.riccati.infimum import GammaBracket, search_gamma
from robustpolish.synthesis.riccati.two_riccati import (
    NormalisedPlant,
    central_controller,
    normalise,
)

EPSILONS = tuple(10.0 ** (-k / 2) for k in range(2, 18))
_BACK_OFF = (1.003, 1.0005, 1.01, 1.03)
_SETTLED = 3e-4
_FALLING = 0.9
_LARGEST_GAIN = 1e10
_COSTLY = 24


def descend(plant: PlantMatrices, deadline: Deadline) -> Findings:
    """Minimise the H-infinity norm of the loop.

    A regular plant is solved as it is as well; the ladder then looks for smaller gains.

    Parameters
    ----------
    plant : PlantMatrices
        Scaled.
    deadline : Deadline

    Returns
    -------
    Findings
    """
    ladder = Findings("riccati", "scipy")
    regular = _solve_regular(plant, ladder, deadline)
    gamma, failures, quiet = 1.0, 0, 0
    costly = plant.A.shape[0] > _COSTLY
    waiting: tuple[NormalisedPlant, GammaBracket, float] | None = None
    for epsilon in EPSILONS:
        if deadline.expired or failures == 2:
            break
        normal = normalise(regularise(plant, epsilon))
        bracket = _search(normal, gamma, ladder, deadline)
        if bracket is None:
            failures += 1
            continue
        drop = 1 - bracket.upper / gamma if len(ladder.history) > regular else 1.0
        gamma, before = bracket.upper, ladder.best
        note = {"epsilon": epsilon, "gamma": gamma, "achieved": np.nan, "gain": np.nan}
        ladder.history.append(note)
        waiting = (normal, bracket, epsilon)
        # Where a norm is costly, loops are not checked while gamma falls fast.
        if costly and drop > 0.03:
            continue
        waiting = None
        found = _confirm(plant, normal, bracket, epsilon, deadline)
        if found is None:
            failures += 1
            continue
        failures = 0
        _add(ladder, found, note)
        if found.achieved == 0 or (regular and _reaches(found.achieved, before)):
            ladder.converged = True
        if found.gain > _LARGEST_GAIN or ladder.converged:
            break
        if found.achieved > before * 1.1:
            continue
        quiet = quiet + 1 if found.achieved > before * (1 - _SETTLED) else 0
        if quiet >= 6 or (quiet >= 2 and not deeper_helps(plant, gamma)):
            ladder.converged = True
            break
    if waiting is not None:
        found = _confirm(plant, *waiting, deadline)
        if found is not None:
            ladder.candidates.append(found)
    # Where the plant itself was solved, and the ladder found nothing better, that is the optimum.
    confirmed = regular and ladder.best >= ladder.candidates[0].achieved * (1 - _SETTLED)
    ladder.converged = ladder.converged or quiet >= 3 or confirmed
    ladder.expired = deadline.expired and not ladder.converged
    ladder.falling = not ladder.converged and _is_falling(ladder)
    _refine(plant, ladder, deadline)
    return ladder


def _add(ladder: Findings, found: Candidate, note: dict[str, float]) -> None:
    ladder.candidates.append(found)
    note["achieved"], note["gain"] = found.achieved, found.gain


def _reaches(achieved: float, optimum: float) -> bool:
    """Tell whether a regularised plant has come to the optimum of the plant itself."""
    return optimum * (1 - _SETTLED) <= achieved <= optimum * 1.001


def _solve_regular(plant: PlantMatrices, ladder: Findings, deadline: Deadline) -> bool:
    """Solve a plant as it is, if D12 and D21 have full rank; tell whether that worked."""
    if not (_full_rank(plant.D12) and _full_rank(plant.D21.T)):
        return False
    normal = normalise(plant)
    bracket = search_gamma(normal.halves, 1.0, _SETTLED, Budget(seconds=deadline.remaining))
    found = None if bracket is None else _confirm(plant, normal, bracket, 0.0, deadline)
    if bracket is None or found is None:
        return False
    note = {"epsilon": 0.0, "gamma": bracket.upper}
    ladder.history.append(note)
    _add(ladder, found, note)
    return True


def _full_rank(D: Matrix) -> bool:
    """Tell whether the columns are independent, whatever their sizes."""
    size = np.linalg.norm(D, axis=0)
    if D.shape[0] < D.shape[1] or not size.all():
        return False
    return bool(np.linalg.svd(D / size, compute_uv=False)[-1] > 1e-8)


def _search(
    normal: NormalisedPlant, gamma: float, ladder: Findings, deadline: Deadline
) -> GammaBracket | None:
    """Find the optimal gamma of one rung: coarsely while it falls fast, then finely."""
    first = gamma == 1.0
    shortcut = 0.0 if first else _SETTLED
    rough = search_gamma(normal.halves, gamma, 0.02, Budget(seconds=deadline.remaining), shortcut)
    if rough is None or rough.upper < 0.9 * gamma or first:
        return rough
    return search_gamma(
        normal.halves, rough.upper, _SETTLED, Budget(seconds=deadline.remaining), known=rough
    )


def _confirm(
    plant: PlantMatrices,
    normal: NormalisedPlant,
    bracket: GammaBracket,
    epsilon: float,
    deadline: Deadline,
) -> Candidate | None:
    """Make a controller a little above the optimal gamma that keeps its promise."""
    for factor in _BACK_OFF:
        found = _controller(plant, normal, bracket.upper * factor, epsilon)
        if found is not None and found.honest:
            return found
        if deadline.expired:
            return None
    return None


def _controller(
    plant: PlantMatrices, normal: NormalisedPlant, gamma: float, epsilon: float
) -> Candidate | None:
    solution = normal.halves.attempt(gamma)
    if solution.X is None or solution.Y is None or not solution.feasible:
        return None
    try:
        K = central_controller(normal, gamma, solution.X, solution.Y)
    except np.linalg.LinAlgError:
        return None
    return examine(plant, K, gamma, f"riccati, epsilon {epsilon:.1e}")


def _is_falling(ladder: Findings) -> bool:
    """Tell whether the last two decades of epsilon have lowered the norm for certain."""
    notes = [note for note in ladder.history if np.isfinite(note["achieved"])]
    if any(note["epsilon"] == 0 for note in notes):
        return False
    norms = [note["achieved"] for note in notes]
    return len(norms) > 4 and min(norms) < _FALLING * min(norms[:-4])


def deeper_helps(plant: PlantMatrices, gamma: float) -> bool:
    """Look far down the ladder, lest a plateau be taken for the bottom."""
    return any(
        normalise(regularise(plant, epsilon)).halves.attempt(0.97 * gamma).feasible
        for epsilon in (1e-6, 1e-8)
    )


def _refine(plant: PlantMatrices, ladder: Findings, deadline: Deadline) -> None:
    """Try other distances from the optimal gamma on the rungs that came close to the best norm."""
    best = ladder.best
    costly = plant.A.shape[0] > _COSTLY
    limit = deadline.share(0.3 if costly else 0.5)
    close = [note for note in ladder.history if note["achieved"] <= best * 1.02]
    # The gain grows down the ladder, so the first rungs are worth the most.
    for note in close[: 2 if costly else None]:
        normal = normalise(regularise(plant, note["epsilon"]))
        for factor in (1.001, 1.006) if costly else (1.0005, 1.001, 1.006):
            if limit.expired:
                return
            found = _controller(plant, normal, note["gamma"] * factor, note["epsilon"])
            if found is not None and found.honest:
                ladder.candidates.append(found)
