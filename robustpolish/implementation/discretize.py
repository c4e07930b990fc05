"""Run a continuous controller on a computer: imitate it at samples and certify the loop anew."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import control
import numpy as np

from robustpolish.base.checks import misfit, positive
from robustpolish.base.results import shown
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.implementation.certify_sampled import (
    checked_delay,
    checked_plant,
    filtered_plant,
    longest_period,
    with_signal_names_of,
)
from robustpolish.implementation.emulation import emulated
from robustpolish.implementation.sampled.certificate import (
    AntiAliasing,
    Norm,
    certificate_of,
    filter_system,
    with_filter,
)
from robustpolish.implementation.sampled.lifting import (
    beyond_a_period,
    period_map,
    without_loop_delay,
)
from robustpolish.implementation.sampled_design import SampledDesign
from robustpolish.plants.blocks import named_system
from robustpolish.plants.plant import GeneralizedPlant

# A continuous plant as the computer sees it: from controls to measurements, sample to sample.


def plant_at_samples(
    plant: GeneralizedPlant,
    period: float,
    delay: float = 0.0,
    *,
    anti_aliasing: AntiAliasing = None,
) -> control.StateSpace:
    """Return the plant from its controls to its measurements at samples, exactly.

    With it the loop of a discrete controller is one in discrete time, whose margins
    :func:`robustpolish.loop_analysis` finds: hold and delay are in them as they are.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous.
    period, delay : float
        Seconds between samples, and from a sample until its control acts.
    anti_aliasing : float, (int, float) or control system, optional
        Analogue filter before the samplers, as in :meth:`Design.discretize`.

    Returns
    -------
    control.StateSpace
        With sampling time `period`; controls that the delays still hold back are among its
        states. The plant's own delays count too, from its controls and to its measurements.

    Raises
    ------
    InvalidInputError
        If the plant is discrete, the delays together are longer than 200 periods, or delays of
        the plant differ between its controls or measurements or stand inside it.

    Notes
    -----
    Åström and Wittenmark, Computer-Controlled Systems, section 2.3. A measurement is taken just
    before the control changes, so that a direct path is delayed by a sample at least.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> lag = control.tf([1], [1, 1], inputs="u", outputs="y")
    >>> plant = rp.GeneralizedPlant(lag, measurements="y", controls="u")
    >>> sampled = rp.implementation.plant_at_samples(plant, period=0.1, delay=0.05)
    >>> sampled.dt, sampled.nstates, round(float(control.dcgain(sampled)), 6)
    (0.1, 2, 1.0)
    """
    checked_plant(plant)
    period = positive("period", period, "s")
    plant, own = without_loop_delay(plant)
    delay = checked_delay(positive("delay", delay, "s", zero=True) + own, period)
    if plant.delays:
        shown = ", ".join(f"{name} {duration(each)}" for name, each in plant.delays.items())
        want = "the same delay at all controls and the same at all measurements"
        remedy = "certify_sampled takes it, with a Pade model of what differs."
        raise misfit("plant", f"delays that remain at single signals: {shown}", want, remedy)
    plant = with_filter(plant, filter_system(anti_aliasing, plant.ny))
    still = named_system(
        ([], [], [], np.zeros((plant.nu, plant.ny))),
        period,
        plant.measurement_names,
        plant.control_names,
    )
    found = period_map(plant, still, period, delay)
    through = found.transition()
    A, B = found.N0 + found.M @ through @ found.L0, found.Nu + found.M @ through @ found.Lu
    if not np.isfinite(A).all() or not np.isfinite(B).all():
        raise beyond_a_period(period)
    # Averages of noise are states of the loop, but none of the plant.
    kept = np.r_[: plant.nx, plant.nx + len(found.noisy) : len(A)]
    ages = range(1, 1 + (len(kept) - plant.nx) // plant.nu)
    held = [f"{u} held {age}" for age in ages for u in plant.control_names]
    matrices = A[np.ix_(kept, kept)], B[kept], found.Y[:, kept], np.zeros((plant.ny, plant.nu))
    labels = plant.control_names, plant.measurement_names, [*plant.states, *held]
    return named_system(matrices, period, *labels)


_UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns"), (1e-12, "ps"))


def discretized(
    plant: GeneralizedPlant,
    controller: control.StateSpace,
    period: float,
    delay: float,
    norm: Norm,
    continuous_norm: float,
    *,
    method: str = "tustin",
    prewarp_hz: float | None = None,
    anti_aliasing: AntiAliasing = None,
    details: Mapping[str, Any] | None = None,
) -> SampledDesign:
    """Imitate a controller at samples and certify the sampled loop; see `Design.discretize`.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous.
    controller : control.StateSpace
        Continuous, or a static gain.
    period, delay : float
        In s.
    norm : {"hinf", "h2"}
    continuous_norm : float
        The norm of the continuous loop.
    method : str, optional
    prewarp_hz : float, optional
        See `emulated`.
    anti_aliasing : float, (int, float) or control system, optional
        See `certify_sampled`.
    details : mapping, optional
        What else is to be known of the result.

    Returns
    -------
    SampledDesign

    Raises
    ------
    InvalidInputError
        If an argument is wrong.
    InfeasibleError
        If the sampled loop is unstable; it tells the longest period that keeps it stable.
    SolverError
        If the loop is stable as far as doubles can tell, but no bound could be proven.
    """
    checked_plant(plant)
    period = positive("period", period, "s")
    delay = checked_delay(delay, period)
    filtering = filter_system(anti_aliasing, plant.ny)
    filtered = filtered_plant(plant, filtering, norm, "design for")
    K = with_signal_names_of(plant, emulated(controller, period, method, prewarp_hz))
    certificate = certificate_of(filtered, K, delay, norm)
    late = f" with a delay of {duration(delay)}" if delay else ""
    how = f"ampled every {duration(period)}{late}, the loop"
    if not certificate.stable:
        raise InfeasibleError(
            f"period: s{how} is unstable (a pole of size {certificate.spectral_radius:.6g}). "
            + _remedy(filtered, controller, period, delay, method, prewarp_hz),
            [p for p in certificate.poles if abs(p) >= 1],
        )
    if not certificate.valid:
        raise SolverError(
            f"period: s{how} has no certificate, because {'; '.join(certificate.reasons)}"
            ". Reduce the controller first, or change the period."
        )
    return SampledDesign(
        plant=plant,
        controller=K,
        period=period,
        delay=delay,
        certificate=certificate,
        message=f"S{how} is stable; {_cost(continuous_norm, certificate.achieved)}.",
        norm=norm,
        continuous_norm=continuous_norm,
        method=method,
        anti_aliasing=filtering,
        details=details or MappingProxyType({}),
    )


def duration(seconds: float) -> str:
    """Return a time with a handy unit.

    Examples
    --------
    >>> duration(2.5e-4), duration(0.0)
    ('250 us', '0 s')
    """
    sizes = (unit for unit in _UNITS if seconds >= unit[0] * (1 - 1e-9))
    size, unit = next(sizes, _UNITS[0])
    return f"{shown(float(seconds) / size, 4)} {unit}"


def _cost(before: float, after: float) -> str:
    if before <= 0 or not math.isfinite(before):
        return f"its norm is {after:.4g}"
    change = 100 * (after / before - 1)
    if abs(change) < 0.05:
        return f"its norm stays at {after:.4g}"
    verb = "rises" if change > 0 else "falls"
    percent = f"{change:+.1f}" if abs(change) < 10 else f"{change:+.0f}"
    return f"its norm {verb} from {before:.4g} to {after:.4g} ({percent} %)"


def _remedy(
    filtered: GeneralizedPlant,
    controller: control.StateSpace,
    period: float,
    delay: float,
    method: str,
    prewarp_hz: float | None,
) -> str:
    found = longest_period(filtered, controller, delay, method=method, prewarp_hz=prewarp_hz)
    if found == 0 and delay == 0:
        return (
            "No period was found that keeps it stable: with a controller this fast, doubles "
            "cannot tell slow poles from the unit circle. Design a slower controller, with a price "
            "on u and noise on y."
        )
    if found == 0:
        return (
            "It is so however short the period: the delay (and the filter) alone make it unstable. "
            "Shorten the delay, or design with delay and actuators in the plant."
        )
    if found < period:
        return (
            f"The longest period that keeps it stable is {duration(found)}. Sample faster, or "
            "design a slower controller: with a price on u, noise on y and delay in the plant."
        )
    return "Other periods near it are stable; change it a little, or use method='zoh'."
