"""Factors that a confusion of units makes, and what they are called."""

from __future__ import annotations

import math

from robustpolish.identification.sanity.limits import LIMITS

_AMPLITUDES = (
    (1e3, True, "as a length in mm read as m is, or a force in kN read as N"),
    (1e-3, True, "as a length in m read as mm is, or a force in N read as kN"),
    (1e6, True, "as a length in um read as m is"),
    (1e-6, True, "as a length in m read as um is"),
    (180 / math.pi, False, "as degrees read as radians are"),
    (math.pi / 180, False, "as radians read as degrees are"),
    (9.80665, False, "as m/s^2 read as g is, or kg read as N"),
    (1 / 9.80665, False, "as g read as m/s^2 is, or N read as kg"),
)
"""Measured over simulated, whether it needs no more than the power of ten, and the confusion."""

_NUMBERS: dict[str, tuple[tuple[float, str], ...]] = {
    "mass": ((1e3, "as t for kg makes it, or g for kg the other way round"),
             (1e-3, "as g for kg makes it"),
             (1e6, "as milliseconds taken for seconds make it")),
    "stiffness": ((1e3, "as N/mm for N/m makes it"), (1e-3, "as mm taken for m makes it"),
                  (1e6, "as milliseconds taken for seconds make it"),
                  (1e-6, "as seconds taken for milliseconds make it"),
                  ((2 * math.pi) ** 2, "as Hz taken for rad/s makes it"),
                  (180 / math.pi, "as degrees taken for radians make it"),
                  (math.pi / 180, "as degrees taken for radians make it")),
    "damping": ((1e3, "as milliseconds taken for seconds make it, or N s/mm for N s/m"),
                (1e-3, "as seconds taken for milliseconds make it, or mm taken for m")),
    "gain": ((1e3, "as kN for N makes it, or mm for m"),
             (1e-3, "as N for kN makes it, or m for mm"),
             (180 / math.pi, "as degrees for radians make it"),
             (math.pi / 180, "as radians for degrees make it")),
}  # fmt: skip
"""New over old, by the kind of number, and the confusion that makes it."""


def unit_of_ratio(ratio: float, scatter: float) -> str:
    """Return which confusion of units makes an amplitude so many times too large, "" if none.

    Parameters
    ----------
    ratio : float
        Measured over simulated amplitude.
    scatter : float
        Factor that half of the frequencies lie within, around it: where it is not near one, only
        powers of a thousand are named.

    Returns
    -------
    str

    Examples
    --------
    >>> unit_of_ratio(57.0, 1.02), unit_of_ratio(57.0, 1.7), unit_of_ratio(3.0, 1.02)
    ('as degrees read as radians are', '', '')
    """
    for factor, decade, words in _AMPLITUDES:
        tolerance = LIMITS.near if decade else LIMITS.close
        near = abs(math.log(ratio / factor)) <= math.log(tolerance)
        if near and (decade or scatter <= tolerance):
            return words
    return ""


def unit_of_change(kind: str, ratio: float) -> str:
    """Return which confusion of units makes a fit change a number so, "" if none is known.

    Parameters
    ----------
    kind : str
        ``"mass"``, ``"stiffness"``, ``"damping"`` or ``"gain"``.
    ratio : float
        New over old.

    Returns
    -------
    str

    Examples
    --------
    >>> unit_of_change("stiffness", 0.9e6)
    'as milliseconds taken for seconds make it'
    >>> unit_of_change("stiffness", 12.0)
    ''
    """
    near = [(abs(math.log(ratio / factor)), words) for factor, words in _NUMBERS.get(kind, ())]
    distance, words = min(near, default=(math.inf, ""))
    return words if distance <= math.log(LIMITS.guessed) else ""
