"""Which candidates deserve a refit."""

from __future__ import annotations

from robustpolish.effects import CONSTANT
from robustpolish.identification.discover.screening import Candidate, Screening

LEAST_ODDS = 12.0
VISIBLE_FALL = 0.2
MOST_REFITS = 5
MOST_LARGE = 3
MOST_FURTHER = 4


def hopeful(screening: Screening) -> tuple[list[Candidate], list[Candidate]]:
    """Return the candidates that deserve a refit, and further ones if none of them earns its place.

    The former are the likeliest, and the largest if others.
    """
    good = [c for c in screening.candidates if c.sensible and c.score > LEAST_ODDS]
    chosen = [c for c in good if c.score > 0.25 * good[0].score][:MOST_REFITS]
    taken = {(c.effect.kind, c.effect.at) for c in chosen}
    for candidate in screening.large[:MOST_LARGE]:
        here = (candidate.effect.kind, candidate.effect.at)
        if here in taken:
            if candidate.effect.definition.family == CONSTANT:
                continue
            break  # what takes away most is there
        if candidate.sensible and candidate.fall > VISIBLE_FALL:
            chosen.append(candidate)
    taken = {(c.effect.kind, c.effect.at) for c in chosen}
    further = [c for c in good if (c.effect.kind, c.effect.at) not in taken]
    return chosen, further[:MOST_FURTHER]
