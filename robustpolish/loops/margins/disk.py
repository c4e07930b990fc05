"""The disk margin: gain and phase that may change together."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robustpolish.analysis import HinfNorm


@dataclass(frozen=True)
class DiskMargin:
    r"""A disk of complex factors f in every broken loop, none of which makes it unstable.

    The disk is :math:`f = (1 + \delta \alpha / 2) / (1 - \delta \alpha / 2)` with
    :math:`|\delta| < 1`: symmetric in gain and phase, the "balanced" one of [1]_, python-control's
    ``skew=0`` and MATLAB's ``diskmargin``.

    Attributes
    ----------
    alpha : float
        Its size, 2 over the peak of S - T: for one loop to nine digits; for several a lower
        bound, within 0.1 % where no more than three signals change.
    frequency_hz : float
        Where the loop comes nearest; infinite if only the limit does, nan if nowhere.
    proven : bool
        Whether no frequency at all, not only none of a grid, comes nearer.

    References
    ----------
    .. [1] P. Seiler, A. Packard, P. Gahinet, "An Introduction to Disk Margins", IEEE Control
       Systems Magazine 40 (2020) 78-95.

    Examples
    --------
    >>> from robustpolish.loops import DiskMargin
    >>> margin = DiskMargin(alpha=2 / 3, frequency_hz=10.0, proven=True)
    >>> [round(factor, 3) for factor in margin.gain], round(margin.phase_deg, 2)
    ([0.5, 2.0], 36.87)
    >>> round(margin.gain_db, 2)
    6.02
    """

    alpha: float
    frequency_hz: float
    proven: bool

    @property
    def gain(self) -> tuple[float, float]:
        """Factors between which every gain may lie; 0 and infinity from alpha = 2 on."""
        if self.alpha >= 2:
            return 0.0, math.inf
        return (2 - self.alpha) / (2 + self.alpha), (2 + self.alpha) / (2 - self.alpha)

    @property
    def gain_db(self) -> float:
        """The upper factor in dB; the lower is its negative."""
        return decibel(self.gain[1])

    @property
    def phase_deg(self) -> float:
        """Degrees by which the phase may turn either way."""
        return math.degrees(2 * math.atan(self.alpha / 2))


def disk_of(norm: HinfNorm) -> DiskMargin:
    """Return the disk margin of one loop from the norm of its S - T.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> from robustpolish.loops.margins.disk import disk_of
    >>> disk_of(rp.hinf_norm(control.ss([], [], [], [[4.0]]))).alpha
    0.5
    """
    alpha = 2 / norm.value if norm.value else math.inf
    return DiskMargin(alpha, norm.frequency / (2 * math.pi), math.isfinite(norm.upper))


def decibel(factor: float) -> float:
    """Return a gain in dB: infinite for 0 and infinity, with the sign that belongs to it.

    Examples
    --------
    >>> from robustpolish.loops.margins.disk import decibel
    >>> round(decibel(2.0), 2), decibel(0.0)
    (6.02, -inf)
    """
    return 20 * math.log10(factor) if factor > 0 else -math.inf
