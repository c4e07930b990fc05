"""SI prefixes: which one suits a size, and which units bear one."""

from __future__ import annotations

import math
import re

_PREFIXES = dict(zip(range(-30, 31, 3), (*"qryzafpnµm", "", *"kMGTPEZYRQ"), strict=True))
# SI units by their symbols alone: others, such as mm, kg or min, have a prefix or bear none. One
# before a power ("mm^2") would be read wrongly.
_PREFIXABLE = re.compile(
    r"(m|s|g|A|K|N|Nm|V|W|J|Pa|Hz|rad|C|F|H|S|T|Wb|Ω|ohm)(?![A-Za-zΩ_^²³0-9]|\*\*)"
)


def bears_prefix(unit: str) -> bool:
    """Say whether a prefix may stand before a unit; not before none, %, 1/s, m^2, kg and mm.

    Parameters
    ----------
    unit : str

    Returns
    -------
    bool
    """
    return _PREFIXABLE.match(unit) is not None


def prefix_power(size: float) -> int:
    """Return the power of ten of the prefix that suits a size, a multiple of 3.

    Parameters
    ----------
    size : float
        0 and what is not finite get none.

    Returns
    -------
    int
    """
    power = 3 * math.floor(math.log10(size) / 3) if 0 < size < math.inf else 0
    return min(max(power, min(_PREFIXES)), max(_PREFIXES))


def prefixed(unit: str, power: int) -> str:
    """Return a unit with the prefix of a power of ten.

    Parameters
    ----------
    unit : str
    power : int

    Returns
    -------
    str

    Examples
    --------
    >>> from robustpolish.si_prefix import prefix_power, prefixed
    >>> prefixed("m", prefix_power(2.1e-5))
    'µm'
    """
    return _PREFIXES[power] + unit
