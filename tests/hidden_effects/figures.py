"""What rows say as a whole: shares that the page tells and the tests hold."""

from dataclasses import dataclass

import numpy as np

from .intervals import Stated

NEAR_FLOOR = 1.5
"""Factor within which a stated noise is as good as right."""
NEAR_NOISE = 1.3
"""Error on an unseen record over the noise up to which a model is as good as right."""
LAW_ERROR, LAW_SHARE = 1.5, 0.9
"""The same for a learned law, and the least share of the range in which its band has the truth."""


@dataclass(frozen=True)
class Share:
    """So many of so many."""

    count: int
    of: int

    @property
    def value(self):
        """The share, NaN of nothing."""
        return self.count / self.of if self.of else float("nan")

    def __str__(self):
        percent = f" ({100 * self.value:.1f} %)" if self.of else ""
        return f"{self.count} of {self.of}{percent}"


def share(answers):
    """Return how many of some answers are yes."""
    answers = list(answers)
    return Share(int(sum(map(bool, answers))), len(answers))


@dataclass(frozen=True)
class Figures:
    """Shares of the cases with several effects.

    Attributes
    ----------
    right : Share
        Cases that are right in kind and place, or told alike.
    confident : Share
        Cases with a name that is wrong and not told alike with one that is right.
    quiet : Share
        Cases without an effect in which none is named.
    covered, covered_all : Share
        95 % intervals of effects' numbers that hold the truth: in cases that are right with every
        name, and of all effects that are named right.
    cases_covered : Share
        Cases that are right with every name all of whose intervals hold it.
    own_covered : Share
        Intervals of masses, springs and dampers that hold it, in those cases.
    floors, cases_floors : Share
        Stated noise within a factor of the true one, by sensor and by case.
    calm : Share
        Errors on the unseen record near the noise, of those cases that are right and whose motion
        can be foreseen.
    """

    right: Share
    confident: Share
    quiet: Share
    covered: Share
    covered_all: Share
    cases_covered: Share
    own_covered: Share
    floors: Share
    cases_floors: Share
    calm: Share


def figures(rows):
    """Return the shares of some rows with their cases."""
    exact = [row for row, _ in rows if row["right"] and not row["swapped"]]
    near = [[near_floor(r) for r in row["floors"].values()] for row, _ in rows]
    return Figures(
        right=share(row["right"] for row, _ in rows),
        confident=share(row["wrong"] for row, _ in rows),
        quiet=share(
            row["named"] == 0 and row["verdict"] != "error" for row, c in rows if not c.effects
        ),
        covered=share(s.covered for row in exact for s in stated(row["numbers"])),
        covered_all=share(s.covered for row, _ in rows for s in stated(row["numbers"])),
        cases_covered=share(
            all(s.covered for s in stated(row["numbers"])) for row in exact if row["numbers"]
        ),
        own_covered=share(s.covered for row in exact for s in stated(row["own"])),
        floors=share(answer for answers in near for answer in answers),
        cases_floors=share(bool(answers) and all(answers) for answers in near),
        calm=share(
            row["ratio"] <= NEAR_NOISE
            for row, case in rows
            if case.effects and row["right"] and not case.chaotic
        ),
    )


def near_floor(ratio):
    """Return whether a stated noise over the true one is near 1."""
    return bool(1 / NEAR_FLOOR <= ratio <= NEAR_FLOOR)


def stated(numbers):
    """Return the numbers of a row with what they say."""
    return [Stated(*number) for number in numbers]


def by_number(rows):
    """Return how many intervals of each number of the effects there are and hold the truth.

    The third is the median of the errors in standard errors, 0.67 if these are right.
    """
    found = {}
    for row, _ in rows:
        for s in stated(row["numbers"]):
            found.setdefault(s.name, []).append(s)
    return {
        name: (share(s.covered for s in all_of), _sigmas(all_of))
        for name, all_of in sorted(found.items())
    }


def _sigmas(numbers):
    return float(np.median([abs(s.value - s.truth) / s.stderr for s in numbers]))


def law_learned(row):
    """Return whether a row's law is right: its place, its error on unseen data, and its curve."""
    return row["right"] and row["ratio"] <= LAW_ERROR and curves_held(row)


def curves_held(row):
    """Return whether the bands of a row's curves have the true ones over most of their range."""
    return bool(row["curves"]) and min(row["curves"]) >= LAW_SHARE
