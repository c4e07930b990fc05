"""Whether a diagnosis is right about a case, and which of its names are wrong."""

from collections import Counter
from typing import NamedTuple

NAMED = ("missing_effect", "partly_explained")
"""Verdicts with names; the second says that something else is missing, too."""
NO_LAW = ("unexplained", "partly_explained", "unknown_law")
"""What may be said where no force of the catalogue and no static law is the truth."""
LEARNED = "learned_"


class Marks(NamedTuple):
    """Which effects of a case were named.

    Attributes
    ----------
    exact : int
        Effects of the truth with the right kind and place.
    alike : int
        Those for which another stands that is told alike.
    missed : int
        Those that are not named.
    wrong : tuple of str
        Confident wrong names: neither in the truth nor told alike with something in it. A learned
        curve is no name.
    spare : int
        Named effects that are too many, but told alike with something in the truth.
    """

    exact: int
    alike: int
    missed: int
    wrong: tuple[str, ...]
    spare: int


def normal(kind, at):
    """A place without ground and order."""
    return kind, frozenset(at) - {"ground"}


def marks(case, diagnosis):
    """Return which effects of a case were named, pairs that are reported as alike counted."""
    want = Counter(normal(kind, at) for kind, at, _ in case.effects)
    names = [e for e in diagnosis.effects if not e.kind.startswith(LEARNED)]
    got = Counter(normal(e.kind, e.at) for e in names)
    missing, extra = want - got, got - want
    exact = (want & got).total()
    pairs = [
        (normal(p.first.kind, p.first.at), normal(p.second.kind, p.second.at))
        for p in diagnosis.indistinguishable
    ]
    pairs += [(second, first) for first, second in pairs]
    swapped = 0
    for a, b in pairs:
        if missing[a] > 0 and extra[b] > 0:
            missing[a], extra[b], swapped = missing[a] - 1, extra[b] - 1, swapped + 1
    spare = {b for a, b in pairs if want[a]}
    wrong = [
        f"{kind} at {', '.join(sorted(at))}"
        for (kind, at), count in extra.items()
        if count > 0 and (kind, at) not in spare
    ]
    count = sum(count for key, count in extra.items() if count > 0 and key in spare)
    missed = sum(count for count in missing.values() if count > 0)
    return Marks(exact, swapped, missed, tuple(wrong), count)


def judge(case, diagnosis):
    """Return whether verdict, kinds and places are right, pairs reported as alike counted."""
    found = marks(case, diagnosis)
    if case.verdict == "missing_effect":
        nothing_else = not (found.missed or found.wrong or found.spare or _laws(diagnosis))
        return diagnosis.verdict in NAMED and nothing_else
    if case.verdict == "unknown_law":
        places = {normal("", e.at) for e in _laws(diagnosis)}
        right = {normal("", at) for _, at, _ in case.effects}
        return diagnosis.verdict == "unknown_law" and places == right and not found.wrong
    if case.verdict == "unexplained":
        names = len(diagnosis.effects) - len(_laws(diagnosis))
        return diagnosis.verdict in NO_LAW and not names
    return diagnosis.verdict == case.verdict and not diagnosis.effects


def _laws(diagnosis):
    return [e for e in diagnosis.effects if e.kind.startswith(LEARNED)]
