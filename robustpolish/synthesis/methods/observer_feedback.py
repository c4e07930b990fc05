"""State feedback of an observer's estimate, designed for the norm of the whole loop."""

from __future__ import annotations

import time
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.design.design import Design
from robustpolish.synthesis.methods.structured_design import (
    PartTask,
    certified_design,
    design_parts,
    search_deadline,
)
from robustpolish.synthesis.problem.decoupling import PlantPart, decoupled_parts
from robustpolish.synthesis.problem.fixed_modes import refuse_unstable
from robustpolish.synthesis.problem.pricing import noisy, priced
from robustpolish.synthesis.problem.scaling import scale_plant
from robustpolish.synthesis.structured_search.observer import gains, observer_setting
from robustpolish.synthesis.structured_search.search import Norm
from robustpolish.validation import matrix, one_of, positive

Matrix = NDArray[Any]


def observer_feedback(
    plant: GeneralizedPlant,
    norm: Norm = "hinf",
    *,
    time_limit: float = 60.0,
    seed: int = 0,
    gain_bound: float | None = None,
    control_weight: ArrayLike | None = None,
    measurement_noise: ArrayLike | None = None,
    target: float = 0.0,
) -> Design:
    r"""Design u = F xhat with a Luenberger observer for the norm of the whole loop.

    The observer of the thesis's (10.63),

    .. math:: \dot{\hat x} = A \hat x + B_2 u + L (y - C_2 \hat x - D_{22} u),

    and the feedback F are found together, which (10.74) leaves open because it is
    bilinear in F and L. The way around: a strictly proper controller of the plant's order is an
    observer in suitable coordinates, so central H-infinity controllers from two Riccati equations
    (and LQG designs) are rewritten as F and L, and the true norm is then lowered over F and L
    by descents.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous or discrete, with any D; in discrete time the observer predicts.
    norm : {"hinf", "h2"}
        The norm from w to z; "h2" gives the LQG controller.
    time_limit : float
        In s, for the whole call.
    seed : int
        Of the random starts.
    gain_bound : float, optional
        Largest singular value of the controller at any frequency, in the plant's units; the
        controller is then held stable by itself.
    control_weight : float or array_like, shape (nu,), optional
        Price on u: ``control_weight`` times u joins z. In units of z per unit of u.
    measurement_noise : float or array_like, shape (ny,), optional
        Noise on y as additional disturbances, in units of y per unit of w.
    target : float
        Stop as soon as the norm is below, in the plant's units.

    Returns
    -------
    Design
        ``details`` holds ``state_feedback`` (F, shape (nu, nx)), ``observer_gain`` (L, shape
        (nx, ny)), ``feedback_poles`` (of A + B2 F) and ``observer_poles`` (of A - L C2), in
        rad/s, and ``plain_norm``, without price and noise. The status is as in
        :func:`static_output_feedback`.

    Raises
    ------
    InvalidInputError
        If an argument does not fit the plant.
    InfeasibleError
        If an unstable mode cannot be moved; it is named.
    SolverError
        If no certified controller was found.

    References
    ----------
    M.L. Postma, Polishing robot: vibrations due to impact, (10.63) to (10.74). Alazard and
    Apkarian, "Exact observer-based structures for arbitrary compensators", IJRNC 9 (1999).

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
    ...     D12=[[0.0], [1.0]], D21=[[0.0, 1.0]],
    ... )
    >>> design = rp.observer_feedback(plant, "h2")
    >>> design.details["observer_gain"].round(3)  # 1 + sqrt(2), the Kalman gain
    array([[2.414]])
    """
    began = time.monotonic()
    one_of("norm", norm, ("hinf", "h2"))
    time_limit = positive("time_limit", time_limit, "s")
    if gain_bound is not None:
        gain_bound = positive("gain_bound", gain_bound)
    target = positive("target", target, zero=True)
    whole = noisy(priced(plant, control_weight), measurement_noise)

    parts = decoupled_parts(whole)
    tasks = [_task(part, norm, gain_bound) for part in parts]
    designs = design_parts(tasks, search_deadline(whole, began, time_limit), seed, target)
    F, L = np.zeros((plant.nu, plant.nx)), np.zeros((plant.nx, plant.ny))
    for part, found in zip(parts, designs, strict=True):
        if found is not None:
            own_F, own_L = gains(scale_plant(part.plant), found.point)
            F[np.ix_(part.controls, part.states)] = own_F
            L[np.ix_(part.states, part.measurements)] = own_L
    return certified_design(
        plant,
        whole,
        observer_controller(plant, F, L),
        norm,
        [found for found in designs if found is not None],
        "observer",
        began,
        {
            "state_feedback": F,
            "observer_gain": L,
            "feedback_poles": np.linalg.eigvals(plant.A + plant.B2 @ F),
            "observer_poles": np.linalg.eigvals(plant.A - L @ plant.C2),
        },
    )


def observer_controller(plant: GeneralizedPlant, F: ArrayLike, L: ArrayLike) -> control.StateSpace:
    """Return the observer (10.63) with u = F xhat as a controller u = K y.

    Parameters
    ----------
    plant : GeneralizedPlant
    F : array_like, shape (nu, nx)
        State feedback, the thesis's D_c.
    L : array_like, shape (nx, ny)
        Observer gain, the thesis's C_c.

    Returns
    -------
    control.StateSpace
        Its states are the estimates, named after the plant's states with ``_hat``.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> K = rp.observer_controller(plant, [[-3.0]], [[4.0]])
    >>> sorted(plant.closed_loop(K).poles().real.round(9).tolist())
    [-3.0, -2.0]
    """
    F = matrix("F", F, (plant.nu, plant.nx))
    L = matrix("L", L, (plant.nx, plant.ny))
    return control.StateSpace(
        plant.A + plant.B2 @ F - L @ (plant.C2 + plant.D22 @ F),
        L,
        F,
        np.zeros((plant.nu, plant.ny)),
        plant.dt,
        inputs=list(plant.measurement_names),
        outputs=list(plant.control_names),
        states=[f"{name}_hat" for name in plant.states],
        remove_useless_states=False,
    )


def _task(part: PlantPart, norm: Norm, gain_bound: float | None) -> PartTask | None:
    plant = part.plant
    if plant.nx == 0 or plant.nu == 0 or plant.ny == 0:
        refuse_unstable(plant)
        return None
    return PartTask(plant, lambda: observer_setting(plant, norm, gain_bound))
