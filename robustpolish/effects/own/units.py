"""Units of parameters as text, and what a formula makes of them.

A unit is read in two ways: for translation, and for rotation, where ``N m`` is a torque and
``rad`` a displacement. The way in which the formula gives a force (or a torque) is the one that
was meant.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from robustpolish.effects.own.formula import Formula
from robustpolish.effects.own.grades import Grade, Powers, graded, multiplied
from robustpolish.errors import InvalidInputError
from robustpolish.validation import Key, described, invalid

_KNOWN = ("N", "m", "s", "kg", "rad", "Hz")
_TOKEN = re.compile(r"\s*(?:([A-Za-zµμΩ°%]+)|(\^|\*\*)\s*(-?\d+(?:\.\d+)?)|([*·/()])|(1))\s*")
_LONGEST = 80
_WORD = r"[A-Za-zµμΩ°%]{1,20}"
_TAKEN = ("F", "L", "T", "M", "signal")  # letters of `Parameter.dimension`

_TRANSLATION: Mapping[str, Powers] = {
    "N": {"F": 1.0},
    "m": {"L": 1.0},
    "s": {"T": 1.0},
    "kg": {"M": 1.0},
    "rad": {},
    "Hz": {"T": -1.0},
}
# A torque is a force times a length that is none of the machine's angles.
_ROTATION: Mapping[str, Powers] = {
    "N": {"F": 1.0, "metre": -1.0},
    "m": {"metre": 1.0},
    "s": {"T": 1.0},
    "kg": {"M": 1.0, "metre": -2.0},
    "rad": {"L": 1.0},
    "Hz": {"T": -1.0},
}
_MOTION: Mapping[str, Powers] = {"q": {"L": 1.0}, "v": {"L": 1.0, "T": -1.0}, "t": {"T": 1.0}}
_FORCE: Powers = {"F": 1.0}


def read_unit(text: Any, key: Key, others: Iterable[str] = ()) -> Powers:
    """Read an SI unit such as ``"N s/m"``.

    Parameters
    ----------
    text : str
        Units of ``N m s kg rad Hz``, ``1`` for none, with powers ``^2``, products by blanks or
        ``*``, ``/`` and brackets.
    key : tuple of str
        Where it stands, for the message.
    others : iterable of str, optional
        Further units that are known, such as the ``"V"`` of a channel.

    Returns
    -------
    dict of str to float
        The power of each unit.

    Raises
    ------
    InvalidInputError
        If it is no such unit.

    Examples
    --------
    >>> read_unit("N s/m", ("units", "c"))
    {'N': 1.0, 's': 1.0, 'm': -1.0}
    >>> read_unit("N/(m/s)^2", ("units", "c"))
    {'N': 1.0, 'm': -2.0, 's': 2.0}
    """
    known = (*_KNOWN, *others)
    expected = f"an SI unit of {' '.join(dict.fromkeys(known))}, such as 'N/m^5', or '1'"
    remedy = "Write it without prefixes (m, not mm): values are in SI units."
    bad = invalid(key, text, expected, remedy)
    if not isinstance(text, str) or not text.strip() or len(text) > _LONGEST:
        raise bad
    tokens, at = [], 0
    while at < len(text):
        found = _TOKEN.match(text, at)
        if found is None:
            raise bad
        tokens.append(found.groups())
        at = found.end()
    powers = _product(tokens, known, bad, 0)
    if tokens:
        raise bad
    return powers


def _product(tokens: list[Any], known: Iterable[str], bad: InvalidInputError, depth: int) -> Powers:
    """Take a product off the front of the tokens."""
    result, sign, divided = _factor(tokens, known, bad, depth), 0.0, False
    while tokens and tokens[0][3] != ")":
        mark = tokens[0][3]
        if mark in ("*", "·", "/"):
            tokens.pop(0)
        sign = -1.0 if mark == "/" else 1.0
        if divided and sign > 0:  # N/m s: who knows what is meant
            raise bad
        divided = divided or sign < 0
        result = multiplied(result, _factor(tokens, known, bad, depth), sign)
    return result


def _factor(tokens: list[Any], known: Iterable[str], bad: InvalidInputError, depth: int) -> Powers:
    if not tokens or depth > 5:
        raise bad
    word, _, _, mark, one = tokens.pop(0)
    if word in known:
        powers: Powers = {word: 1.0}
    elif one:
        powers = {}
    elif mark == "(":
        powers = _product(tokens, known, bad, depth + 1)
        if not tokens or tokens.pop(0)[3] != ")":
            raise bad
    else:
        raise bad
    if tokens and tokens[0][1]:
        exponent = float(tokens.pop(0)[2])
        powers = multiplied({}, powers, exponent)
    return powers


def channel_unit(text: Any, key: Key) -> str:
    """Return the unit of a channel: an SI unit, or any other word, such as ``"V"``."""
    word = isinstance(text, str) and re.fullmatch(_WORD, text)
    if word and text not in _TAKEN:
        return text
    if text in _TAKEN:
        raise invalid(key, text, "another word", "Write it in full, such as tesla.")
    read_unit(text, key)
    return text


def dimensions(
    formula: Formula, units: Mapping[str, str], channels: Mapping[str, str]
) -> dict[str, Powers]:
    """Return the dimension of each parameter, as the formula needs it.

    Parameters
    ----------
    formula : Formula
    units, channels : mapping of str to str
        Units of the parameters and of the channels.

    Returns
    -------
    dict of str to dict
        Powers of F, L, T, M and of units of channels.

    Raises
    ------
    InvalidInputError
        If a unit is none, or the formula does not make a force of them.
    """
    words = {name: channel_unit(text, ("channels", name)) for name, text in channels.items()}
    others = [text for text in words.values() if re.fullmatch(_WORD, text)]
    read = {name: read_unit(text, ("units", name), others) for name, text in units.items()}
    signals = {name: read_unit(text, ("channels", name), others) for name, text in words.items()}
    best, why = None, ""
    for table in (_TRANSLATION, _ROTATION):
        found = {name: _in_letters(powers, table) for name, powers in read.items()}
        outside = {name: _in_letters(powers, table) for name, powers in signals.items()}
        try:
            loose = _loose(formula, {**found, **outside}, table is _ROTATION)
        except ArithmeticError as error:
            rotational = any("rad" in powers for powers in read.values())
            why = str(error) if not why or rotational else why
            continue
        # what is no unit of a rotation, such as the length of a pendulum, stays as it is
        found = {n: read[n] if "metre" in powers else powers for n, powers in found.items()}
        if not loose:
            return found
        best = best or found
    if best is not None:
        return best
    raise invalid(
        "formula",
        described(f"{formula.text!r}, where {why}"),
        "a force in N, or a torque in N m",
        "Check the units of the parameters, and brackets.",
    )


def _in_letters(powers: Powers, table: Mapping[str, Powers]) -> Powers:
    result: Powers = {}
    for unit, power in powers.items():
        result = multiplied(result, table.get(unit, {unit: 1.0}), power)
    return result


def _loose(formula: Formula, names: Mapping[str, Powers], rotation: bool) -> bool:
    """Return whether the formula is a force only if its numbers have units.

    Raises
    ------
    ArithmeticError
        If it is none. Its text says why.
    """
    grades = {}
    for name, powers in {**_MOTION, **names}.items():
        counted = _without_mass(powers)
        if rotation:  # an angle is a number, of which a sine may be taken
            counted.pop("L", None)
        grades[name] = Grade(counted)

    def shown(powers: Powers) -> str:
        metres = {"L": powers.get("F", 0.0) + powers.get("metre", 0.0)} if rotation else {}
        rest = {name: power for name, power in powers.items() if name != "metre"}
        return unit_text(multiplied(rest, metres))

    whole = graded(formula, grades, loose_numbers=True, shown=shown)
    if whole.powers is None:
        return True
    if whole.powers != _FORCE and not whole.loose:
        raise ArithmeticError(f"f comes out in {shown(whole.powers)}")
    return whole.loose and whole.powers != _FORCE


def _without_mass(powers: Powers) -> Powers:
    """Return powers of force, length and time: a mass is a force by an acceleration."""
    mass = powers.get("M", 0.0)
    rest = {letter: power for letter, power in powers.items() if letter != "M"}
    return multiplied(rest, {"F": 1.0, "T": 2.0, "L": -1.0}, mass)


def unit_text(powers: Powers) -> str:
    """Return powers of F, L, T and M as the unit of a translation."""
    letters = {"F": "N", "L": "m", "T": "s", "M": "kg"}
    return _joined({letters.get(name, name): power for name, power in powers.items()}, " ")


def dimension_text(powers: Powers) -> str:
    """Return powers as `Parameter.dimension` has them.

    Examples
    --------
    >>> dimension_text({"F": 1.0, "L": -5.0})
    'F/L^5'
    """
    return _joined(powers, "*")


def _joined(powers: Powers, times: str) -> str:
    parts = {name: f"{name}^{abs(p):g}" if abs(p) != 1 else name for name, p in powers.items()}
    over = times.join(parts[name] for name, power in powers.items() if power > 0)
    under = [f"/{parts[name]}" for name, power in powers.items() if power < 0]
    return "".join([over or "1", *under])
