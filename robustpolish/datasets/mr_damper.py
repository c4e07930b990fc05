"""A magnetorheological damper without voltage, moved to and fro."""

from __future__ import annotations

import numpy as np
import xarray as xr

from robustpolish.datasets.stored import dataset, stored

_SAMPLING_RATE = 100.0
_UNITS = {"x": "m", "v": "m/s", "F": "N"}


def mr_damper() -> xr.Dataset:
    """Return a test of a magnetorheological damper: imposed motion, measured force.

    A small damper on a shaking table, without voltage, moved by 12 mm about once in 1.2 s. Beside
    the fluid's damping there is friction with a memory. It is usual to fit to the first 9.4 s and
    to judge by the 4 s that follow.

    Returns
    -------
    xarray.Dataset
        Displacement ``x`` in m, velocity ``v`` in m/s and force ``F`` in N over ``time`` in s,
        100 Hz, 13.4 s. A positive force pulls against a positive velocity.

    Notes
    -----
    Measured at Labcontrol, Universidade Tecnologica Federal do Parana, on the shaking table that
    Vargas and others describe [1]_, https://github.com/labcontrol-data/mr-damper (commit e42439f),
    MIT licence. Changes: three channels of one test in SI units, rounded to single precision. The
    licence lies beside the file.

    References
    ----------
    .. [1] A.N. Vargas, J.G. Raminelli, M.A.F. Montezuma, A.A. Cavalini Junior, R. Breganon and
       C.F. Caruntu, Shaking table attached to magnetorheological damper: Simulation and experiments
       for structural engineering, Sensors 22(10), 3644, 2022, https://doi.org/10.3390/s22103644.

    Examples
    --------
    >>> import robustpolish as rp
    >>> test = rp.datasets.mr_damper()
    >>> print(f"{float(abs(test['F']).max()):.0f} {test['F'].attrs['units']}")
    140 N
    """
    arrays = stored("mr_damper.npz")
    return dataset(
        {name: (np.asarray(arrays[name], dtype=float), unit) for name, unit in _UNITS.items()},
        _SAMPLING_RATE,
        "Labcontrol, UTFPR; Vargas and others, Sensors 22(10), 3644 (2022), "
        "https://github.com/labcontrol-data/mr-damper, MIT licence",
    )
