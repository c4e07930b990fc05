"""State feedback of an observer's estimate, designed for the norm of the whole loop."""

from __future__ import annotations

from numpy.typing import ArrayLike

from robustpolish.long_calls import same_bits
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.design.design import Design
from robustpolish.synthesis.methods.structured_design import (
    Orders,
    checked_bound,
    design_structured,
)
from robustpolish.synthesis.problem.decoupling import decoupled_parts
from robustpolish.synthesis.problem.preflight import noisy, priced
from robustpolish.synthesis.structured_search.observer_structure import ObserverStructure
from robustpolish.synthesis.structured_search.policy import TIME_LIMIT
from robustpolish.synthesis.structured_search.structure import Norm


@same_bits
def observer_feedback(
    plant: GeneralizedPlant,
    norm: Norm = "hinf",
    *,
    time_limit: float = TIME_LIMIT,
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
        Safety net in s for search and certificate; the work of the search is limited otherwise. The
        status says if it was reached, an error if no certificate was complete in time.
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
    orders = Orders.checked(norm, time_limit, seed, target)
    whole = noisy(priced(plant, control_weight), measurement_noise)
    structure = ObserverStructure(norm, checked_bound(gain_bound))
    return design_structured(plant, whole, decoupled_parts(whole), structure, norm, orders)
