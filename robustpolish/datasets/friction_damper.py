"""A rotary friction damper with a clearance, moved to and fro."""

from __future__ import annotations

import xarray as xr

from robustpolish.datasets.stored import dataset, stored
from robustpolish.validation import described, invalid

_SAMPLING_RATE = 1024.0
# What one count of the stored integers means; all far below the noise of the sensors.
_COUNTS = {"x": (2e-6, "m"), "v": (1e-5, "m/s"), "F": (1.0, "N")}


def friction_damper(frequency: float = 1.0, amplitude: float = 1.5) -> xr.Dataset:
    """Return a test of a banded rotary friction device: imposed motion, measured force.

    The friction has memory (it sticks elastically before it slips), and a few millimetres of
    clearance are passed at each reversal. It is usual to fit to the tests (1 Hz, 1.5) and
    (0.5 Hz, 0.5), and to judge by the other three.

    Parameters
    ----------
    frequency : float
        Of the motion in Hz: 1 or 0.5.
    amplitude : float
        Nominal amplitude in inch: 0.5, 1 or 1.5, measured about 12.8, 25.6 and 36.7 mm. There is
        no test with 1.5 at 0.5 Hz.

    Returns
    -------
    xarray.Dataset
        Displacement ``x`` in m, velocity ``v`` in m/s and force ``F`` in N over ``time`` in s,
        1024 Hz, 7 s at 1 Hz and 14 s at 0.5 Hz. A positive force pulls against a positive velocity.

    Raises
    ------
    InvalidInputError
        If there is no such test.

    Notes
    -----
    Measured by Coble, Huggins, Cao, Ricles and Downey [1]_, tests of dataset 2 with a band tension
    of 36 lb (commit 0e09aa9), licensed under Creative Commons Attribution-ShareAlike 4.0. Changes:
    converted to SI units, three channels kept, rounded to 2 um, 10 um/s and 1 N. The licence lies
    beside the file, and holds for copies of these records too.

    References
    ----------
    .. [1] D. Coble, P. Huggins, L. Cao, J. Ricles and A. Downey,
       Dataset-Friction-Damper-with-Backlash, 2022,
       https://github.com/ARTS-Laboratory/Dataset-Friction-Damper-with-Backlash.

    Examples
    --------
    >>> import robustpolish as rp
    >>> test = rp.datasets.friction_damper(frequency=1.0, amplitude=0.5)
    >>> print(f"{float(abs(test['F']).max()):.0f} {test['F'].attrs['units']}")
    25518 N
    """
    arrays = stored("friction_damper.npz")
    name = f"{frequency:g}Hz{amplitude:g}in"
    if name not in arrays:
        listed = ", ".join(key.replace("Hz", " Hz ").replace("in", " inch") for key in arrays)
        raise invalid(
            "frequency, amplitude",
            described(f"{frequency:g} Hz, {amplitude:g} inch"),
            f"one of the tests {listed}",
            "Choose one of them.",
        )
    columns = {
        column: (count * values.astype(float), unit)
        for (column, (count, unit)), values in zip(_COUNTS.items(), arrays[name], strict=True)
    }
    return dataset(
        columns,
        _SAMPLING_RATE,
        "Coble, Huggins, Cao, Ricles and Downey (2022), "
        "https://github.com/ARTS-Laboratory/Dataset-Friction-Damper-with-Backlash, CC BY-SA 4.0",
    )
