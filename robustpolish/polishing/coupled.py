"""Coupled simulation of brush and machine by exponential Runge-Kutta steps, and equilibrium."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from scipy import optimize
from scipy.linalg import expm, matrix_balance

from robustpolish.base.arrays import EPS, SAME, Matrix, Vector
from robustpolish.base.checks import described, invalid
from robustpolish.base.jit import njit
from robustpolish.errors import SolverError
from robustpolish.polishing import brush, contact
from robustpolish.polishing.brush import parameters_from_attributes, tool_velocity
from robustpolish.polishing.parameters import BrushParameters

# Linear machine from contact forces to the displacement of the joint.


@dataclass(frozen=True, eq=False)
class LinearMachine:
    """A linear machine that is pushed by the brush and by a steady force, and says where it is.

        x' = A x + B f + g,    displacement = C x,    velocity = C A x

    Attributes
    ----------
    A : ndarray, shape (n, n)
        Of the machine, or of its closed loop [1/s].
    B : ndarray, shape (n, 3)
        How the contact force on the brush, along world x, y, z [N], enters.
    g : ndarray, shape (n,)
        Steady part, such as the polishing force.
    C : ndarray, shape (3, n)
        Displacements of the brush's joint along world x, y, z [m].

    Raises
    ------
    InvalidInputError
        If a force moves the joint at once: C B has to be zero, as for every joint with a mass.

    Examples
    --------
    >>> import numpy as np
    >>> from robustpolish.polishing.coupled import LinearMachine
    >>> A = np.kron(np.eye(3), [[0.0, 1.0], [-1e8, -200.0]])
    >>> B, C = np.kron(np.eye(3), [[0.0], [5.0]]), np.kron(np.eye(3), [[1.0, 0.0]])
    >>> round(LinearMachine(A, B, np.zeros(6), C).stiffness[0])  # k/m = 1e8, m = 0.2 kg
    20000000
    """

    A: Matrix
    B: Matrix
    g: Vector
    C: Matrix

    def __post_init__(self) -> None:
        at_once = np.abs(self.C @ self.B)
        usual = np.abs(self.C) @ np.abs(self.B)
        # share of a force's effect within a step that counts as none
        if np.any(at_once > SAME * usual):
            shown = described("a loop in which a force sets the brush in motion without delay")
            expected = "a brush with a mass, so that force changes its acceleration"
            raise invalid("design", shown, expected, "Give the place where the brush hangs a mass.")

    def rest(self, force: Vector) -> Vector:
        """State of rest under a steady contact force on the brush.

        Parameters
        ----------
        force : ndarray, shape (3,)
            In N.

        Returns
        -------
        ndarray, shape (n,)

        Raises
        ------
        InvalidInputError
            If the machine has a pole at zero: then it has none.
        """
        # Balanced, for springs of 1e8 N/m and dampers of 1e-2 N s/m stand side by side.
        balanced, (scaling, _) = matrix_balance(self.A, permute=False, separate=True)
        if np.linalg.cond(balanced) > 1.0 / EPS:
            shown = described("a loop that does not come to rest under a steady force")
            expected = "one without a pole at zero"
            raise invalid("design", shown, expected, "Add a stiffness to what can drift away.")
        pushed = (self.B @ force + self.g) / scaling
        return np.asarray(-scaling * np.linalg.solve(balanced, pushed), dtype=float)

    @property
    def stiffness(self) -> Vector:
        """Static stiffness [N/m] of the joint along x, y and z against contact forces."""
        zero = self.C @ self.rest(np.zeros(3))
        give = [self.C[i] @ self.rest(push) - zero[i] for i, push in enumerate(np.eye(3))]
        return 1.0 / np.abs(np.array(give))

    def step_matrices(self, step: float) -> tuple[Matrix, Matrix, tuple[Matrix, ...]]:
        """Matrices of one step of the exponential Runge-Kutta method of order four.

        Parameters
        ----------
        step : float
            In s.

        Returns
        -------
        half, whole : ndarray, shape (n, n)
            exp(A h/2) and exp(A h).
        gains : tuple of ndarray, shape (n, 4)
            Q, f1, f2 and f3 of Cox and Matthews, times (B, g).

        References
        ----------
        S. M. Cox and P. C. Matthews, Exponential time differencing for stiff systems, Journal of
        Computational Physics 176 (2002), (26) to (29).
        """
        entry = np.column_stack([self.B, self.g])
        half, first_half = _phi_functions(self.A, 0.5 * step)[:2]
        whole, one, two, three = _phi_functions(self.A, step)
        gains = (
            0.5 * step * first_half @ entry,
            step * (one - 3.0 * two + 4.0 * three) @ entry,
            step * (two - 2.0 * three) @ entry,
            step * (4.0 * three - two) @ entry,
        )
        return half, whole, gains


def _phi_functions(A: Matrix, step: float) -> tuple[Matrix, ...]:
    """exp(h A) and phi_1, phi_2, phi_3 of h A, from one exponential of a larger matrix.

    Sidje, Expokit, ACM Transactions on Mathematical Software 24 (1998), theorem 1.
    """
    n = len(A)
    balanced, (scaling, _) = matrix_balance(A, permute=False, separate=True)
    large = np.zeros((4 * n, 4 * n))
    large[:n, :n] = step * balanced
    large[: 3 * n, n:] += np.eye(3 * n)
    blocks = np.asarray(expm(large))[:n].reshape(n, 4, n).swapaxes(0, 1)
    return tuple(blocks * scaling[:, None] / scaling)


# Integration of disc and machine by the exponential Runge-Kutta method.
#
# The joint is where the robot leads it, plus what the machine yields,
#
#     place = reference(t) + C (x - x_0),    velocity = reference'(t) + C A x,
#
# and the contact force at that place drives the machine, x' = A x + B f + g. The machine is taken
# exactly, however stiff; for the disc alone the method is the classical Runge-Kutta method.


@njit(cache=True)
def _reference(guide, index, within, place, velocity):  # pragma: no cover - compiled
    """Write the reference between two samples, the cubic through places and velocities."""
    track, rate, interval = guide
    s = within / interval
    for i in range(3):
        before, after = track[index, i], track[index + 1, i]
        start, end = interval * rate[index, i], interval * rate[index + 1, i]
        bend = 3.0 * (after - before) - 2.0 * start - end
        twist = 2.0 * (before - after) + start + end
        place[i] = before + s * (start + s * (bend + s * twist))
        velocity[i] = (start + s * (2.0 * bend + 3.0 * s * twist)) / interval


@njit(cache=True, error_model="numpy")
def _rates(
    guide, index, within, outputs, x, disc, laws, found, room, result, push
):  # pragma: no cover - compiled
    """Write the disc's derivative and the push (f, 1) on the machine; nodes that touch."""
    motion, law, nodes = laws
    place, velocity, load = room[0], room[1], room[2]
    _reference(guide, index, within, place, velocity)
    moved = outputs @ x
    for i in range(3):
        place[i] += moved[i]
        velocity[i] += moved[3 + i]
    axis, turning = disc[contact.AXIS : contact.AXIS + 3], disc[contact.TURNING : contact.SPIN]
    spin = disc[contact.SPIN]
    touching = contact.rim_load(place, velocity, axis, turning, spin, law, nodes, found, load)
    disc[contact.HEIGHT], disc[contact.CLIMB] = place[2], velocity[2]
    result[contact.HEIGHT] = result[contact.CLIMB] = 0.0
    contact.disc_derivative(disc, load, motion, result)
    push[:3] = load[contact.FORCE : contact.FORCE + 3]
    push[3] = 1.0
    return touching


