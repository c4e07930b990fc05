"""The certificate of a sampled loop as users ask for it: arguments checked, filter put in."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike

from robustpolish.base.checks import instance_of, invalid, misfit, one_of, positive
from robustpolish.errors import InvalidInputError
from robustpolish.implementation.realization import emulated
from robustpolish.implementation.sampled import certificate
from robustpolish.implementation.sampled.lifting import period_map, scaled, without_loop_delay
from robustpolish.linear.systems import as_state_space, is_system, named_like, named_system
from robustpolish.plants.blocks import matrices_of, static_controller
from robustpolish.plants.plant import GeneralizedPlant

MOST_PERIODS = 200
"""Longest delay, in periods: every one of them adds a state per control."""


def certify_sampled(
    plant: GeneralizedPlant,
    controller: control.StateSpace | ArrayLike,
    period: float | None = None,
    delay: float = 0.0,
    norm: certificate.Norm = "hinf",
    *,
    anti_aliasing: certificate.AntiAliasing = None,
) -> certificate.SampledCertificate:
    r"""Certify a continuous plant with a controller that a computer runs at samples.

    The loop has a sampler, u[k] = K y[k], the time that this takes, and a zero-order hold. Its
    norm counts w and z at all times, not only at the samples.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous.
    controller : control.StateSpace or array_like, shape (nu, ny)
        Discrete, with the period as its sampling time, or a gain; u = K y, positive sign.
    period : float, optional
        h in s; by default the controller's sampling time.
    delay : float, optional
        Seconds from a sample until its control acts: any part or multiple of the period.
    norm : {"hinf", "h2"}, optional
        The induced L2 norm, or the generalised H2 norm.
    anti_aliasing : float, (int, float) or control system, optional
        Analogue filter before the samplers: the corner of a Butterworth filter in Hz (second
        order), (order, corner in Hz), or a system. It is a part of the loop.

    Returns
    -------
    SampledCertificate

    Raises
    ------
    InvalidInputError
        If the plant is discrete, shapes or sampling times do not fit, or D11 is not zero for "h2".

    Notes
    -----
    A gamma is tested on the lifted loop [1]_, [2]_, of which a period is one step: the
    equivalent discrete loop follows from the Hamiltonian's exponential over the period. Here the
    period is built up from a short first step by doubling, which shows on the way whether
    gamma exceeds the norm within a period, and goes on over periods until the loop has settled.
    Bound and reached gain are proven in ball arithmetic.

    Measurement noise without a filter (D21) enters as its average over the period before each
    sample: what a broad band does to a bare sampler has no bound.

    References
    ----------
    .. [1] B. Bamieh, J. B. Pearson, "A general framework for linear periodic systems with
       applications to H-infinity sampled-data control", IEEE Trans. Automatic Control 37 (1992)
       418-435.
    .. [2] T. Chen, B. Francis, Optimal Sampled-Data Control Systems, Springer 1995,
       chapters 10 and 13.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> certificate = rp.implementation.certify_sampled(plant, [[-3.0]], period=0.1)
    >>> certificate.valid, round(certificate.bound, 4)
    (True, 0.5019)
    """
    one_of("norm", norm, ("hinf", "h2"))
    checked_plant(plant)
    K = discrete_controller(plant, controller, period)
    delay = checked_delay(delay, float(K.dt))
    filtering = certificate.filter_system(anti_aliasing, plant.ny)
    return certificate.certificate_of(
        filtered_plant(plant, filtering, norm, "certify"), K, delay, norm
    )


def filtered_plant(
    plant: GeneralizedPlant, filtering: control.StateSpace | None, norm: certificate.Norm, verb: str
) -> GeneralizedPlant:
    """Return the plant behind its filter, if it has the norm that is asked for."""
    filtered = certificate.with_filter(plant, filtering)
    if norm == "h2" and filtered.D11.any():
        remedy = f"Leave the direct path out of z, or {verb} norm='hinf'."
        raise misfit("plant", "D11 that is not zero", "D11 = 0 for 'h2'", remedy)
    return filtered


def checked_plant(plant: Any) -> GeneralizedPlant:
    """Return a continuous plant."""
    remedy = "Build one with GeneralizedPlant(control.ss(...), measurements=..., controls=...)."
    instance_of("plant", plant, GeneralizedPlant, "a GeneralizedPlant", remedy)
    if plant.is_discrete:
        remedy = "Its controllers are discrete already: certify them with rp.certify."
        raise misfit("plant", f"a discrete one with dt = {plant.dt}", "a continuous plant", remedy)
    return plant


def checked_delay(delay: Any, period: float) -> float:
    """Return a delay of a bearable number of periods."""
    delay = positive("delay", delay, "s", zero=True)
    if delay > MOST_PERIODS * period:
        shown = f"{delay:.6g} s, which is {delay / period:.0f} periods"
        want = f"at most {MOST_PERIODS} periods of {period:.6g} s"
        raise misfit("delay", shown, want, "Check its unit, or lengthen the period.")
    return delay


def discrete_controller(
    plant: GeneralizedPlant, controller: Any, period: float | None
) -> control.StateSpace:
    """Return a controller with the period as its sampling time and shapes that suit the plant."""
    own: Any = None
    controller = getattr(controller, "controller", controller)  # of a design
    if is_system(controller):
        controller = as_state_space("controller", controller, period)
    if isinstance(controller, control.StateSpace) and controller.dt not in (None, True):
        own = controller.dt if controller.nstates or controller.dt else None
    if own is not None and own == 0:
        remedy = "Imitate it at samples first, with design.discretize(period)."
        raise misfit("controller", "a continuous one", "a discrete one", remedy)
    if period is None and own is None:
        raise invalid("period", None, "the sampling time in s", "Pass period=...")
    given = positive("period", own if period is None else period, "s")
    if own is not None and not np.isclose(own, given, rtol=1e-9, atol=0):
        want = f"the controller's sampling time, {own:.6g} s"
        raise invalid("period", given, want, "Leave it out.")
    if not isinstance(controller, control.StateSpace):
        controller = static_controller(plant, controller)
    if (controller.noutputs, controller.ninputs) != (plant.nu, plant.ny):
        shown = f"{controller.ninputs} inputs and {controller.noutputs} outputs"
        want = f"{plant.ny} inputs (y) and {plant.nu} outputs (u)"
        raise misfit("controller", shown, want, "Check measurements= and controls= of the plant.")
    return with_signal_names_of(plant, named_like(controller, matrices_of(controller), given))


def with_signal_names_of(
    plant: GeneralizedPlant, controller: control.StateSpace
) -> control.StateSpace:
    """Return a controller whose inputs and outputs are called as the plant's y and u."""
    names = plant.measurement_names, plant.control_names, controller.state_labels
    return named_system(matrices_of(controller), float(controller.dt), *names)


