"""A beam that swings freely in a magnetic field."""

from __future__ import annotations

import numpy as np
import xarray as xr

from robustpolish.datasets.stored import dataset, stored

_SAMPLING_RATE = 1000.0


def magnetic_beam() -> xr.Dataset:
    """Return 3.5 s of the free decay of a cantilever beam with magnets at its tip.

    The shaker has stopped before; nothing drives the beam. Its stiffness grows with the
    amplitude: 41.0 Hz at 179 microstrain, 36.9 Hz at 10. It is usual to fit to the first second and
    to judge by the 2.5 s that follow.

    Returns
    -------
    xarray.Dataset
        ``strain_beam`` and ``strain_clamp_beam`` (of the neighbouring beam in the clamp), both
        without dimension (unit "1"), over ``time`` in s, 1 kHz. The first sample is at 0.

    Notes
    -----
    Measured by Breunung and Balachandran [1]_; the record is decay_f_42p05_ampl_2p0_0 of
    https://github.com/tbreunung/FrID (commit 50b803c), MIT licence, cut to the samples from
    12.18 s to 15.68 s. The licence lies beside the file.

    References
    ----------
    .. [1] T. Breunung and B. Balachandran, Frequency response based identification of nonlinear
       oscillators, J. Sound Vib., 118651, 2024, https://doi.org/10.1016/j.jsv.2024.118651.

    Examples
    --------
    >>> import robustpolish as rp
    >>> beam = rp.datasets.magnetic_beam()
    >>> beam.sizes["time"], beam["strain_beam"].attrs["units"]
    (3500, '1')
    """
    arrays = stored("magnetic_beam.npz")
    return dataset(
        {name: (np.asarray(arrays[name], dtype=float), "1") for name in arrays},
        _SAMPLING_RATE,
        "Breunung and Balachandran, J. Sound Vib. 118651 (2024), "
        "https://github.com/tbreunung/FrID, MIT licence",
    )
