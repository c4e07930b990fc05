"""A coupled run: where the brush begins, integration, and the check that refines."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import xarray as xr

from robustpolish.arrays import Matrix, Vector
from robustpolish.brush.coupled.machine import LinearMachine
from robustpolish.brush.coupled.motion import advance_coupled
from robustpolish.brush.dataset import parameters_from_attributes
from robustpolish.brush.parameters import BrushParameters
from robustpolish.brush.physical import disc_motion as disc
from robustpolish.brush.physical import rim_contact as rim
from robustpolish.brush.physical.angles import axis_and_turning
from robustpolish.brush.physical.run import (
    PhysicalRun,
    Refinement,
    average_forces,
    contact_constants,
    impulse_difference,
    motion_constants,
)
from robustpolish.brush.tool_path import tool_velocity
from robustpolish.errors import RobustPolishWarning, SolverError
from robustpolish.validation import described, invalid

_FIRST_STEPS = 2  # per sample in the coarsest pass


@dataclass(frozen=True, eq=False)
class GuidedBrush:
    """A brush that a robot leads as it went on a rigid machine.

    Attributes
    ----------
    parameters : BrushParameters
    three_angles : bool
    time : ndarray, shape (n,)
        Uniform, from zero [s].
    place, velocity : ndarray, shape (n, 3)
        Of the ball joint [m, m/s].
    start : ndarray, shape (STATES,)
        Disc at time zero.
    first_force : ndarray, shape (3,)
        Contact force on the brush at time zero, world axes [N].
    nodes : int
        Along the rim.
    """

    parameters: BrushParameters
    three_angles: bool
    time: Vector
    place: Matrix
    velocity: Matrix
    start: Vector
    first_force: Vector
    nodes: int


def guided_brush(brush: xr.Dataset) -> GuidedBrush:
    """Take from a run of the physical simulator how the brush was led.

    Parameters
    ----------
    brush : xarray.Dataset
        Of ``simulate_brush("physical", ...)``.

    Returns
    -------
    GuidedBrush

    Raises
    ------
    InvalidInputError
        If it is a run of the listing, or not one of the brush.
    """
    if brush.attrs.get("simulator") != "physical" or "tool_z" not in brush:
        raise invalid(
            "brush",
            described(f"a dataset of simulator {brush.attrs.get('simulator')!r}"),
            "a run of the physical brush",
            "Make it with simulate_brush(run=..., duration=...).",
        )
    parameters = parameters_from_attributes(brush.attrs)
    three_angles = brush.attrs["disc"] == "three-angle"
    time = brush["time"].to_numpy()
    axis, turning = axis_and_turning(
        *(float(brush[name][0]) for name in ("theta", "psi", "theta_rate", "psi_rate")),
        euler=three_angles,
    )
    start = np.zeros(disc.STATES)
    start[disc.AXES], start[disc.TURNINGS] = axis, turning
    start[disc.SPIN] = float(brush["omega_z"][0]) if three_angles else parameters.spin
    along = tool_velocity(time, parameters)
    return GuidedBrush(
        parameters=parameters,
        three_angles=three_angles,
        time=time,
        place=_columns(*(brush[name].to_numpy() for name in ("tool_x", "tool_y", "tool_z"))),
        velocity=_columns(*along, brush["tool_z_rate"].to_numpy()),
        start=start,
        first_force=np.array([-float(brush.F_x[0]), -float(brush.F_y[0]), float(brush.F_z[0])]),
        nodes=int(brush.attrs["rim_points"]),
    )


def _columns(*parts: Vector) -> Matrix:
    return np.ascontiguousarray(np.column_stack(parts))


def run_coupled(
    guided: GuidedBrush, machine: LinearMachine, *, tolerance: float, max_passes: int
) -> tuple[PhysicalRun, Matrix, Refinement]:
    """Integrate with ever smaller steps until the impulses agree; warn if they do not.

    Parameters
    ----------
    guided : GuidedBrush
    machine : LinearMachine
    tolerance : float
        As in `simulate_brush`.
    max_passes : int
        At least 2; each halves the steps.

    Returns
    -------
    run : PhysicalRun
    states : ndarray, shape (samples, n)
        Of the machine.
    check : Refinement

    Raises
    ------
    SolverError
        If the disc tips over, or disc and machine move apart without bounds.
    """
    run, states = integrate_coupled(guided, machine, _FIRST_STEPS)
    error = np.inf
    for level in range(1, max_passes):
        finer, states = integrate_coupled(guided, machine, _FIRST_STEPS * 2**level)
        error = np.inf
        if run is not None and finer is not None:
            error = impulse_difference(run, finer, guided.parameters.polishing_force)
        run = finer
        if run is not None and error <= tolerance:
            return run, states, Refinement(level + 1, error, True)
    if run is None:
        raise SolverError(
            "Brush and machine swing up against each other until the disc tips over or leaves "
            "all bounds. Add damping to the loop or to the contact, or lower the friction."
        )
    warnings.warn(
        f"The contact impulses of the last two of {max_passes} passes differ by {error:.2g} of "
        f"the polishing force's, more than {tolerance:.2g}. Raise contact_damping or max_passes, "
        "shorten the run, or raise tolerance.",
        RobustPolishWarning,
        stacklevel=4,
    )
    return run, states, Refinement(max_passes, error, False)


def integrate_coupled(
    guided: GuidedBrush, machine: LinearMachine, steps: int
) -> tuple[PhysicalRun | None, Matrix]:
    """Integrate once, with so many steps per sample; no run where the disc was lost.

    The machine begins at rest under the first contact force, and the reference was laid there.
    """
    samples, order = guided.time.size, len(machine.A)
    interval = float(guided.time[1] - guided.time[0])
    half, whole, gains = machine.step_matrices(interval / steps)
    track, midway = np.empty((samples, disc.STATES)), np.empty((samples - 1, 3))
    states, loads = np.empty((samples, order)), np.empty((samples, rim.LOADS))
    outcome, _ = advance_coupled(
        guided.start.copy(),
        machine.rest(guided.first_force),
        guided.place,
        guided.velocity,
        interval,
        steps,
        np.vstack([machine.C, machine.C @ machine.A]),
        np.ascontiguousarray(half),
        np.ascontiguousarray(whole),
        np.stack(gains),
        motion_constants(guided.parameters, guided.three_angles),
        contact_constants(guided.parameters),
        rim.rim_nodes(guided.nodes),
        track,
        states,
        loads,
        midway,
    )
    if outcome != disc.RUNNING:
        return None, states
    forces = average_forces(track, midway, interval)
    count = (samples - 1) * steps
    run = PhysicalRun(guided.time, track, forces, loads, guided.nodes, count, 0, interval / steps)
    return run, states
