"""The controllers that the thesis prints in appendix C, in physical units.

The numbers are those of M.L. Postma, Polishing robot: vibrations due to impact. C.1 and C.2
minimise the H2 norm, the others the H-infinity norm; C.1 to C.4 belong to the actuation
"displacement" (10.40), C.5 and C.6 to "force" (10.41).
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from robustpolish.base.checks import one_of

Block = tuple[tuple[float, float, float, float], tuple[float, float, float, float]]

# Per axis a 2 x 4 block: controls at bearing and brush, states (q_m, dq_m, q, dq).
_BLOCKS: Mapping[str, tuple[Block, Block, Block]] = {
    "first_h2": (
        (
            (-2.1030e17, 2.0970e9, 3.0127e17, 4.3969e8),
            (2.9994e17, -2.9909e9, -5.6768e17, 3.8381e8),
        ),
        (
            (-2.1030e17, 2.0970e9, 3.0127e17, 4.3969e8),
            (-2.9994e17, -2.9909e9, -5.6768e17, 3.8381e8),
        ),
        (
            (-4.5023e16, 1.7683e8, 1.6719e16, 4.5613e7),
            (1.6744e16, -1.7638e7, -9.6861e16, 3.9255e8),
        ),
    ),
    "first_h2_scaled": (
        (
            (-1.3559e12, 2.9271e5, 1.1746e11, 2.1971e6),
            (-6.8568e9, 1.0562e5, -2.1865e13, 9.4967e5),
        ),
        (
            (-1.3559e12, 2.9271e5, 1.1746e11, 2.1971e6),
            (-6.8568e9, 1.0562e5, -2.1865e13, 9.4967e5),
        ),
        (
            (-1.3346e12, 1.1758e7, 3.8282e8, 4.3916e6),
            (-5.5072e7, 4.7306e5, -5.3423e12, 3.1032e5),
        ),
    ),
    "first": (
        ((-1.7760e6, 7.1658e2, 4.8323e3, -0.6122), (4.8322e3, -1.7826, -3.0898e4, 1.4777e2)),
        ((-1.7760e6, 7.1658e2, 4.8323e3, -0.6122), (4.8322e3, -1.7826, -3.0898e4, 1.4777e2)),
        ((-4.3132e6, 7.4990e2, 2.8127e5, -48.0846), (2.8169e5, 15.5677, -7.6372e5, 6.3364e2)),
    ),
    "first_scaled": (
        ((-5.3415, -0.0758, 0.4234, -0.0556), (0.0564, -0.1047, -44.1852, -3.7897)),
        ((-5.3415, -0.0758, 0.4234, -0.0556), (0.0564, -0.1047, -44.1852, -3.7897)),
        ((-5.6772, -0.1203, -0.0041, -0.0811), (-0.0204, -0.1220, -16.1900, -0.1105)),
    ),
    "second": (
        ((9.0544e7, 0.3096, 1.8918e5, -0.2062), (8.9506e6, -4.4892, -3.2651e6, -17.2076)),
        ((9.0544e7, 0.3096, 1.8918e5, -0.2062), (8.9506e6, -4.4892, -3.2651e6, -17.2076)),
        ((2.1167e8, -18.0526, 6.5185e7, -13.4988), (5.6515e8, -46.9699, -5.1039e7, -36.6347)),
    ),
    "second_scaled": (
        ((-4.3912e-5, -0.1127, -0.0029, -0.5432), (0.0027, -2.2877, -0.9858, -191.9876)),
        ((-4.1680e-5, -0.1095, -0.0019, -0.5654), (0.0035, -1.1354, -0.6822, -200.3145)),
        ((3.9457e-5, -0.5892, -1.5791e-4, -0.3606), (6.6238e-4, -1.8623, -0.0011, -4.0172)),
    ),
}

# diag(T_L) of (10.52) and (10.56); scaled controllers go back by D_c = D_c^s T_L, (10.60).
_SCALING = {
    "first": (256, 7.8125e-3, 64, 6.25e-2) * 2 + (256, 3.9063e-3, 128, 7.8125e-3),
    "second": (4096, 0.125, 1024, 1, 4096, 0.125, 1024, 0.5, 8192, 0.125, 4096, 0.25),
}

PUBLISHED_CONTROLLERS: Mapping[str, str] = MappingProxyType(
    {
        "first_h2": "C.1",
        "first_h2_scaled": "C.2",
        "first": "C.3",
        "first_scaled": "C.4",
        "second": "C.5",
        "second_scaled": "C.6",
    }
)
"""Names of the controllers and their numbers in appendix C."""

PUBLISHED_NORMS: Mapping[str, float] = MappingProxyType(
    {"first": 3.4459e-6, "first_scaled": 5.0011e-6, "second": 6.5060e-5, "second_scaled": 5.3719e-5}
)
"""H-infinity norms [m/N] that sections 11.1.1 and 11.2.1 print: the solver's bounds."""


def published_gain(name: str) -> NDArray[np.float64]:
    """Return one of the printed state feedbacks.

    Parameters
    ----------
    name : str
        "first..." for displacement actuation, "second..." for force actuation; see
        `PUBLISHED_CONTROLLERS`. A scaled one is mapped back to physical units by (10.60).

    Returns
    -------
    ndarray, shape (6, 12)
        D_c in u = D_c x, for the plant of :func:`robustpolish.air_bearing`.

    Raises
    ------
    InvalidInputError
        If the name is unknown.

    Examples
    --------
    >>> import robustpolish as rp
    >>> from robustpolish.synthesis import published_gain
    >>> loop = rp.air_bearing().state_feedback_loop(published_gain("first_scaled"))
    >>> f"{rp.hinf_norm(loop).value:.4g}"
    '3.361e-06'
    """
    one_of("name", name, PUBLISHED_CONTROLLERS)
    gain: NDArray[np.float64] = np.asarray(block_diag(*_BLOCKS[name]), dtype=float)
    if name.endswith("_scaled"):
        gain = gain * np.array(_SCALING[name.split("_")[0]])
    return gain
