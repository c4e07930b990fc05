"""The air bearing with its brush as twelve states in three decoupled axes."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.linalg import block_diag

from robustpolish.arrays import Matrix
from robustpolish.models.machines.air_bearing_parameters import AirBearingParameters
from robustpolish.models.plant.plant import GeneralizedPlant
from robustpolish.validation import instance_of, one_of

COORDINATES = ("x_m", "x", "y_m", "y", "z_m", "z")
FORCES = ("F_x", "F_y", "F_z", "F_p")


def air_bearing(
    parameters: AirBearingParameters | None = None,
    dissipation: float = 0.001,
    actuation: Literal["displacement", "force"] = "displacement",
    measured: Literal["state", "displacement"] = "state",
    load: Literal["corrected", "printed"] = "corrected",
) -> GeneralizedPlant:
    """Build the thesis's air-bearing model, (8.46), as a generalised plant.

    Each direction is a chain ground, bearing (x_m, y_m, z_m), brush (x, y, z); the states are
    (x_m, dx_m, x, dx, y_m, ...), displacements in m and velocities in m/s.

    Parameters
    ----------
    parameters : AirBearingParameters, optional
        :meth:`AirBearingParameters.as_published` by default.
    dissipation : float, optional
        Share of the energy lost per cycle, (8.23); 0 gives the undamped model (8.45).
    actuation : {"displacement", "force"}, optional
        Where u enters: into the six displacement equations, in m/s (10.40), or as six forces
        on bearing and brush, in N (10.41).
    measured : {"state", "displacement"}, optional
        y: the twelve states, C = I, or the six displacements (10.75).
    load : {"corrected", "printed"}, optional
        How w enters: (8.47) by default, or (10.39) as printed, where F_x drives y and F_y
        drives x; only for comparison with the thesis's tables.

    Returns
    -------
    GeneralizedPlant
        w = (F_x, F_y, F_z, F_p) in N, z = the six displacements in m. F_x, F_y and F_p act
        against their coordinate, F_z along it.

    Raises
    ------
    InvalidInputError
        If an option is unknown or a value is not physical.

    References
    ----------
    M.L. Postma, Polishing robot: vibrations due to impact, equations (8.45) to (8.47),
    (10.38) to (10.42) and (10.75).

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.air_bearing(actuation="force")
    >>> plant.nx, plant.nw, plant.nu, plant.nz, plant.ny
    (12, 4, 6, 6, 12)
    """
    p = AirBearingParameters() if parameters is None else parameters
    remedy = "Build them with AirBearingParameters(...)."
    instance_of("parameters", p, AirBearingParameters, "AirBearingParameters", remedy)
    one_of("actuation", actuation, ("displacement", "force"))
    one_of("measured", measured, ("state", "displacement"))
    one_of("load", load, ("corrected", "printed"))

    c = p.damping(dissipation)
    horizontal = _axis(p.m_x, p.m_t, p.k_t, p.k_x, c.c_A, c.c_D, 0.0)
    vertical = _axis(p.m_z, p.m_t, p.k_A, p.k_z, 0.0, c.c_R, c.c_Z)
    A = np.asarray(block_diag(horizontal, horizontal, vertical))
    position = np.zeros((6, 12))
    position[range(6), range(0, 12, 2)] = 1.0
    masses = np.array([p.m_x, p.m_t, p.m_x, p.m_t, p.m_z, p.m_t])
    B2 = position.T if actuation == "displacement" else np.roll(position, 1, axis=1).T / masses

    states = [name for q in COORDINATES for name in (q, f"d{q}")]
    measurements = states if measured == "state" else COORDINATES
    control_unit = "m/s" if actuation == "displacement" else "N"
    units = {name: "m/s" if name.startswith("d") else "m" for name in states}
    units |= {f"measured_{name}": units[name] for name in measurements}
    units |= dict.fromkeys(FORCES, "N")
    units |= {f"u_{q}": control_unit for q in COORDINATES}
    return GeneralizedPlant.from_matrices(
        A,
        _load_matrix(p, load),
        B2,
        position,
        np.eye(12) if measured == "state" else position,
        states=states,
        disturbances=FORCES,
        controls=[f"u_{q}" for q in COORDINATES],
        performance=COORDINATES,
        measurements=[f"measured_{name}" for name in measurements],
        units=units,
    )


def _axis(
    mass_m: float, mass: float, k_ground: float, k: float, c_ground: float, c: float, c_tip: float
) -> Matrix:
    """State matrix of one direction, states (q_m, dq_m, q, dq)."""
    return np.array(
        [
            [0, 1, 0, 0],
            [-(k_ground + k) / mass_m, -(c_ground + c) / mass_m, k / mass_m, c / mass_m],
            [0, 0, 0, 1],
            [k / mass, c / mass, -k / mass, -(c + c_tip) / mass],
        ]
    )


def _load_matrix(p: AirBearingParameters, load: str) -> Matrix:
    """B1, shape (12, 4): rows dx, dy, dz_m and dz of (8.47)."""
    B1 = np.zeros((12, 4))
    F_x, F_y, F_z, F_p = range(4)
    dx, dy, dz_m, dz = 3, 7, 9, 11
    if load == "printed":
        F_x, F_y = F_y, F_x
    B1[dx, F_x] = B1[dy, F_y] = -1 / p.m_t
    B1[dz, F_z] = 1 / p.m_t
    B1[dz_m, F_p] = -1 / p.m_z
    return B1
