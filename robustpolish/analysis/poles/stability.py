"""Is a system stable? Decided without rounding where rounding could matter."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import control
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from robustpolish.analysis.poles.eigen import Eigensystem, eigensystem
from robustpolish.analysis.poles.exact_poles import count_poles
from robustpolish.display import Card, Displayed, quantities
from robustpolish.exact.rational import EXACT_STATES, ExactModel, rational
from robustpolish.exact.realisation import Realisation, realisation, rescaled
from robustpolish.plotting import plot_poles

COUNTED_STATES = 150
"""Largest number of coupled states whose poles are counted in exact arithmetic."""


@dataclass(frozen=True, repr=False)
class Stability(Displayed):
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
    poles : ndarray of complex
        All poles, to be drawn; the verdict does not rest on them.
    discrete : bool
        Whether the unit circle is the boundary.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> rp.stability(control.ss([[-2.0]], [[1.0]], [[1.0]], 0))
    stable
      nearest pole  -2 rad/s
      margin        2 rad/s
      exact         no
      all poles are strictly stable
    """

    verdict: Literal["stable", "marginal", "unstable"]
    pole: complex | None
    margin: float
    exact: bool
    reason: str
    poles: NDArray[np.complex128] = field(
        default_factory=lambda: np.zeros(0, complex), compare=False
    )
    discrete: bool = False

    def __bool__(self) -> bool:
        return self.verdict == "stable"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the poles with the boundary of stability.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.stability(rp.air_bearing().open_loop).plot().get_ylabel()
        'frequency [kHz]'
        """
        return plot_poles({"poles": self.poles}, ax=ax, discrete=self.discrete)

    def _card(self) -> Card:
        unit = "" if self.discrete else " rad/s"
        rows = (
            ("nearest pole", None if self.pole is None else _shown(self.pole, self.discrete)),
            ("margin", f"{self.margin:.6g}{unit}"),
            ("exact", self.exact),
        )
        return Card(self.verdict, (quantities(*rows),), (self.reason,))


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
    >>> import robustpolish as rp
    >>> oscillator = control.ss([[0, 1], [-1, -2e-12]], [[0], [1]], [[1, 0]], 0)
    >>> bool(rp.stability(oscillator))
    True
    >>> rp.stability(control.ss([[0.0]], [[1.0]], [[1.0]], 0)).reason
    'pole 0 rad/s on the imaginary axis'
    """
    model = rescaled(realisation("system", system))
    spectrum = eigensystem(model.A)
    poles = spectrum.values * model.time
    return replace(stability_of(model, spectrum), poles=poles, discrete=model.discrete)


def stability_of(model: Realisation, spectrum: Eigensystem | None = None) -> Stability:
    """Decide it for rescaled matrices; the `spectrum` of A is taken if it is at hand."""
    spectrum = spectrum or eigensystem(model.A)
    poles, errors = spectrum.values, spectrum.errors
    if poles.size == 0:
        return Stability("stable", None, np.inf, False, "there are no states")
    margins = 1 - np.abs(poles) if model.discrete else -poles.real
    worst = int(margins.argmin())
    pole, margin = complex(poles[worst]) * model.time, float(margins[worst]) * model.time
    clear = np.count_nonzero(np.abs(margins) > errors)
    if clear == margins.size or (margins < -errors).any():
        verdict = "stable" if margin > 0 else "unstable"
        return Stability(verdict, pole, margin, False, _sentence(verdict, pole, model.discrete))
    if model.states > COUNTED_STATES:
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


def stable_part(model: Realisation, verdict: Stability) -> ExactModel | None:
    """Return what inputs and outputs see of a marginal system, if that is strictly stable."""
    if model.states > EXACT_STATES or not verdict.exact:
        return None
    seen = ExactModel.of(model).minimal()
    left = count_poles(seen.A, model.discrete)
    return None if left.marginal or left.unstable else seen


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
