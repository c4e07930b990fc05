"""What a screening tries of a formula: which parameters are solved for, and which are scanned.

- A force that is a sum of terms with one parameter each as a factor is linear in these: their
  sizes follow from the data at once.
- Any other parameter is scanned: over the values that were given, or over shares of the amplitude
  and the speed of the motion, from which its unit can be made.
- Where a force enters nonlinearly, as in ``-F*tanh(k*q/F)``, the whole law still grows with all
  its forces together. One of them is solved for, the others are scanned in proportion to it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from robustpolish.effects.kind import Parameter
from robustpolish.effects.own.formula import Formula
from robustpolish.effects.own.grades import grows_with, linear_in
from robustpolish.effects.shapes import Scan
from robustpolish.validation import described, invalid

_SHARES = (0.03, 0.1, 0.3, 0.8)
"""Of the amplitude or speed: thresholds and widths far below it do not show in the force."""
_OVER = (0.3, 1.25, 3.0, 10.0)
"""The same of what is divided by amplitude or speed: slopes over a force, for a knee at 1/10."""
_MOST = 200
"""Combinations of scanned values; each is filtered at each place."""


@dataclass(frozen=True)
class Candidates:
    """How a screening finds first values.

    Parameters
    ----------
    linear_in : tuple of str
        Parameters that are solved for.
    scan : tuple of Scan
        Values of the others.
    together : tuple of str
        Parameters that grow together and are therefore positive.
    missing : str
        Why nothing can be tried, or "".
    remedy : str
        What to do about it.
    unknown : tuple of str
        Parameters of which values have to be given.
    """

    linear_in: tuple[str, ...] = ()
    scan: tuple[Scan, ...] = ()
    together: tuple[str, ...] = ()
    missing: str = ""
    remedy: str = ""
    unknown: tuple[str, ...] = ()


def candidates(
    formula: Formula, parameters: Sequence[Parameter], given: Mapping[str, Sequence[float]]
) -> Candidates:
    """Return what a screening tries of a formula.

    Parameters
    ----------
    formula : Formula
    parameters : sequence of Parameter
    given : mapping of str to sequence of float
        Values to try, by parameter, in SI units.

    Returns
    -------
    Candidates

    Raises
    ------
    InvalidInputError
        If there are too many values.
    """
    if not parameters:
        return Candidates()
    by_name = {p.name: p for p in parameters}
    powers = {p.name: p.powers["F"] + p.powers["M"] for p in parameters}
    forces = [name for name in powers if powers[name] == 1]
    free = [name for name in (*forces, *powers) if name not in given]
    solved, together = _linear(formula, list(dict.fromkeys(free))), []
    bent = [name for name in powers if powers[name] and name not in solved]
    if bent:
        together = forces
        if any(powers[name] != 1 for name in bent) or not grows_with(formula, forces):
            why = f"{formula.text!r}, which is not proportional to {', '.join(bent)}"
            return Candidates(missing=why, remedy="Give it factors that it is proportional to.")
        half_given = [name for name in forces if name in given]
        solved = [] if len(half_given) == len(forces) else forces[:1]
        if half_given and solved:
            remedy = f"They grow together: give values of {', '.join(forces)}, or of none."
            return Candidates(missing=f"values of {', '.join(half_given)} alone", remedy=remedy)
    elif not solved:
        why = f"{formula.text!r}, which is proportional to no parameter"
        return Candidates(missing=why, remedy="Give it a factor in front.")
    scan, unknown = [], []
    for name in (name for name in powers if name not in solved):
        unit = by_name[solved[0]] if solved and name in together else None
        size = _size(by_name[name], unit)
        if name in given:
            scan.append(Scan(name, "1", tuple(given[name])))
        elif size is not None:
            scan.append(Scan(name, size, _SHARES if sum(size) > 0 else _OVER))
        else:
            unknown.append(name)
    if unknown:
        example = ", ".join(f"{name!r}: (0.5, 1.0, 2.0)" for name in unknown)
        return Candidates(
            missing=f"{formula.text!r}, which is not proportional to {', '.join(unknown)}, "
            "and the motion gives no size for it",
            remedy=f"Say which values to try: scan={{{example}}}.",
            unknown=tuple(unknown),
        )
    combinations = math.prod(len(s.shares) for s in scan)
    if combinations > _MOST:
        shown = described(f"{combinations} combinations of {', '.join(s.parameter for s in scan)}")
        raise invalid("scan", shown, f"at most {_MOST}", "Give fewer values of each.")
    return Candidates(tuple(solved), tuple(scan), tuple(together))


def _linear(formula: Formula, names: Sequence[str]) -> list[str]:
    """Return the most parameters that the force is linear in together, the first ones first."""
    for count in range(len(names), 0, -1):
        for chosen in itertools.combinations(names, count):
            if linear_in(formula, chosen):
                return list(chosen)
    return []


def _size(parameter: Parameter, of: Parameter | None) -> tuple[float, float] | None:
    """Return powers of amplitude and speed that have the unit of a parameter (over another's)."""
    powers = dict(parameter.powers)
    if of is not None:
        powers = {letter: power - of.powers[letter] for letter, power in powers.items()}
        # a mass is a force over an acceleration
    length = powers["L"] - powers["M"]
    time = powers["T"] + 2 * powers["M"]
    foreign = set(_letters(parameter)) ^ set(_letters(of) if of else ())
    if powers["F"] + powers["M"] or foreign or not (length or time):
        return None
    return length + time, -time


def _letters(parameter: Parameter) -> list[str]:
    """Return the units of channels in a dimension."""
    words = parameter.dimension.replace("*", " ").replace("/", " ").split()
    found = [word.split("^")[0] for word in words]
    return [word for word in found if word not in ("F", "L", "T", "M", "1")]