@njit(cache=True, error_model="numpy")
def advance_coupled(
    disc, x, guide, steps, outputs, half, whole, gains, laws, track, machine, loads, midway
):  # pragma: no cover - compiled
    """Integrate disc and machine over all intervals of the reference.

    Parameters
    ----------
    disc : ndarray, shape (STATES,)
        At the first sample; overwritten.
    x : ndarray, shape (n,)
        Of the machine, at the first sample; overwritten.
    guide : tuple of ndarray, shape (count + 1, 3), and float
        Places and velocities of the joint at the samples on a machine at x = 0 [m, m/s], and the
        interval between samples [s].
    steps : int
        Per interval; even.
    outputs : ndarray, shape (6, n)
        C and C A.
    half, whole, gains : ndarray
        From `LinearMachine.step_matrices`; gains of shape (4, n, 4).
    laws : tuple of ndarray
        Constants of the disc and of the contact, and the nodes.
    track, machine, loads : ndarray, shape (count + 1, ...)
        Filled with disc, machine and contact loads at the samples.
    midway : ndarray, shape (count, 3)
        Filled with the impulses in the middle of the intervals.

    Returns
    -------
    tuple of int
        Outcome (RUNNING is success), and intervals done.
    """
    count, points = midway.shape[0], laws[2].shape[1]
    interval = guide[2]
    step = interval / steps
    room, found = np.zeros((3, contact.LOADS)), contact.work_array(points)
    k, push = np.zeros((4, contact.STATES)), np.zeros((4, 4))

    for i in range(count + 1):
        index, start = (i, 0.0) if i < count else (i - 1, interval)
        for part in range(steps):
            at = start + part * step
            touching = _rates(guide, index, at, outputs, x, disc, laws, found, room, k[0], push[0])
            if part == 0:
                track[i], machine[i], loads[i] = disc, x, room[2]
                loads[i, 0] = touching / points
            if i == count:
                break
            stage = second = half @ x + gains[0] @ push[0]
            for s in range(1, 4):  # twice in the middle of the step, once at its end
                ahead = step if s == 3 else 0.5 * step
                _rates(
                    guide, i, at + ahead, outputs, stage, disc + ahead * k[s - 1], laws, found,
                    room, k[s], push[s],
                )  # fmt: skip
                if s == 1:
                    stage = half @ x + gains[0] @ push[1]
                elif s == 2:
                    stage = half @ second + gains[0] @ (2.0 * push[2] - push[0])
            middle_pushes = 2.0 * (push[1] + push[2])
            x[:] = whole @ x + gains[1] @ push[0] + gains[2] @ middle_pushes + gains[3] @ push[3]
            disc += step / 6.0 * (k[0] + 2.0 * (k[1] + k[2]) + k[3])
            if 2 * (part + 1) == steps:
                midway[i] = disc[contact.IMPULSE : contact.IMPULSE + 3]
        if i == count:
            break
        contact.renormalise_axis(disc)
        if not np.isfinite(disc[contact.AXIS + 2] + x[0]):
            return contact.STUCK, i
        if disc[contact.AXIS + 2] < contact.LOWEST_AXIS:
            return contact.TIPPED_OVER, i
    return contact.RUNNING, count


