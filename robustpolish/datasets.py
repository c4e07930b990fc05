"""Records that come with the package, to try models on.

What was measured keeps the licences of those who measured it, which lie beside the files.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.base.checks import described, invalid, one_of
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring

__all__ = [
    "friction_damper",
    "magnetic_beam",
    "mr_damper",
    "pendulum_decay",
    "sticky_slide",
]

# The files beside this module, and how they become datasets.


def load_arrays(name: str) -> dict[str, NDArray[Any]]:
    """Return the arrays of a file of this folder."""
    with (
        files("robustpolish").joinpath("data", name).open("rb") as file,
        np.load(file, allow_pickle=False) as archive,
    ):
        return {key: archive[key] for key in archive.files}


def dataset(
    columns: Mapping[str, tuple[NDArray[np.float64], str]], sampling_rate: float, source: str
) -> xr.Dataset:
    """Return columns, each with its unit, over time from 0 in s."""
    length = len(next(iter(columns.values()))[0])
    time = np.arange(length) / sampling_rate
    return xr.Dataset(
        {name: ("time", values, {"units": unit}) for name, (values, unit) in columns.items()},
        coords={"time": ("time", time, {"units": "s"})},
        attrs={"source": source},
    )


# A rotary friction damper with a clearance, moved to and fro.

_DAMPER_RATE = 1024.0
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
    arrays = load_arrays("friction_damper.npz")
    name = f"{frequency:g}Hz{amplitude:g}in"
    if name not in arrays:
        listed = ", ".join(key.replace("Hz", " Hz ").replace("in", " inch") for key in arrays)
        shown, want = described(f"{frequency:g} Hz, {amplitude:g} inch"), f"one of {listed}"
        raise invalid("frequency, amplitude", shown, want, "Choose one of these tests.")
    columns = {
        column: (count * values.astype(float), unit)
        for (column, (count, unit)), values in zip(_COUNTS.items(), arrays[name], strict=True)
    }
    source = "Coble, Huggins, Cao, Ricles and Downey (2022)"
    where = "https://github.com/ARTS-Laboratory/Dataset-Friction-Damper-with-Backlash"
    return dataset(columns, _DAMPER_RATE, f"{source}, {where}, CC BY-SA 4.0")


# A beam that swings freely in a magnetic field.

_BEAM_RATE = 1000.0


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
    arrays = load_arrays("magnetic_beam.npz")
    return dataset(
        {name: (np.asarray(arrays[name], dtype=float), "1") for name in arrays},
        _BEAM_RATE,
        "Breunung and Balachandran, J. Sound Vib. 118651 (2024), "
        "https://github.com/tbreunung/FrID, MIT licence",
    )


# A magnetorheological damper without voltage, moved to and fro.

_MR_DAMPER_RATE = 100.0
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
    arrays = load_arrays("mr_damper.npz")
    return dataset(
        {name: (np.asarray(arrays[name], dtype=float), unit) for name, unit in _UNITS.items()},
        _MR_DAMPER_RATE,
        "Labcontrol, UTFPR; Vargas and others, Sensors 22(10), 3644 (2022), "
        "https://github.com/labcontrol-data/mr-damper, MIT licence",
    )


# A pendulum that swings freely and comes to rest.

_PENDULUM_RATE = 100.0
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
    arrays = load_arrays("pendulum_decay.npz")
    theta = arrays[one_of("part", part, _PARTS)]
    return dataset(
        {"theta": (np.asarray(theta, dtype=float), "rad")},
        _PENDULUM_RATE,
        "Kaheman, Fasel, Bramburger, Strom, Kutz and Brunton, HardwareX 15, e00465 (2023), "
        "https://github.com/dynamicslab/MultiArm-Pendulum, MIT licence",
    )


# A simulated slide with an effect that its model does not know.

_RATE, _SAMPLES = 1000.0, 2000
_FRICTION = 3.0


def sticky_slide() -> tuple[MechanicalModel, xr.Dataset]:
    """Return the model of a slide on a spring, and a record of the slide as it is: with friction.

    A small case to try things on: a diagnosis finds the friction of 3 N in some seconds. The
    record is simulated and always the same.

    Returns
    -------
    model : MechanicalModel
        2 kg on 80 kN/m with 12 N s/m, driven by ``F``; without friction.
    data : xarray.Dataset
        Force ``F`` in N and displacement ``x`` in m over ``time`` in s, 2 s at 1 kHz, with noise
        of 1 um.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> rp.compare(model, data).fit_percent < 50
    True
    """
    place = ("x", "ground")
    model = MechanicalModel(
        (Dof("x", 2.0),), (Spring(place, 8e4),), (Damper(place, 12.0),), (Input("F", place),),
        (Output("x", place),), name="slide",
    )  # fmt: skip
    random = np.random.default_rng(1)
    # The force is held from sample to sample, and slow enough for that.
    force = 40 * np.convolve(random.standard_normal(_SAMPLES + 7), np.ones(8) / 8, "valid")
    data = dataset({"F": (force, "N")}, _RATE, "simulated: the model with dry friction")
    truth = model.with_effect("coulomb_friction", place, {"force": _FRICTION})
    from robustpolish.machines.simulation import simulate_model  # imports Numba

    motion = simulate_model(truth, data).outputs[:, 0]
    data["x"] = ("time", motion + 1e-6 * random.standard_normal(_SAMPLES), {"units": "m"})
    return model, data
