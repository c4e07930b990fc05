"""Run a continuous controller on a computer: imitate it at samples and certify the loop anew."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import control
import numpy as np
from scipy.linalg import expm

from robustpolish.base.arrays import Matrix
from robustpolish.base.checks import described, invalid, positive
from robustpolish.base.results import shown
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.implementation.certify_sampled import (
    checked_delay,
    checked_plant,
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
from robustpolish.implementation.sampled.lifting import beyond_a_period, split_delay
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
        With sampling time `period`; controls that the delay still holds back are among its states.

    Raises
    ------
    InvalidInputError
        If the plant is discrete, or the delay longer than 200 periods.

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
    delay = checked_delay(delay, period)
    plant = with_filter(plant, filter_system(anti_aliasing, plant.ny))
    whole, rest = split_delay(period, delay)
    n, nu = plant.nx, plant.nu
    held = whole + bool(rest or plant.D22.any())
    size = n + held * nu
    early, early_in = _flow(plant, rest)
    late, late_in = _flow(plant, period - rest)
    A, B = np.zeros((size, size)), np.zeros((size, nu))
    A[:n, :n] = late @ early

    def into(age: int) -> Matrix:
        """Return where the control of `age` samples ago stands: 0 is the one being put out."""
        return B[:n] if age == 0 else A[:n, n + (age - 1) * nu : n + age * nu]

    into(whole)[:] += late_in
    if rest:
        into(whole + 1)[:] += late @ early_in
    for age in range(held):
        rows = slice(n + age * nu, n + (age + 1) * nu)
        if age == 0:
            B[rows] = np.eye(nu)
        else:
            A[rows, n + (age - 1) * nu : n + age * nu] = np.eye(nu)
    C = np.zeros((plant.ny, size))
    C[:, :n] = plant.C2
    if plant.D22.any():  # acts with the control that was out before the sample
        C[:, n + whole * nu : n + (whole + 1) * nu] = plant.D22
    names = [f"{u} held {age + 1}" for age in range(held) for u in plant.control_names]
    D = np.zeros((plant.ny, nu))
    labels = plant.control_names, plant.measurement_names, [*plant.states, *names]
    return named_system((A, B, C, D), period, *labels)


def _flow(plant: GeneralizedPlant, length: float) -> tuple[Matrix, Matrix]:
    """Return what states and a held control become after some seconds."""
    n, nu = plant.nx, plant.nu
    generator = np.zeros((n + nu, n + nu))
    generator[:n] = np.hstack([plant.A, plant.B2])
    exponential: Matrix = np.asarray(expm(generator * length), dtype=float)
    if not np.isfinite(exponential).all():
        raise beyond_a_period(length)
    return exponential[:n, :n], exponential[:n, n:]


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
    filtered = with_filter(plant, filtering)
    if norm == "h2" and filtered.D11.any():
        remedy = "Leave the direct path out of z, or design for norm='hinf'."
        raise invalid("plant", described("D11 that is not zero"), "D11 = 0 for 'h2'", remedy)
    K = with_signal_names_of(plant, emulated(controller, period, method, prewarp_hz))
    certificate = certificate_of(filtered, K, delay, norm)
    how = f"Sampled every {duration(period)}" + (
        f" with a delay of {duration(delay)}" if delay else ""
    )
    if not certificate.stable:
        raise InfeasibleError(
            f"period: {how[0].lower()}{how[1:]}, the loop is unstable (a pole of size "
            f"{certificate.spectral_radius:.6g}). "
            + _remedy(filtered, controller, period, delay, method, prewarp_hz),
            [p for p in certificate.poles if abs(p) >= 1],
        )
    if not certificate.valid:
        raise SolverError(
            f"period: {how[0].lower()}{how[1:]}, the loop has no certificate, because "
            + "; ".join(certificate.reasons)
            + ". Reduce the controller first, or change the period."
        )
    return SampledDesign(
        plant=plant,
        controller=K,
        period=period,
        delay=delay,
        certificate=certificate,
        message=f"{how}, the loop is stable; {_cost(continuous_norm, certificate.achieved)}.",
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
    for size, unit in _UNITS:
        if seconds >= size * (1 - 1e-9):
            return f"{shown(seconds / size, 4)} {unit}"
    return f"{shown(float(seconds), 4)} s"


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
    if np.isfinite(found) and found < period:
        return (
            f"The longest period that keeps it stable is {duration(found)}. Sample faster, or "
            "design a slower controller: with a price on u, noise on y and delay in the plant."
        )
    return "Other periods near it are stable; change it a little, or use method='zoh'."
