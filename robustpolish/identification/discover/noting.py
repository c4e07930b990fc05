"""Write down what was tried, and what the data cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robustpolish.identification.discover.confusion import experiment
from robustpolish.identification.discover.diagnosis import Confusion, RankedCandidate
from robustpolish.identification.discover.judge import Refitted, judgement, tolerance
from robustpolish.identification.discover.screening import Candidate
from robustpolish.identification.discover.search import Search


def note_confusions(
    search: Search,
    winner: Refitted,
    ranked: Sequence[Refitted],
) -> None:
    """Note the candidates that do as well as the winner."""
    rivals = list(ranked)
    here = judgement(winner[1], rivals)
    for candidate, stage in ranked:
        if candidate is winner[0]:
            continue
        if judgement(stage, rivals) - here < tolerance(search.setting):
            pair = (winner[0].effect, candidate.effect)
            search.confusions.append(Confusion(*pair, experiment(*pair)))


def remember(
    search: Search,
    ranked: Sequence[Refitted],
    screened: Sequence[Candidate],
    number: int,
) -> None:
    """Add what was refitted, then what was only screened, to the list of candidates.

    Parameters
    ----------
    search : Search
    ranked : sequence
        Candidates with their fits, the best first.
    screened : sequence of Candidate
    number : int
        1 when the first effect is sought, and so on.
    """
    size = np.std(search.setting.record.Y, axis=0)
    done = set()
    for candidate, stage in ranked:
        effect = stage.model.effects[-1]
        done.add((effect.kind, effect.at))
        search.candidates.append(
            RankedCandidate(
                effect.kind, effect.at, float(np.mean(stage.error / size)), candidate.score,
                number, effect.values,
            )
        )  # fmt: skip
    for candidate in screened:
        here = (candidate.effect.kind, candidate.effect.at)
        if here not in done and candidate.score > 0:
            search.candidates.append(
                RankedCandidate(
                    candidate.effect.kind, candidate.effect.at, np.inf, candidate.score, number,
                    candidate.effect.values, candidate.remark or "screened only",
                )
            )  # fmt: skip