# Equilibrium of the spinning disc, and linearisation of its contact forces.

# What the contact depends on near rest, in this order.
PLACE, VELOCITY, REST_AXIS, REST_TURNING = slice(0, 3), slice(3, 6), slice(6, 8), slice(8, 10)
VARIABLES = 10

_FINER = 4  # times the rim points of the coarsest pass: derivatives ask for more than forces
_STEP = 0.001  # share of the static depth over which contact is differentiated
_AT_REST = 1e-8  # moment that counts as none, of the polishing force at the rim
_STEEPEST = 0.04  # square of the cosine of the tilt from which the disc counts as tipped over
_LEANS = ((0.0, 0.0), (0.0, -0.2), (0.2, 0.0), (0.0, 0.2), (-0.2, 0.0))  # first guesses of the tilt

# Untyped on purpose: checkers would read all of scipy's solvers for what it returns.
_root: Any = optimize.root
_brentq: Any = optimize.brentq


@dataclass(frozen=True, eq=False)
class BrushAtRest:
    """The disc turning on the spot, its contact carrying the polishing force and no tilting moment.

    Attributes
    ----------
    parameters : BrushParameters
    place : ndarray, shape (3,)
        Of the ball joint [m].
    axis : ndarray, shape (3,)
        Unit axis of the disc.
    across : ndarray, shape (2, 3)
        Unit vectors across the axis, the first nearest to x; they measure small tilts.
    """

    parameters: BrushParameters
    place: Vector
    axis: Vector
    across: Matrix

    @classmethod
    def at(cls, parameters: BrushParameters, place: Vector, axis: Vector) -> BrushAtRest:
        """Return the disc at any place and axis, whether in balance there or not.

        Parameters
        ----------
        parameters : BrushParameters
        place, axis : ndarray, shape (3,)

        Returns
        -------
        BrushAtRest
        """
        return cls(parameters, place, axis, _across(axis))

    @cached_property
    def load(self) -> Vector:
        """Contact force [N] and tilting moments [N m] at rest, shape (5,)."""
        return self.load_at(np.zeros(VARIABLES))

    def load_at(self, change: Vector) -> Vector:
        """Contact force and moments about `across` near rest.

        Parameters
        ----------
        change : ndarray, shape (10,)
            Of the place [m], of its velocity [m/s], of the axis along `across` [rad], and angular
            velocity along `across` [rad/s].

        Returns
        -------
        ndarray, shape (5,)
            In N and N m.
        """
        tilt, turning = change[REST_AXIS], change[REST_TURNING]
        axis = tilt @ self.across + np.sqrt(1.0 - tilt @ tilt) * self.axis
        # The angular velocity has to be across the tilted axis.
        along = -(turning @ tilt) / np.sqrt(1.0 - tilt @ tilt)
        turns = turning @ self.across + along * self.axis
        place = self.place + change[PLACE]
        load = contact_load(self.parameters, place, change[VELOCITY], axis, turns)
        moment = load[contact.MOMENT : contact.MOMENT + 3]
        return np.concatenate([load[:3], self.across @ (moment - (moment @ axis) * axis)])

    @cached_property
    def jacobian(self) -> Matrix:
        """Slope of the load over the ten changes, shape (5, 10): central differences to order 4."""
        p = self.parameters
        depth, _ = brush.static_depth(p)
        rate = np.sqrt(p.polishing_force / depth / p.mass)  # of the contact, in 1/s
        sizes = np.array([depth, depth * rate, depth / p.radius, depth * rate / p.radius])

        def slope(size: float, unit: Vector) -> Vector:
            step = size * unit
            wide = (self.load_at(step) - self.load_at(-step)) / (2.0 * size)
            narrow = (self.load_at(0.5 * step) - self.load_at(-0.5 * step)) / size
            return (4.0 * narrow - wide) / 3.0

        steps = zip(_STEP * np.repeat(sizes, [3, 3, 2, 2]), np.eye(VARIABLES), strict=True)
        return np.column_stack([slope(size, unit) for size, unit in steps])

    @property
    def stiffness(self) -> float:
        """Largest static stiffness [N/m] of the contact in any direction, tilts held."""
        return float(np.linalg.norm(self.jacobian[:3, PLACE], 2))

    @property
    def damping(self) -> Vector:
        """Damping [N s/m] of the contact along world x, y and z, from damping and friction."""
        return -np.diagonal(self.jacobian[:3, VELOCITY])


