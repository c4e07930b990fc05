"""A continuous plant as the computer sees it: from controls to measurements, sample to sample."""

from __future__ import annotations

import control
import numpy as np
from scipy.linalg import expm

from robustpolish.arrays import Matrix
from robustpolish.implementation.discretization.certify_sampled import checked_delay, checked_plant
from robustpolish.implementation.sampled.anti_aliasing import (
    AntiAliasing,
    filter_system,
    with_filter,
)
from robustpolish.implementation.sampled.period_map import beyond_a_period, split_delay
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.blocks import named_system
from robustpolish.validation import positive


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
    >>> sampled = rp.plant_at_samples(plant, period=0.1, delay=0.05)
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
