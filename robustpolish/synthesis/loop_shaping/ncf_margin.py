"""The normalised coprime stability margin of a loop."""

from __future__ import annotations

import math
from typing import Literal

import control

from robustpolish.analysis import hinf_norm
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.given_controller import GivenController, controller_system
from robustpolish.synthesis.certificate.exact_delays import exact_delays
from robustpolish.synthesis.loop_shaping.coprime import loop_plant
from robustpolish.validation import one_of


def ncf_margin(
    plant: GeneralizedPlant | control.StateSpace | control.TransferFunction,
    controller: GivenController,
    *,
    sign: Literal[1, -1] = 1,
) -> float:
    r"""Return how far a plant may move in the nu-gap without making its loop unstable.

    .. math:: b(G, K) = \left\| \begin{bmatrix} I \\ K \end{bmatrix} (I - G K)^{-1}
              \begin{bmatrix} I & G \end{bmatrix} \right\|_\infty^{-1}

    for a stable loop with u = K y, and 0 for all others. Values above 0.3 are good margins.

    Parameters
    ----------
    plant : GeneralizedPlant, control.StateSpace or control.TransferFunction
        G. Of a generalised plant, the part from its controls to its measurements; its delays count
        as they are.
    controller : control.StateSpace, control.TransferFunction or array_like
        K.
    sign : {1, -1}, optional
        1 for u = K y, the convention here; -1 for u = -K y, that of MATLAB's ``ncfmargin``.

    Returns
    -------
    float
        Between 0 and 1. It depends on the units of u and y, as all of loop shaping.

    Raises
    ------
    InvalidInputError
        If plant and controller do not fit, or the loop is not well posed.

    See Also
    --------
    nu_gap : how far two plants are apart.

    Notes
    -----
    Zhou, Doyle, "Essentials of Robust Control", 1998, chapter 16. Any plant within a nu-gap below
    b(G, K) is stabilised by the same controller.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> G = control.tf([4], [1, -0.001])
    >>> [round(rp.ncf_margin(G, k, sign=-1), 4) for k in (1.0, 10.0)]
    [0.7069, 0.0995]
    """
    one_of("sign", sign, (1, -1))
    loop = GeneralizedPlant.from_loop(loop_plant("plant", plant))
    K = controller_system(loop, controller)
    if sign == -1:
        K = -K
    if loop.wiring.lines:
        found = exact_delays(loop, K, "hinf")
        gain = None if found is None else found.gain
        return 1 / gain if gain else 0.0
    norm = hinf_norm(loop.closed_loop(K))
    return 1 / norm.value if norm.stable and math.isfinite(norm.value) else 0.0