def contact_load(
    parameters: BrushParameters, place: Vector, velocity: Vector, axis: Vector, turning: Vector
) -> Vector:
    """Contact load of the spinning disc at one instant.

    Parameters
    ----------
    parameters : BrushParameters
    place, velocity : ndarray, shape (3,)
        Of the ball joint [m, m/s].
    axis, turning : ndarray, shape (3,)
        Unit axis, and angular velocity across it [rad/s].

    Returns
    -------
    ndarray, shape (LOADS,)
        As `rim_load` fills it.
    """
    nodes = contact.rim_nodes(_FINER * brush.rim_points(parameters))
    load, found = np.zeros(contact.LOADS), contact.work_array(nodes.shape[1])
    constants = brush.contact_constants(parameters)
    contact.rim_load(place, velocity, axis, turning, parameters.spin, constants, nodes, found, load)
    return load


def brush_at_rest(parameters: BrushParameters, x: float, y: float) -> BrushAtRest:
    """Find height and tilt at which the spinning disc rests at a place of the path.

    Parameters
    ----------
    parameters : BrushParameters
    x, y : float
        Of the ball joint [m].

    Returns
    -------
    BrushAtRest

    Raises
    ------
    SolverError
        If none is found.
    """
    p = parameters
    slope_x, slope_y = (float(part) for part in p.surface.gradient(x, y))
    normal = np.array([-slope_x, -slope_y, 1.0])
    normal /= np.linalg.norm(normal)
    across, still = _across(normal), np.zeros(3)
    size, ground = p.radius + p.height, float(p.surface.height(x, y))

    def leaning(tilt: Vector) -> BrushAtRest:
        axis = tilt @ across + np.sqrt(max(1.0 - tilt @ tilt, _STEEPEST)) * normal
        axis /= np.linalg.norm(axis)

        def excess(height: float) -> float:
            load = contact_load(p, np.array([x, y, height]), still, axis, still)
            return load[2] - p.polishing_force

        height = float(_brentq(excess, ground - size, ground + 4.0 * size, xtol=1e-18))
        return BrushAtRest.at(p, np.array([x, y, height]), axis)

    def unbalance(tilt: Vector) -> Vector:
        return leaning(tilt).load[3:] / (p.polishing_force * p.radius)

    for guess in _LEANS:
        answer = _root(unbalance, np.array(guess), tol=1e-13)
        if np.max(np.abs(answer.fun)) < _AT_REST and answer.x @ answer.x < 1.0 - _STEEPEST:
            return leaning(answer.x)
    raise SolverError(
        f"The spinning disc finds no rest at x = {x:g} m, y = {y:g} m. Lower the friction, or "
        "choose a flatter place."
    )


