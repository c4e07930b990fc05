"""How slowly a design may be sampled."""

from __future__ import annotations

from robustpolish.base.checks import one_of, positive
from robustpolish.implementation.certify_sampled import checked_plant, longest_period
from robustpolish.implementation.emulation import METHODS
from robustpolish.implementation.sampled.certificate import AntiAliasing, filter_system, with_filter
from robustpolish.synthesis.design import Design, checked_design


def largest_period(
    design: Design,
    delay: float = 0.0,
    *,
    delay_periods: float = 0.0,
    method: str = "tustin",
    prewarp_hz: float | None = None,
    anti_aliasing: AntiAliasing = None,
) -> float:
    """Return the longest period up to which a design may be sampled without losing stability.

    Parameters
    ----------
    design : Design
        Of a continuous plant.
    delay : float, optional
        Seconds from a sample until its control acts, whatever the period.
    delay_periods : float, optional
        Delay in periods, which is added: 1.0 for a computer that needs the whole of each.
    method : str, optional
        How the controller is imitated; see :meth:`Design.discretize`. Not "matched", whose
        polynomials lose their digits at short periods.
    prewarp_hz : float, optional
        Where "tustin" is exact, in Hz.
    anti_aliasing : float, (int, float) or control system, optional
        Analogue filter before the samplers; see :meth:`Design.discretize`.

    Returns
    -------
    float
        In s; infinite if no period makes the loop unstable, 0 if none was found that keeps it
        stable: the delay is too long, or fast and slow poles differ by more than 1e9 or so, which
        doubles cannot tell apart at samples. At this period the loop is about to become unstable:
        sample several times faster.

    Raises
    ------
    InvalidInputError
        If an argument is wrong.

    Notes
    -----
    Periods are tried upwards, each 8 % longer than the one before, and the limit is bisected.

    Examples
    --------
    x' = x + u with u = -3 x, held for h, is stable while exp(h) - 3 (exp(h) - 1) > -1.

    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> design = rp.given_controller(plant, [[-3.0]])
    >>> round(rp.synthesis.largest_period(design), 4)
    0.6931
    >>> round(rp.synthesis.largest_period(design, delay_periods=1.0), 4)
    0.2877
    """
    checked_design("design", design)
    plant = checked_plant(design.plant)
    known = [*(m for m in METHODS if m != "matched"), "bilinear", "euler", "backward_diff"]
    one_of("method", method, known, "Short periods spoil the polynomials of 'matched'.")
    return longest_period(
        with_filter(plant, filter_system(anti_aliasing, plant.ny)),
        design.controller,
        positive("delay", delay, "s", zero=True),
        delay_periods=positive("delay_periods", delay_periods, zero=True),
        method=method,
        prewarp_hz=None if prewarp_hz is None else positive("prewarp_hz", prewarp_hz, "Hz"),
    )
