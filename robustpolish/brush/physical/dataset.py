"""A run of the physical simulator as labelled signals."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.brush.dataset import (
    POINTS,
    Variable,
    angle_variables,
    force_variables,
    labelled,
    parameter_attributes,
    path_variables,
    quantity,
)
from robustpolish.brush.parameters import BrushParameters
from robustpolish.brush.physical import disc_motion as disc
from robustpolish.brush.physical import rim_contact as rim
from robustpolish.brush.physical.angles import euler_angles, tilt_angles
from robustpolish.brush.physical.run import PhysicalRun, Refinement


def physical_dataset(
    run: PhysicalRun, check: Refinement, parameters: BrushParameters, three_angles: bool
) -> xr.Dataset:
    """Label a run, and tell in the attributes how it was checked."""
    variables = {
        **(_euler_variables(run) if three_angles else _tilt_variables(run)),
        **_force_variables(run, parameters),
        **_contact_variables(run.loads),
        "tool_z": quantity(run.track[:, disc.HEIGHT], "m", "height of the ball joint"),
        "tool_z_rate": quantity(run.track[:, disc.CLIMB], "m/s", "rate of the height"),
        **path_variables(run.time, parameters),
    }
    attributes = {
        "simulator": "physical",
        "disc": "three-angle" if three_angles else "two-angle",
        **parameter_attributes(parameters),
        "passes": check.passes,
        "impulse_error": check.impulse_error,
        "converged": int(check.converged),
        "largest_step": run.largest_step,
        "steps": run.steps,
        "refused_steps": run.refused,
        "rim_points": run.rim_points,
        "friction_heat": float(run.track[-1, disc.FRICTION_HEAT]),
        "damping_heat": float(run.track[-1, disc.DAMPING_HEAT]),
    }
    return labelled(run.time, variables, attributes)


def _tilt_variables(run: PhysicalRun) -> dict[str, Variable]:
    angles = tilt_angles(run.track[:, disc.AXES], run.track[:, disc.TURNINGS])
    return angle_variables(angles, ("tilt about x", "tilt about y"), level=0.0)


def _euler_variables(run: PhysicalRun) -> dict[str, Variable]:
    angles = euler_angles(run.track[:, disc.AXES], run.track[:, disc.TURNINGS])
    theta, psi, _, psi_rate = angles
    spin = run.track[:, disc.SPIN]
    precessed = np.cumsum(0.5 * np.diff(psi) * (np.cos(theta[1:]) + np.cos(theta[:-1])))
    phi = run.track[:, disc.TWIST] - np.concatenate([[0.0], precessed])
    return {
        **angle_variables(angles, ("nutation", "precession"), level=None),
        "phi": quantity(phi, "rad", "rotation of the tool about its axis"),
        "phi_rate": quantity(spin - psi_rate * np.cos(theta), "rad/s", "rate of phi"),
        "omega_z": quantity(spin, "rad/s", "angular velocity about the axis of the disc"),
    }


def _force_variables(run: PhysicalRun, parameters: BrushParameters) -> dict[str, Variable]:
    fx, fy, fz = run.forces.T
    pressing = np.full_like(fz, parameters.polishing_force)
    return force_variables({"F_x": -fx, "F_y": -fy, "F_z": fz, "F_p": pressing})


def _contact_variables(loads: NDArray[np.float64]) -> dict[str, Variable]:
    normal = loads[:, rim.SECTORS : rim.SECTORS + len(POINTS)]
    both = ("time", "point")
    friction, damping = loads[:, rim.FRICTION_POWER], loads[:, rim.DAMPING_POWER]
    return {
        "contact": quantity(normal > 0.0, "1", "whether the quarter of the rim touches", both),
        "contact_force": quantity(normal, "N", "normal force on the quarter of the rim", both),
        "contact_share": quantity(loads[:, 0], "1", "share of the rim that touches"),
        "contact_energy": quantity(loads[:, rim.ENERGY], "J", "energy stored in the contact"),
        "friction_power": quantity(friction, "W", "power that friction turns into heat"),
        "damping_power": quantity(damping, "W", "power that contact damping turns into heat"),
    }
