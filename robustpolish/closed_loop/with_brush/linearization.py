"""The whole brush on its machine, linearised about rest: (10.1) to (10.5)."""

from __future__ import annotations

import control
import numpy as np

from robustpolish.arrays import Matrix
from robustpolish.brush import BrushParameters
from robustpolish.brush.coupled.near_rest import (
    AXIS,
    PLACE,
    TURNING,
    VELOCITY,
    brush_at_rest,
)
from robustpolish.closed_loop.with_brush.carrier import FORCES, SIGNS, Loop, carrier
from robustpolish.models import GeneralizedPlant
from robustpolish.models.linearization import Linearization
from robustpolish.validation import instance_of

DISC = ("tilt_x", "tilt_y", "turning_x", "turning_y")
"""Deviation of the disc's axis along x and y [rad], and its angular velocity [rad/s]."""


def linearize_with_brush(
    design: Loop,
    parameters: BrushParameters | None = None,
    *,
    x: float | None = None,
    y: float = 0.0,
) -> Linearization:
    r"""Linearise brush and machine together about the rest of the spinning disc on one spot.

    Parameters
    ----------
    design : Design, GeneralizedPlant or control.StateSpace
        As in :func:`robustpolish.simulate_coupled`; of a plant the controls stay open, and its
        measurements are outputs, so that a controller can be designed for the machine in contact.
    parameters : BrushParameters, optional
        Run 1 by default. The disc has two angles and an ideal drive; the path stands still.
    x, y : float, optional
        Where the ball joint is, in m; by default on the bottom of the trough where the path
        begins. Where a stiff disc hangs askew on two narrow patches there may be no rest.

    Returns
    -------
    Linearization
        States: those of the loop in deviations from its rest under the contact force, then
        `tilt_x`, `tilt_y` [rad] and `turning_x`, `turning_y` [rad/s] of the disc. Inputs: those of
        the loop; forces F_x, F_y, F_z and F_p act besides the contact's. Outputs: those of the
        loop, the disc's four, and the changes `contact_x`, `contact_y`, `contact_z` [N] of the
        contact force on the brush in world axes. `state` is the equilibrium of the loop and of
        the disc, the latter as components of its axis.

    Raises
    ------
    InvalidInputError
        As :func:`robustpolish.simulate_coupled`.
    SolverError
        If the disc finds no rest there.

    Notes
    -----
    (10.4) by the chain rule: the machine is linear already, and the disc's axis k and angular
    velocity w obey k' = w x k, I_0 w' = M - I p (w x k) to first order; only the contact's ten
    derivatives are taken by differences, extrapolated to fourth order.

    Examples
    --------
    >>> import robustpolish as rp
    >>> at_rest = rp.linearize_with_brush(rp.air_bearing(), rp.BrushParameters.for_run(2))
    >>> at_rest.system.nstates, at_rest.system.output_labels[-1]
    (16, 'contact_z')
    """
    p = BrushParameters() if parameters is None else parameters
    remedy = "Build them with BrushParameters(...)."
    instance_of("parameters", p, BrushParameters, "BrushParameters", remedy)
    along = p.radius + 2.0 * p.rotation_radius if x is None else x
    carried = carrier(design, p.polishing_force)
    rest = brush_at_rest(p, along, y)
    loop = design.system if isinstance(design, GeneralizedPlant) else carried.system
    A, B_contact, C = carried.machine.A, carried.machine.B, carried.machine.C
    change = _change(C, A)
    slopes = rest.jacobian @ change
    order = len(A)
    top = np.hstack([A, np.zeros((order, 4))]) + B_contact @ slopes[:3]
    whole = np.vstack([top, _disc_rows(p, order) + _moments(p, slopes[3:], order)])
    inputs = np.vstack([loop.B, np.zeros((4, loop.ninputs))])
    outputs = np.vstack(
        [
            np.hstack([loop.C, np.zeros((loop.noutputs, 4))]),
            np.hstack([np.zeros((4, order)), np.eye(4)]),
            slopes[:3],
        ]
    )
    # Forces may enter outputs at once, such as an acceleration's; so does the contact's then.
    columns = [loop.input_labels.index(name) for name in FORCES]
    outputs[: loop.noutputs] += np.asarray(loop.D)[:, columns] * SIGNS @ slopes[:3]
    through = np.vstack([loop.D, np.zeros((7, loop.ninputs))])
    system = control.StateSpace(
        whole,
        inputs,
        outputs,
        through,
        states=[*loop.state_labels, *DISC],
        inputs=list(loop.input_labels),
        outputs=[*loop.output_labels, *DISC, "contact_x", "contact_y", "contact_z"],
    )
    machine_rest = carried.machine.rest(rest.load[:3])
    residual = float(np.max(np.abs(rest.load[3:]))) / (p.polishing_force * p.radius)
    state = np.concatenate([machine_rest, rest.axis[:2], np.zeros(2)])
    return Linearization(system, state, np.zeros(loop.ninputs), residual)


def _change(C: Matrix, A: Matrix) -> Matrix:
    """Map states of machine and disc to the ten changes that the contact depends on."""
    order = len(A)
    change = np.zeros((10, order + 4))
    change[PLACE, :order] = C
    change[VELOCITY, :order] = C @ A
    change[AXIS, order : order + 2] = np.eye(2)
    change[TURNING, order + 2 :] = np.eye(2)
    return change


def _disc_rows(p: BrushParameters, order: int) -> Matrix:
    """Rows of the free disc: with e_1 x e_2 = k, w x k = (w_2, -w_1) along e_1, e_2."""
    gyro = p.spin_inertia * p.spin / p.tilt_inertia
    rows = np.zeros((4, order + 4))
    rows[0, order + 3], rows[1, order + 2] = 1.0, -1.0
    rows[2, order + 3], rows[3, order + 2] = -gyro, gyro
    return rows


def _moments(p: BrushParameters, slopes: Matrix, order: int) -> Matrix:
    rows = np.zeros((4, order + 4))
    rows[2:] = slopes / p.tilt_inertia
    return rows