def _across(axis: Vector) -> Matrix:
    """Two unit vectors across the axis, the first in the plane of the axis and x."""
    first = np.array([1.0, 0.0, 0.0]) - axis[0] * axis
    first /= np.linalg.norm(first)
    return np.asarray(np.stack([first, np.cross(axis, first)]), dtype=float)


# Coupled runs: initial state, integration, and refinement of steps.

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
        shown = described(f"a dataset of simulator {brush.attrs.get('simulator')!r}")
        remedy = "Make it with simulate_brush(run=..., duration=...)."
        raise invalid("brush", shown, "a run of the physical brush", remedy)
    parameters = parameters_from_attributes(brush.attrs)
    three_angles, time = brush.attrs["disc"] == "three-angle", brush["time"].to_numpy()
    first = {name: float(part[0]) for name, part in brush.items() if part.dims == ("time",)}
    angles: Any = (first[name] for name in ("theta", "psi", "theta_rate", "psi_rate"))
    start = np.zeros(contact.STATES)
    start[contact.AXES], start[contact.TURNINGS] = contact.axis_and_turning(
        *angles, euler=three_angles
    )
    start[contact.SPIN] = first["omega_z"] if three_angles else parameters.spin
    place = np.column_stack([brush[f"tool_{name}"] for name in "xyz"])
    velocity = np.column_stack([*tool_velocity(time, parameters), brush["tool_z_rate"]])
    force = np.array([-first["F_x"], -first["F_y"], first["F_z"]])
    nodes = int(brush.attrs["rim_points"])
    return GuidedBrush(parameters, three_angles, time, place, velocity, start, force, nodes)


def run_coupled(
    guided: GuidedBrush, machine: LinearMachine, *, tolerance: float, max_passes: int
) -> tuple[brush.PhysicalRun, Matrix, dict[str, Any]]:
    """Integrate with ever smaller steps until the impulses agree, as `refined`; also the states.

    Each of the passes, at least 2, halves the steps.
    """
    return brush.refined(
        lambda level: integrate_coupled(guided, machine, _FIRST_STEPS * 2**level),
        guided.parameters.polishing_force,
        tolerance,
        max_passes,
        "Raise contact_damping or max_passes, shorten the run, or raise tolerance.",
    )


def integrate_coupled(
    guided: GuidedBrush, machine: LinearMachine, steps: int
) -> tuple[brush.PhysicalRun | None, Matrix]:
    """Integrate once, with so many steps per sample; no run where the disc was lost.

    The machine begins at rest under the first contact force, and the reference was laid there.
    """
    samples, order = guided.time.size, len(machine.A)
    interval = float(guided.time[1] - guided.time[0])
    half, whole, gains = machine.step_matrices(interval / steps)
    track, midway = np.empty((samples, contact.STATES)), np.empty((samples - 1, 3))
    states, loads = np.empty((samples, order)), np.empty((samples, contact.LOADS))
    motion = brush.motion_constants(guided.parameters, guided.three_angles)
    rest = machine.rest(guided.first_force)
    laws = motion, brush.contact_constants(guided.parameters), contact.rim_nodes(guided.nodes)
    guide = guided.place - machine.C @ rest, guided.velocity, interval
    outcome, _ = advance_coupled(
        guided.start.copy(), rest, guide, steps,
        np.vstack([machine.C, machine.C @ machine.A]),
        *map(np.ascontiguousarray, (half, whole, np.stack(gains))),
        laws, track, states, loads, midway,
    )  # fmt: skip
    if outcome != contact.RUNNING:
        return None, states
    forces = brush.average_forces(track, midway, interval)
    count = (samples - 1) * steps
    run = brush.PhysicalRun(
        guided.time, track, forces, loads, guided.nodes, count, 0, interval / steps
    )
    return run, states
