"""Static and fixed-order output feedback on the true norm, with a prescribed sparsity."""

from __future__ import annotations

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.long_calls import same_bits
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.design.design import Design
from robustpolish.synthesis.methods.fixed_order import checked_order
from robustpolish.synthesis.methods.structured_design import (
    Orders,
    checked_bound,
    design_structured,
)
from robustpolish.synthesis.problem.decoupling import decoupled_parts, undivided
from robustpolish.synthesis.problem.preflight import noisy, priced
from robustpolish.synthesis.structured_search.policy import TIME_LIMIT
from robustpolish.synthesis.structured_search.static_structure import StaticStructure
from robustpolish.synthesis.structured_search.structure import Norm
from robustpolish.validation import described, invalid


@same_bits
def static_output_feedback(
    plant: GeneralizedPlant,
    norm: Norm = "hinf",
    structure: ArrayLike | None = None,
    order: int = 0,
    *,
    time_limit: float = TIME_LIMIT,
    initial: control.StateSpace | ArrayLike | None = None,
    seed: int = 0,
    gain_bound: float | None = None,
    control_weight: ArrayLike | None = None,
    measurement_noise: ArrayLike | None = None,
    target: float = 0.0,
) -> Design:
    r"""Design u = F y, or a dynamic controller of a given order, for the true norm.

    The problem is not convex: linear matrix inequalities only find a start. From several
    starts the norm itself is then lowered, first by BFGS, then by a bundle method that
    sees all peaks of the singular values at once, until the descents agree or the work is
    done. What is returned is a local minimum, certified; no method at hand can tell whether it
    is global.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous or discrete, with any D.
    norm : {"hinf", "h2"}
        The norm from w to z.
    structure : array_like of bool, shape (nu, ny), optional
        True where F may differ from zero. Without it F is free within each decoupled part of
        the plant and zero between them; pass ``np.ones((nu, ny))`` to join the parts.
        For ``order > 0`` the shape is (order + nu, order + ny), for [[Ak, Bk], [Ck, Dk]].
    order : int
        States of the controller for each decoupled part; 0 is static. Without a `structure`
        :func:`robustpolish.output_feedback` with ``order=`` is the way: it also starts from what
        full order reaches and says how far from it the result is.
    time_limit : float
        Safety net in s for search and certificate; the work of the search is limited otherwise. The
        status says if it was reached, an error if no certificate was complete in time.
    initial : array_like or control.StateSpace, optional
        A controller to start from, stabilising or not: F, or a system of the given order.
    seed : int
        Of the random starts; the same seed gives the same result unless time runs out.
    gain_bound : float, optional
        Largest singular value allowed for F, in the plant's units. A dynamic controller is
        held stable and bounded at all frequencies.
    control_weight : float or array_like, shape (nu,), optional
        Price on u: ``control_weight`` times u joins z. In units of z per unit of u.
    measurement_noise : float or array_like, shape (ny,), optional
        Noise on y as additional disturbances, in units of y per unit of w. A price on u
        bounds u, not the gain; noise bounds the gain.
    target : float
        Stop as soon as the norm is below, in the plant's units.

    Returns
    -------
    Design
        With status "suboptimal" (a local minimum, as the message says),
        "infimum_not_attained" (the norm keeps falling as the gain grows) or "time_limit".
        Its plant includes price and noise; ``details["plain_norm"]`` is the norm of the loop
        with the plant as it was given.

    Raises
    ------
    InvalidInputError
        If an argument does not fit the plant.
    InfeasibleError
        If an unstable mode cannot be moved by any gain of the structure; it is named.
    SolverError
        If no stabilising gain was found, which proves nothing.

    References
    ----------
    Apkarian and Noll, "Nonsmooth H-infinity synthesis", IEEE TAC 51 (2006). Burke, Henrion,
    Lewis and Overton, "HIFOO", ROCOND 2006. El Ghaoui, Oustry and AitRami, IEEE TAC 42 (1997).

    Examples
    --------
    The more gain, the lower the norm, so that the bound decides:

    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> design = rp.static_output_feedback(plant, gain_bound=3.0)
    >>> design.gain.round(3), round(design.certificate.achieved, 3)
    (array([[-3.]]), 0.5)
    """
    orders = Orders.checked(norm, time_limit, seed, target)
    order = checked_order(order)
    mask = None if structure is None else checked_structure(structure, order, plant.nu, plant.ny)
    start = _initial(initial, order, plant)
    whole = noisy(priced(plant, control_weight), measurement_noise)

    joined = order > 0 and (mask is not None or start is not None)
    parts = (undivided(whole),) if joined else decoupled_parts(whole, mask)
    asked = StaticStructure(norm, order, mask, checked_bound(gain_bound), start)
    return design_structured(plant, whole, parts, asked, norm, orders)


def checked_structure(structure: ArrayLike, order: int, nu: int, ny: int) -> NDArray[np.bool_]:
    """Return which entries of [[Ak, Bk], [Ck, Dk]] are free, refused in a wrong shape."""
    shape = (order + nu, order + ny)
    mask = np.asarray(structure)
    known = mask.dtype == bool or (mask.dtype.kind in "iuf" and np.isin(mask, (0, 1)).all())
    if mask.shape != shape or not known:
        sizes = f"{nu} controls by {ny} measurements"
        remedy = "Mark the entries of u = K y that may differ from zero."
        if order:
            sizes += f", after {order} rows and columns for the controller's states"
            remedy = "Mark the entries of [[Ak, Bk], [Ck, Dk]] that may differ from zero."
        shown = described(f"shape {mask.shape}, entries {mask.dtype}")
        raise invalid("structure", shown, f"booleans of shape {shape}: {sizes}", remedy)
    return mask.astype(bool)


def _initial(
    initial: control.StateSpace | ArrayLike | None, order: int, plant: GeneralizedPlant
) -> control.StateSpace | None:
    if initial is None:
        return None
    if not isinstance(initial, control.StateSpace):
        initial = control.StateSpace([], [], [], np.asarray(initial, dtype=float), plant.dt)
    shape = (initial.noutputs, initial.ninputs, initial.nstates)
    if shape != (plant.nu, plant.ny, order):
        raise invalid(
            "initial",
            described(f"{shape[0]} outputs, {shape[1]} inputs and {shape[2]} states"),
            f"{plant.nu} outputs, {plant.ny} inputs and {order} states",
            "Match the plant and order.",
        )
    return initial
