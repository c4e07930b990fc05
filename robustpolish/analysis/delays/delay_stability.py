"""Stability with the delays as they are, not as Pade says."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from robustpolish.analysis.delays.delayed_system import DelayedSystem
from robustpolish.analysis.delays.roots import rightmost_roots
from robustpolish.analysis.delays.winding import count_unstable
from robustpolish.display import Card, Displayed, quantities
from robustpolish.exact.exponents import refuse_extreme
from robustpolish.plotting import plot_poles
from robustpolish.validation import instance_of


@dataclass(frozen=True, repr=False)
class DelayStability(Displayed):
    """Whether a system with delays is stable; true in a condition only if that was shown.

    Attributes
    ----------
    verdict : {"stable", "unstable", "undecided"}
    unstable_roots : int or None
        How many characteristic roots lie to the right of the axis, by the argument principle; None
        if they could not be counted.
    rightmost : complex or None
        The rightmost root that was found and confirmed, in rad/s.
    reason : str
        How it was decided.
    roots : ndarray of complex
        The rightmost roots that were confirmed, in rad/s.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> H = control.ss([[-1.0]], [[1.0, -2.0]], [[1.0], [1.0]], 0)
    >>> rp.delay_stability(rp.DelayedSystem(H, (rp.DelayLine("x", 0.3),)))
    stable
      rightmost root      -2.54819+4.00697j rad/s
      roots on the right  0
      no root right of the axis, counted by the argument principle from Pade to exact delays
    """

    verdict: Literal["stable", "unstable", "undecided"]
    unstable_roots: int | None
    rightmost: complex | None
    reason: str
    roots: NDArray[np.complex128] = field(
        default_factory=lambda: np.zeros(0, complex), compare=False
    )

    def __bool__(self) -> bool:
        return self.verdict == "stable"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the rightmost roots.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import control
        >>> import robustpolish as rp
        >>> H = control.ss([[-1.0]], [[1.0, -2.0]], [[1.0], [1.0]], 0)
        >>> found = rp.delay_stability(rp.DelayedSystem(H, (rp.DelayLine("x", 0.3),)))
        >>> found.plot().get_xlabel()
        'real part [1/s]'
        """
        return plot_poles({"rightmost roots": self.roots}, ax=ax)

    def _card(self) -> Card:
        root = self.rightmost
        shown = None if root is None else f"{root.real:.6g}{root.imag:+.6g}j rad/s"
        rows = (("rightmost root", shown), ("roots on the right", self.unstable_roots))
        return Card(self.verdict, (quantities(*rows),), (self.reason,))


def delay_stability(system: DelayedSystem) -> DelayStability:
    r"""Decide whether a system with delays is stable.

    The roots to the right of the axis are counted by the argument principle: those of the Pade
    model, which are eigenvalues, and the turns that

    .. math:: \det(I - M(i\omega) (e^{-i\omega\tau} - \mathrm{Pade}(i\omega)))

    makes about zero, with M the loop around the difference. Independently, the rightmost roots are
    computed by Chebyshev polynomials along the delay lines and confirmed by their residuals.
    Stable is only what both find stable.

    Parameters
    ----------
    system : DelayedSystem
        What its inputs and outputs do does not matter, only what runs through its delays.

    Returns
    -------
    DelayStability

    Raises
    ------
    InvalidInputError
        If it is no ``DelayedSystem``.

    Notes
    -----
    Delays that feed each other directly (D between them) leave a chain of roots at ever higher
    frequencies. A system counts as stable only if it stays so under any small change of the
    delays: Hale, Verduyn Lunel, "Strong stabilization of neutral functional differential
    equations", IMA J. Mathematical Control and Information 19 (2002) 5-23.

    Examples
    --------
    x' = -x(t - T) is stable up to T = pi / 2.

    >>> import control
    >>> import robustpolish as rp
    >>> H = control.ss([[0.0]], [[-1.0]], [[1.0]], 0)
    >>> [rp.delay_stability(rp.DelayedSystem(H, (rp.DelayLine("x", T),))).verdict
    ...  for T in (1.57, 1.5709)]
    ['stable', 'unstable']
    """
    remedy = "Use plant.delayed_loop(controller), or build a DelayedSystem."
    instance_of("system", system, DelayedSystem, "a DelayedSystem", remedy)
    refuse_extreme("system", dict(zip("ABCD", system.matrices, strict=True)))
    ports = system.ports()
    if not system.lines:
        poles: Any = np.linalg.eigvals(ports[0]).astype(complex)
        poles = poles[np.argsort(-poles.real)]
        right = int((poles.real >= 0).sum())
        verdict = "unstable" if right else "stable"
        first = complex(poles[0]) if poles.size else None
        return DelayStability(verdict, right, first, "there are no delays", poles)
    direct = float(np.abs(np.linalg.eigvals(np.abs(ports[3]))).max())
    if direct >= 1:
        surely = len(system.lines) == 1 and direct > 1
        text = f"delays feed each other with a gain of {direct:.4g}, not below 1"
        return DelayStability("unstable" if surely else "undecided", None, None, text)
    counted = count_unstable(system)
    roots: Any = rightmost_roots(ports, system.seconds, counted.highest)
    first = complex(roots[0]) if roots.size else None
    found = int((roots.real >= 0).sum())
    if counted.unstable is None:
        if found:
            text = "a root right of the axis was found and confirmed"
            return DelayStability("unstable", None, first, text, roots)
        return DelayStability("undecided", None, first, counted.reason, roots)
    if counted.unstable:
        text = f"{counted.unstable} roots right of the axis, counted by the argument principle"
        return DelayStability("unstable", counted.unstable, first, text, roots)
    if found:
        text = "the argument principle counts no root on the right, yet one was found"
        return DelayStability("undecided", None, first, text, roots)
    text = "no root right of the axis, counted by the argument principle from Pade to exact delays"
    return DelayStability("stable", 0, first, text, roots)