# The longest period at which an imitated controller keeps its loop stable.

STEP = 1.08
"""Ratio of neighbouring periods that are tried: loops lose their stability over wider ranges."""

_FAST, _SLOW = 1e-2, 1e3
_BISECTIONS = 30


def longest_period(
    plant: GeneralizedPlant,
    controller: control.StateSpace,
    delay: float = 0.0,
    *,
    delay_periods: float = 0.0,
    method: str = "tustin",
    prewarp_hz: float | None = None,
) -> float:
    """Return the longest period up to which the sampled loop is stable.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous, with its filter.
    controller : control.StateSpace
        Continuous, or a static gain.
    delay : float, optional
        Seconds from a sample until its control acts, whatever the period.
    delay_periods : float, optional
        Delay in periods, which is added.
    method : str, optional
    prewarp_hz : float, optional
        See `emulated`.

    Returns
    -------
    float
        In s; infinite if no period makes it unstable, 0 if none was found that keeps it stable,
        because of the delay, or because poles differ by so much that doubles cannot tell.

    Notes
    -----
    Periods are tried from a hundredth of the fastest time constant of the loop upwards, each 8 %
    longer than the one before; where stability is lost, the limit is bisected. Beyond it a loop may
    be stable once more.
    """
    plant, own = without_loop_delay(plant)
    delay += own

    def stable(period: float) -> bool:
        try:
            K = emulated(controller, period, method, prewarp_hz)
        except InvalidInputError:
            return False
        late = delay + delay_periods * period
        A = scaled(period_map(plant, K, period, late)).transition()
        grows = not np.isfinite(A).all()  # beyond doubles within a period
        return not grows and bool(np.abs(np.linalg.eigvals(A)).max(initial=0.0) < 1)

    rates = np.abs(np.linalg.eigvals(np.asarray(plant.closed_loop(controller).A)))
    rates = rates[rates > rates.max(initial=0.0) * 1e-12]
    if not rates.size:
        return math.inf
    shortest = max(_FAST / rates.max(), delay / MOST_PERIODS * 4)
    if not stable(shortest):
        return _downwards(stable, shortest, delay)
    limit = _SLOW / rates.min()
    if prewarp_hz is not None:
        limit = min(limit, 0.499 / prewarp_hz)
    found = last_stable(stable, shortest, limit)
    return limit if prewarp_hz is not None and math.isinf(found) else found


def last_stable(stable: Callable[[float], bool], period: float, limit: float) -> float:
    """Return the period at which a loop, stable at a first one, is no longer; infinite if none.

    Periods are tried up to a limit, each longer by `STEP` than the one before.
    """
    while period < limit:
        if not stable(period * STEP):
            return _between(stable, period, period * STEP)
        period *= STEP
    return math.inf


def _downwards(stable: Callable[[float], bool], high: float, delay: float) -> float:
    """Look for a shorter period that is stable, as far down as the delay lets one."""
    for _ in range(12):
        low = high / 4
        if delay / low > MOST_PERIODS:
            return 0.0
        if stable(low):
            return _between(stable, low, high)
        high = low
    return 0.0


def _between(stable: Callable[[float], bool], low: float, high: float) -> float:
    for _ in range(_BISECTIONS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low
