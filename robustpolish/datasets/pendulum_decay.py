"""A pendulum that swings freely and comes to rest."""

from __future__ import annotations

import numpy as np
import xarray as xr

from robustpolish.datasets.stored import dataset, stored
from robustpolish.validation import one_of

_SAMPLING_RATE = 100.0
_PARTS = ("first", "rest")


def pendulum_decay(part: str = "first") -> xr.Dataset:
    """Return the free decay of a single pendulum from 1.6 rad, in two parts.

    Nothing drives it. At large angles gravity is no spring any more, and bearing friction and air
    take the energy out. It is usual to fit to the first part, from 1.62 to 0.56 rad, and to judge
    by the rest, down to 0.25 rad.

    Parameters
    ----------
    part : {"first", "rest"}, optional
        The first 36.7 s, or the 18.3 s that follow.

    Returns
    -------
    xarray.Dataset
        Angle ``theta`` in rad from hanging down over ``time`` in s, 100 Hz; the first sample of
        either part is at 0.

    Raises
    ------
    InvalidInputError
        If there is no such part.

    Notes
    -----
    Measured by Kaheman, Fasel, Bramburger, Strom, Kutz and Brunton [1]_,
    https://github.com/dynamicslab/MultiArm-Pendulum (commit e99a7e1), MIT licence. Changes:
    resampled to 100 Hz in two parts, which do not share one grid of time (about 8 ms instead of 10
    lie between them), and rounded to single precision. The licence lies beside the file.

    References
    ----------
    .. [1] K. Kaheman, U. Fasel, J.J. Bramburger, B. Strom, J.N. Kutz and S.L. Brunton, The
       experimental multi-arm pendulum on a cart: A benchmark system for chaos, learning, and
       control, HardwareX 15, e00465, 2023, https://doi.org/10.1016/j.ohx.2023.e00465.

    Examples
    --------
    >>> import robustpolish as rp
    >>> swing = rp.datasets.pendulum_decay()
    >>> print(f"{float(abs(swing['theta']).max()):.2f} {swing['theta'].attrs['units']}")
    1.62 rad
    """
    arrays = stored("pendulum_decay.npz")
    theta = arrays[one_of("part", part, _PARTS)]
    return dataset(
        {"theta": (np.asarray(theta, dtype=float), "rad")},
        _SAMPLING_RATE,
        "Kaheman, Fasel, Bramburger, Strom, Kutz and Brunton, HardwareX 15, e00465 (2023), "
        "https://github.com/dynamicslab/MultiArm-Pendulum, MIT licence",
    )
