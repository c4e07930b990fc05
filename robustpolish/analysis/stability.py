"""Is a system stable? Decided without rounding where rounding could matter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import control
import numpy as np

from robustpolish.analysis._eigen import eigensystem
from robustpolish.analysis._exact import rational
from robustpolish.analysis._exact_poles import count_poles
from robustpolish.analysis._realisation import Realisation, realisation, rescaled

EXACT_STATES = 150
"""Largest number of coupled states whose poles are counted in exact arithmetic."""


@dataclass(frozen=True)
class Stability:
    """On which side of the stability boundary the poles lie.

    Attributes
    ----------
    verdict : {"stable", "marginal", "unstable"}
        Marginal: none beyond the boundary, but at least one on it.
    pole : complex or None
        The pole nearest to the boundary or farthest beyond it, in rad/s (in
        discrete time without unit); None without states.
    margin : float
        Its distance from the boundary, positive inside: the negative real part
        in rad/s, or one less the magnitude.
    exact : bool
        Whether it took exact arithmetic to decide.
    reason : str
        The verdict in a sentence.
    """

    verdict: Literal["stable", "marginal", "unstable"]
    pole: complex | None
    margin: float
    exact: bool
    reason: str

    def __bool__(self) -> bool:
        return self.verdict == "stable"


def stability(system: control.StateSpace) -> Stability:
    r"""Decide whether all poles are strictly stable.

    Poles whose distance from the imaginary axis (the unit circle) is within
    reach of rounding are counted again in exact rational arithmetic, so the
    answer is right for the matrix as it is stored, at any scale.

    Parameters
    ----------
    system : control.StateSpace
        Continuous or discrete.

    Returns
    -------
    Stability
        True in a condition if, and only if, the system is strictly stable.

    Raises
    ------
    InvalidInputError
        If it is no ``StateSpace`` or has entries that are not finite.

    Examples
    --------
    >>> import control
    >>> from robustpolish.analysis import stability
    >>> oscillator = control.ss([[0, 1], [-1, -2e-12]], [[0], [1]], [[1, 0]], 0)
    >>> bool(stability(oscillator))
    True
    >>> stability(control.ss([[0.0]], [[1.0]], [[1.0]], 0)).reason
    'pole 0 rad/s on the imaginary axis'
    """
    return stability_of(rescaled(realisation("system", system)))


def stability_of(model: Realisation) -> Stability:
    """Decide it for rescaled matrices."""
    spectrum = eigensystem(model.A)
    poles, errors = spectrum.values, spectrum.errors
    if poles.size == 0:
        return Stability("stable", None, np.inf, False, "there are no states")
    margins = 1 - np.abs(poles) if model.discrete else -poles.real
    worst = int(margins.argmin())
    pole, margin = complex(poles[worst]) * model.time, float(margins[worst]) * model.time
    clear = np.abs(margins) > errors
    if clear.all() or (margins < -errors).any():
        verdict = "stable" if margin > 0 else "unstable"
        return Stability(verdict, pole, margin, False, _sentence(verdict, pole, model.discrete))
    if model.states > EXACT_STATES:
        text = f"pole {_shown(pole, model.discrete)} too near the boundary to decide: not trusted"
        return Stability("marginal", pole, margin, False, text)
    return _exactly(model, pole, margin)


def _exactly(model: Realisation, pole: complex, margin: float) -> Stability:
    count = count_poles(rational(model.A), model.discrete)
    if count.unstable:
        verdict, pole = "unstable", max(count.unstable, key=lambda p: _excess(p, model.discrete))
        margin = -_excess(pole, model.discrete)
    elif count.marginal:
        verdict, pole, margin = "marginal", count.marginal[0], 0.0
    else:
        text = _sentence("stable", pole, model.discrete) + ", decided in exact arithmetic"
        return Stability("stable", pole, abs(margin), True, text)
    pole, margin = pole * model.time, margin * model.time
    return Stability(verdict, pole, margin, True, _sentence(verdict, pole, model.discrete))


def _excess(pole: complex, discrete: bool) -> float:
    return abs(pole) - 1 if discrete else pole.real


def _sentence(verdict: str, pole: complex, discrete: bool) -> str:
    if verdict == "stable":
        return "all poles are strictly stable"
    side = {
        ("unstable", False): "in the right half-plane",
        ("unstable", True): "outside the unit circle",
        ("marginal", False): "on the imaginary axis",
        ("marginal", True): "on the unit circle",
    }[verdict, discrete]
    return f"pole {_shown(pole, discrete)} {side}"


def _shown(pole: complex, discrete: bool) -> str:
    unit = "" if discrete else " rad/s"
    if pole.imag == 0:
        return f"{pole.real:.6g}{unit}"
    return f"{pole.real:.6g} {'+' if pole.imag > 0 else '-'} {abs(pole.imag):.6g}j{unit}"
