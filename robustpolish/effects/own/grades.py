"""What a formula is made of, counted: units, or how it grows with some of its names.

A grade is a product of powers. Sums need one grade on both sides, products add them, sines need
none: the rules of units. The same rules tell whether a force grows in proportion with a group of
parameters, if these have the grade 1 and all others none.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from robustpolish.effects.own.formula import Formula

Powers = dict[str, float]


@dataclass(frozen=True)
class Grade:
    """A product of powers.

    Parameters
    ----------
    powers : dict of str to float, or None
        None for what fits everything, such as zero.
    loose : bool, optional
        Whether a number in it may have a unit that nobody wrote.
    number : float, optional
        Its value, of a number.
    """

    powers: Powers | None
    loose: bool = False
    number: float | None = None


def multiplied(powers: Powers, others: Mapping[str, float], exponent: float = 1.0) -> Powers:
    """Return powers times others to an exponent.

    Examples
    --------
    >>> multiplied({"N": 1.0, "m": 1.0}, {"m": 1.0}, -1.0)
    {'N': 1.0}
    """
    result = dict(powers)
    for name, power in others.items():
        result[name] = round(result.get(name, 0.0) + exponent * power, 9)
    return {name: power for name, power in result.items() if power}


def graded(
    formula: Formula,
    grades: Mapping[str, Grade],
    loose_numbers: bool = False,
    shown: Callable[[Powers], str] = str,
) -> Grade:
    """Return the grade of a formula.

    Parameters
    ----------
    formula : Formula
    grades : mapping of str to Grade
        Of every name in it.
    loose_numbers : bool, optional
        Whether a number may have a unit: ``tanh(v/0.01)`` means 0.01 m/s.
    shown : callable, optional
        How powers are written in a message.

    Returns
    -------
    Grade

    Raises
    ------
    ArithmeticError
        If the grades do not fit together.
    """

    def leaf(item: float | str) -> Grade:
        if isinstance(item, str):
            return grades[item]
        return Grade({} if item else None, loose_numbers and item != 0, item)

    def combine(operation: str, *operands: Grade) -> Grade:
        if operation in ("+", "-", "min", "max"):
            return _alike(operation, operands[0], operands[1], shown)
        if operation in ("*", "/"):
            return _product(operands[0], operands[1], 1.0 if operation == "*" else -1.0)
        if operation == "**":
            return _power(operands[0], operands[1], shown)
        (one,) = operands
        if operation in ("negative", "abs"):
            return Grade(one.powers, one.loose)
        if operation == "sign":
            return Grade({})
        if operation == "sqrt":
            return Grade(one.powers and multiplied({}, one.powers, 0.5), one.loose)
        if one.powers and not one.loose:
            raise ArithmeticError(f"{operation} is taken of something in {shown(one.powers)}")
        return Grade({})

    return formula.fold(leaf, combine)


def _alike(operation: str, one: Grade, other: Grade, shown: Callable[[Powers], str]) -> Grade:
    if one.powers is None:
        return Grade(other.powers, other.loose or one.loose)
    if other.powers is None:
        return Grade(one.powers, one.loose or other.loose)
    if one.powers == other.powers:
        return Grade(one.powers, one.loose and other.loose)
    if one.loose and other.loose:
        return Grade(None, True)
    if one.loose or other.loose:  # what is known tells the unit of the number
        return Grade(other.powers if one.loose else one.powers)
    pair = f"{shown(one.powers)} and {shown(other.powers)}"
    raise ArithmeticError(f"{operation} joins {pair}")


def _product(one: Grade, other: Grade, exponent: float) -> Grade:
    loose = one.loose or other.loose
    if one.powers is None or other.powers is None:
        return Grade(None, loose)
    return Grade(multiplied(one.powers, other.powers, exponent), loose)


def _power(base: Grade, exponent: Grade, shown: Callable[[Powers], str]) -> Grade:
    if exponent.powers and not exponent.loose:
        raise ArithmeticError(f"an exponent is in {shown(exponent.powers)}")
    if base.powers is None or not base.powers:
        return Grade(base.powers, base.loose)
    if exponent.number is None:  # how large is the exponent?
        return Grade(None, True)
    return Grade(multiplied({}, base.powers, exponent.number), base.loose)


def grows_with(formula: Formula, names: Collection[str]) -> bool:
    """Return whether the force is multiplied by what all of these names are multiplied by.

    Parameters
    ----------
    formula : Formula
    names : collection of str

    Returns
    -------
    bool

    Examples
    --------
    >>> from robustpolish.effects.own.reading import read_formula
    >>> grows_with(read_formula("f = -F*tanh(k*q/F)", ["F", "k"]), ["F", "k"])
    True
    """
    grades = {name: Grade({"size": 1.0} if name in names else {}) for name in formula.names}
    try:
        whole = graded(formula, grades)
    except ArithmeticError:
        return False
    return whole.powers == {"size": 1.0}


def linear_in(formula: Formula, names: Collection[str]) -> bool:
    """Return whether the force is a sum of terms that each have one of these names as a factor.

    Parameters
    ----------
    formula : Formula
    names : collection of str

    Returns
    -------
    bool

    Examples
    --------
    >>> from robustpolish.effects.own.reading import read_formula
    >>> linear_in(read_formula("f = -k*q - c*v", ["k", "c"]), ["k", "c"])
    True
    """
    bent = -1  # of no degree

    def combine(operation: str, *degrees: int) -> int:
        if bent in degrees:
            return bent
        if operation == "negative":
            return degrees[0]
        if operation in ("+", "-"):
            return degrees[0] if degrees[0] == degrees[1] else bent
        if operation == "*":
            return sum(degrees) if sum(degrees) <= 1 else bent
        if operation == "/" and degrees[1] == 0:
            return degrees[0]
        return bent if any(degrees) else 0

    return formula.fold(lambda item: int(item in names), combine) == 1
