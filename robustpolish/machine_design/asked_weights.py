"""Weights as files and users write them: numbers, gains with a crossover, polynomials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import control

from robustpolish.models import weight
from robustpolish.models.plant.given_system import as_state_space
from robustpolish.validation import Key, described, inside, invalid, known_keys, positive

SENSITIVITIES = ("performance", "effort", "robustness")
"""What mixed sensitivity weights; anything else in a table of weights is a signal's name."""

_GAINS = ("low", "crossover_hz", "high", "order", "inverse", "gain")
_POLYNOMIALS = ("numerator", "denominator")


def asked_weight(where: Key, given: Any) -> control.StateSpace | float:
    """Return the weight that somebody wrote down.

    Parameters
    ----------
    where : tuple of str
        Where it stands, for messages.
    given : float, mapping or system
        A number; ``{low, crossover_hz, high, order, inverse}`` as :func:`robustpolish.weight`
        takes them, times ``gain`` if that is given; ``{numerator, denominator}`` in powers of s,
        the highest first; or a system.

    Returns
    -------
    control.StateSpace or float

    Raises
    ------
    InvalidInputError
        If it is none of these, or no proper system.

    Examples
    --------
    >>> asked_weight(("effort",), {"numerator": [1.0, 0.0], "denominator": [1.0, 5.0]}).nstates
    1
    """
    if isinstance(given, control.LTI):
        return as_state_space(_text(where), given)
    if not isinstance(given, Mapping):
        if isinstance(given, bool | str | Sequence) or given is None:
            want = "a number or a table with low, crossover_hz and high"
            raise invalid(where, given, want, "Write { low = 100, crossover_hz = 5, high = 0.5 }.")
        return positive(where, given)
    if set(given) & set(_POLYNOMIALS):
        known_keys(where, given, _POLYNOMIALS, _POLYNOMIALS)
        numerator, denominator = (_numbers((*where, key), given[key]) for key in _POLYNOMIALS)
        return as_state_space(_text(where), control.tf(numerator, denominator))
    known_keys(where, given, _GAINS, _GAINS[:3])
    gain = positive((*where, "gain"), given.get("gain", 1.0))
    with inside(where):
        shape = weight(**{key: value for key, value in given.items() if key != "gain"})
    return shape if gain == 1 else as_state_space(_text(where), gain * shape)


def is_weight(given: Any) -> bool:
    """Tell whether a table is one weight, and not a table of weights by the names of signals."""
    if not isinstance(given, Mapping):
        return True
    if any(isinstance(value, Mapping) for value in given.values()):
        return False
    return bool({*_GAINS, *_POLYNOMIALS} & set(given))


def _numbers(where: Key, given: Any) -> list[float]:
    want = "a list of numbers, the highest power first"
    right = isinstance(given, list | tuple) and bool(given)
    if not right or any(isinstance(n, bool) or not isinstance(n, int | float) for n in given):
        raise invalid(where, given, want, "Write [1.0, 2.0] for s + 2.")
    numbers = [float(n) for n in given]
    if where[-1] == "denominator" and not any(numbers):
        raise invalid(where, described("a denominator of zeros"), want, "Correct it.")
    return numbers


def _text(where: Key) -> str:
    return ".".join(map(str, where))
