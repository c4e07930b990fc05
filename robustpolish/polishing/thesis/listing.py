"""Brush simulator of the thesis's listings D.1 to D.3, with their defects, integrated by ode45."""

from __future__ import annotations

from collections import namedtuple
from dataclasses import astuple, dataclass, fields
from math import atan, atan2, cos, hypot, pi, sin, sqrt
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from robustpolish.base.arrays import AnyArray, Array
from robustpolish.base.checks import described, invalid, matrix, one_of, positive
from robustpolish.base.jit import njit
from robustpolish.errors import SolverError
from robustpolish.polishing import brush as dataset
from robustpolish.polishing.contact import NODES, STAGES, inside_step, stage_state, step_error
from robustpolish.polishing.parameters import BrushParameters

# Defects of appendix D, one switch each.


@dataclass(frozen=True)
class ListingDefects:
    """Which mistakes of listings D.1 to D.3 to make; all of them by default.

    Two laws are no slips but the approach of the listings, and have no switch: velocities are
    overwritten inside the right-hand side, and an impulse m v / t_m acts as long as "contact"
    lasts, that is as a damper. The mended form of those is the physical simulator.

    Parameters
    ----------
    interpolation_weight : bool
        D.2 line 60, D.3 line 35: the earlier of two stored brush states is weighted by
        (1 - t + t_i)/S instead of (S - t + t_i)/S, about 1/S too much.
    bearing_gate : bool
        D.2 line 123, D.3 line 98: F_theta waits for the bearing to move, w(2), instead of the
        brush, wD(2).
    gravity_terms : bool
        D.2 lines 137 and 138: m 9.81 times a displacement is added to forces.
    polishing_force_dropped : bool
        D.2 line 138: F_z loses F_p while the bearing is up, w(11) > 0; D.3 keeps it.
    tilt_cosine : bool
        D.1 line 58, D.2 line 71, D.3 line 46: abs(cos(w1) - theta0) for cos(w1 - theta0).
    inertia_radius : bool
        D.1 lines 38 and 39: inertias with the distance r to the rim instead of the radius r_d.
    impact_mass : bool
        D.1 lines 89 to 117: the whole mass m hits instead of the mass at the rim,
        I_0 / r^2, so that an impact returns 2.8 times the velocity it takes.
    pulling_surface : bool
        D.1 lines 123 and 124, (7.8) and (7.9): forces of C1 and C2 may be negative.
    feed_friction : bool
        D.1 lines 72 and 73: the friction angle leans against the feed, 0.04 m/s, instead of
        against the slip of the spinning rim, 3.14 m/s.

    Examples
    --------
    >>> from robustpolish.polishing import ListingDefects
    >>> ListingDefects.none().bearing_gate, ListingDefects.none(but=("bearing_gate",)).bearing_gate
    (False, True)
    """

    interpolation_weight: bool = True
    bearing_gate: bool = True
    gravity_terms: bool = True
    polishing_force_dropped: bool = True
    tilt_cosine: bool = True
    inertia_radius: bool = True
    impact_mass: bool = True
    pulling_surface: bool = True
    feed_friction: bool = True

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not isinstance(value, (bool, np.bool_)):
                raise invalid(f"ListingDefects.{item.name}", value, "True or False", "Pass a bool.")

    @classmethod
    def none(cls, but: tuple[str, ...] = ()) -> ListingDefects:
        """Return the listings with every mistake mended, except those named in `but`.

        Parameters
        ----------
        but : tuple of str, optional
            Names of fields.

        Returns
        -------
        ListingDefects
        """
        names = [item.name for item in fields(cls)]
        if isinstance(but, str):
            raise invalid("but", described(repr(but)), "a tuple of names", f"Pass ({but!r},).")
        for name in but:
            one_of("but", name, names)
        return cls(**{name: name in but for name in names})

    def names(self) -> tuple[str, ...]:
        """Return the names of the mistakes that are made."""
        return tuple(item.name for item in fields(self) if getattr(self, item.name))


# Equations of listings D.1 to D.3: right-hand side and forces.
#
# Variable names follow the listings where that helps to compare line by line.

Flags = namedtuple("Flags", [item.name for item in fields(ListingDefects)])
Constants = namedtuple(
    "Constants",
    "radius rim_distance half_height circle rate feed spin hitting mass tilt_inertia spin_inertia"
    " friction stiffness duration force_p bend_x bend_y",
)

LAYER = 0.001  # depth [m] of the liquid layer in which C1 and C2 move freely (D.1, line 86)
UPRIGHT = 0.5 * pi  # psi_0


def listing_constants(parameters: BrushParameters, defects: ListingDefects) -> tuple[Any, Any]:
    """Return constants in SI units and the switches, by name, as compiled code reads them."""
    p, r = parameters, parameters.rim_distance
    inertia_radius = r if defects.inertia_radius else p.radius
    tilt = p.mass * (3.0 * inertia_radius**2 + p.height**2) / 12.0
    hitting = p.mass if defects.impact_mass else tilt / r**2
    spin_inertia = 0.5 * p.mass * inertia_radius**2
    constants = Constants(
        p.radius, r, 0.5 * p.height, p.rotation_radius, p.rotation_rate, p.feed, p.spin, hitting,
        p.mass, tilt, spin_inertia, p.friction, p.contact_stiffness, p.impact_duration,
        p.polishing_force, *p.trough.curvatures,
    )  # fmt: skip
    return constants, Flags(*map(bool, astuple(defects)))


@njit(cache=True)
def _height(x, y, c):  # pragma: no cover - compiled
    return 0.5 * (c.bend_x * x * x + c.bend_y * y * y)


@njit(cache=True)
def _elevation(nx, ny, x, y, c):  # pragma: no cover - compiled
    """Angle of elevation along the unit vector n (9.4, 9.5)."""
    return atan(nx * c.bend_x * x + ny * c.bend_y * y)


# On a plane without friction the pushes of C1 and C2 are 0/0, as in the listings, and no error.
# Said here, for Numba takes it from the first caller else: the order of calls would decide.
@njit(cache=True, error_model="numpy")
def impact(t, theta, theta_rate, psi, psi_rate, c, flags):  # pragma: no cover - compiled
    """Contacts of the brush: D.1 lines 51 to 118, D.2 lines 64 to 126.

    Returns
    -------
    tuple
        theta_0, alpha, beta [rad]; F_psi and F_theta [N] as D.2 has them, the latter as if its
        gate were open; whether C1 and C2, C3, and C4 touch.
    """
    omega, r_rot, rd, r = c.rate, c.circle, c.radius, c.rim_distance
    cosine, sine = cos(omega * t), sin(omega * t)
    centre = c.feed * t + rd + r_rot
    x, y = r_rot * cosine + centre, r_rot * sine
    vx, vy = c.feed - omega * r_rot * sine, omega * r_rot * cosine
    speed = hypot(vx, vy)
    nx, ny = vx / speed, vy / speed
    theta0 = _elevation(nx, ny, r + r_rot, 0.0, c)
    reach = rd * (abs(cos(theta) - theta0) if flags.tilt_cosine else cos(theta - theta0))
    x1, y1, x2, y2 = x + reach * nx, y + reach * ny, x - reach * nx, y - reach * ny
    side = rd * abs(cos(psi - UPRIGHT))
    x3, y3 = (r_rot - side) * cosine + centre, (r_rot - side) * sine
    x4, y4 = (r_rot + side) * cosine + centre, (r_rot + side) * sine
    xi1, xi2 = _elevation(nx, ny, x1, y1, c), _elevation(nx, ny, x2, y2, c)
    middle = 0.5 * (_height(x1, y1, c) + _height(x2, y2, c))
    dh3, dh4 = middle - _height(x3, y3, c), middle - _height(x4, y4, c)
    mu = c.friction
    if not flags.feed_friction:
        mu *= speed / hypot(speed, c.spin * rd)
    sigma = atan(mu)
    alpha, beta = abs(xi2) - sigma, abs(xi1) + sigma
    lift = r * sin(psi - UPRIGHT)
    v0, v1 = psi_rate * r, theta_rate * r
    impulse = c.hitting * v0 / c.duration
    near = sqrt(c.mass / c.stiffness) * abs(v0)
    force_psi = 0.0
    if dh3 > 0.0:
        touch3 = dh3 - abs(lift) <= near and psi > UPRIGHT
        if touch3:
            force_psi = abs(impulse)
    else:
        touch3 = dh3 - lift < near and psi_rate > 0.0
        if touch3:
            force_psi = impulse
    if dh4 > 0.0:
        touch4 = abs(dh4) - abs(lift) <= near and psi < UPRIGHT
        if touch4:
            force_psi = -abs(impulse)
    else:
        touch4 = dh4 + lift < near and psi_rate < 0.0
        if touch4:
            force_psi = -impulse
    touch1 = abs(theta - theta0 - xi1) > atan(LAYER / r)
    force_theta = -c.hitting * v1 / c.duration if touch1 else 0.0
    return theta0, alpha, beta, force_psi, force_theta, touch1, touch3, touch4


@njit(cache=True, error_model="numpy")
def brush_slope(t, w, c, flags, result):  # pragma: no cover - compiled
    """Right-hand side of D.1, w = (theta, theta', psi, psi')."""
    theta, theta_rate, psi, psi_rate = w[0], w[1], w[2], w[3]
    theta0, alpha, beta, _, _, touch1, touch3, touch4 = impact(
        t, theta, theta_rate, psi, psi_rate, c, flags
    )
    r, rd = c.rim_distance, c.radius
    weight, inertia, duration = c.hitting, c.tilt_inertia, c.duration
    v0, v1 = psi_rate * r, theta_rate * r
    moment_i, moment_j = 0.0, 0.0
    # The impulse is that of the velocity before; the velocity is overwritten all the same.
    if touch3 or touch4:
        moment_j = -weight * v0 * r / duration
        psi_rate = -weight * v0 * rd / (inertia * abs(cos(psi - UPRIGHT)))
    if touch1 and theta_rate != 0.0:
        moment_i = -weight * v1 * r / duration
        theta_rate = -weight * theta_rate * r * rd / (inertia * abs(cos(theta - theta0)))
    lean = UPRIGHT - atan2(rd, c.half_height)
    force2 = c.force_p * sin(beta) / sin(alpha + beta)
    force1 = c.force_p / cos(beta) * (1.0 - cos(alpha) * sin(beta) / sin(alpha + beta))
    if not flags.pulling_surface:
        force1, force2 = max(0.0, force1), max(0.0, force2)
    moment_i += (force1 * cos(beta + lean) - force2 * cos(alpha + lean)) * r
    gyro = c.spin_inertia * c.spin / inertia
    result[0] = theta_rate
    result[1] = moment_i / inertia - gyro * psi_rate
    result[2] = psi_rate
    result[3] = moment_j / inertia + gyro * theta_rate


# Forces of the contact on the machine, and step control of MATLAB's ode45.
#
# Facts from L. F. Shampine and M. W. Reichelt, "The MATLAB ODE suite", SIAM J. Sci. Comput. 18
# (1997): the error of a step is the largest of its components, each divided by the larger of the
# state's size before and after, and of absolute over relative tolerance.

ABSOLUTE = 1e-6  # MATLAB's default, in the units of the state


@njit(cache=True)
def forces_of_contact(contact, force_p, divisor):  # pragma: no cover - compiled
    """Return F_x, F_y, F_z of D.2 lines 133 to 135, from the result of `impact`."""
    alpha, beta, force_psi, force_theta = contact[1], contact[2], contact[3], contact[4]
    across = abs(force_theta) * np.cos(beta) + abs(force_psi) * np.cos(alpha)
    return (
        force_psi * np.sin(alpha) / divisor,
        force_theta * np.sin(beta) / divisor,
        force_p + across / divisor,
    )


_GRAVITY = 9.81
_BEARING_VELOCITY, _BEARING_HEIGHT, _BRUSH_HEIGHT = 1, 8, 10  # w(2), w(9), w(11) of D.2


@njit(cache=True)
def _slope(t, x, machine, c, flags, room, result):  # pragma: no cover - compiled
    """Right-hand side of D.2 (if `mass` is positive) or D.3; of D.1 without a machine."""
    A, B1, stored, spacing, divisor, mass = machine
    if A.size == 0:
        brush_slope(t, x, c, flags, result)
        return
    w, force = room[0], room[1]
    i = int(t / spacing)
    while spacing * i > t:
        i -= 1
    while spacing * (i + 1) <= t:  # on a stored time the later interval wins
        i += 1
    i = min(i, stored.shape[0] - 2)
    later = (t - spacing * i) / spacing
    meant = 1.0 if flags.interpolation_weight else spacing
    earlier = (meant - t + spacing * i) / spacing
    for j in range(4):
        w[j] = later * stored[i + 1, j] + earlier * stored[i, j]
    contact = impact(t, w[0], w[1], w[2], w[3], c, flags)
    force_p = c.force_p
    force[0], force[1], force[2] = forces_of_contact(contact, force_p, divisor)
    if flags.bearing_gate and x[_BEARING_VELOCITY] == 0.0:
        force[2] -= abs(contact[4]) * np.cos(contact[2]) / divisor
        force[1] = 0.0
    if mass > 0.0 and x[_BRUSH_HEIGHT] > 0.0:
        if flags.gravity_terms:
            force_p += mass * _GRAVITY * x[_BEARING_HEIGHT]
            force[2] -= c.mass * _GRAVITY * x[_BRUSH_HEIGHT]
        if flags.polishing_force_dropped:
            force[2] -= force_p
    force[3] = force_p
    for row in range(x.size):
        total = 0.0
        for column in range(x.size):
            total += A[row, column] * x[column]
        for column in range(4):
            total += B1[row, column] * force[column]
        result[row] = total


_REFINE = 4  # ode45 shows four values per step; the largest deviation is read from them


@njit(cache=True)
def _outputs(C, x, result, largest):  # pragma: no cover - compiled
    for row in range(result.size):
        total = 0.0
        for column in range(x.size):
            total += C[row, column] * x[column]
        result[row] = total
        largest[row] = max(largest[row], abs(total))


@njit(cache=True, error_model="numpy")
def _ode45(
    state, samples, first, relative, machine, constants, flags, C, shown, largest
):  # pragma: no cover - compiled
    """Run ode45 from time zero over all samples: the machine, or without one the brush.

    Parameters
    ----------
    state : ndarray, shape (n,)
        At time zero; overwritten.
    samples : ndarray, shape (count,)
        Rising from zero [s]; C times the state is shown there.
    first : float
        Longest first step [s].
    relative : float
        Relative tolerance.
    machine : tuple
        Of `_slope`; with an A of no size it is the brush that moves.
    constants, flags : tuple
        Of `listing_constants`.
    C, shown, largest : ndarray, shape (p, n), (count, p) and (p,)
        Outputs; their values, filled from the second row on; and their largest magnitudes.

    Returns
    -------
    tuple
        Time reached, steps taken, steps refused, and times that contact began between two steps.
    """
    brush, order = machine[0].size == 0, state.size
    slopes, stage, scale = np.zeros((STAGES, order)), np.zeros(order), np.zeros(order)
    inside, output, room = np.zeros(order), np.zeros(largest.size), np.zeros((2, 4))
    threshold = ABSOLUTE / relative
    end = samples[-1]
    longest = 0.1 * end
    time, following = 0.0, 1
    accepted, refused, impacts = 0, 0, 0
    touching = False
    _slope(0.0, state, machine, constants, flags, room, slopes[0])
    rate = 0.0
    for i in range(order):
        rate = max(rate, abs(slopes[0, i]) / max(abs(state[i]), threshold))
    rate /= 0.8 * relative**0.2
    step = min(longest, first)
    step = step if step * rate <= 1.0 else 1.0 / rate
    while time < end:
        smallest = 16.0 * np.spacing(time)  # below it rounding of the time takes over
        step = min(longest, max(smallest, step))
        last = 1.1 * step >= end - time
        step = end - time if last else step
        attempts = 0
        while True:
            for s in range(1, STAGES):
                stage_state(slopes, s, state, step, stage)
                at = time + NODES[s] * step
                _slope(at, stage, machine, constants, flags, room, slopes[s])
            for i in range(order):
                scale[i] = max(abs(state[i]), abs(stage[i]), threshold)
            error = step_error(slopes, step, scale)
            if error <= relative:
                break
            if step <= smallest:
                return time, accepted, refused, impacts
            refused += 1
            attempts += 1
            last = False
            if attempts > 1 or not np.isfinite(error):
                step *= 0.5
            else:
                step *= max(0.1, 0.8 * (relative / error) ** 0.2)
            step = max(smallest, step)
        accepted += 1
        reached = end if last else time + step
        while following < samples.size and samples[following] <= reached:
            inside_step(slopes, state, step, (samples[following] - time) / step, 0, inside)
            _outputs(C, inside, shown[following], largest)
            following += 1
        for part in range(1, 1 if brush else _REFINE + 1):
            inside_step(slopes, state, step, part / _REFINE, 0, inside)
            _outputs(C, inside, output, largest)
        time = reached
        state[:] = stage
        slopes[0] = slopes[STAGES - 1]
        if attempts == 0:
            step /= max(0.2, 1.25 * (error / relative) ** 0.2)
        if brush:
            contact = impact(time, state[0], state[1], state[2], state[3], constants, flags)
            now = contact[5] or contact[6] or contact[7]
            impacts += now and not touching
            touching = now
    return time, accepted, refused, impacts


@njit(cache=True)
def _forces_along(
    times, states, constants, flags, divisor, forces, touching
):  # pragma: no cover - compiled
    for i in range(times.size):
        w = states[i]
        contact = impact(times[i], w[0], w[1], w[2], w[3], constants, flags)
        forces[i] = forces_of_contact(contact, constants.force_p, divisor)
        touching[i, 0] = touching[i, 1] = contact[5]
        touching[i, 2], touching[i, 3] = contact[6], contact[7]


def listing_forces(
    parameters: BrushParameters, defects: ListingDefects, time: Array, states: Array, divisor: float
) -> tuple[Array, AnyArray]:
    """Evaluate the forces of D.2 at stored states, with the gates of the bearing open.

    Returns
    -------
    forces : ndarray, shape (n, 3)
        F_x, F_y, F_z [N]; the share of the impacts is divided by `divisor`.
    touching : ndarray of bool, shape (n, 4)
        C1, C2, C3, C4; the listings have one condition for C1 and C2.
    """
    forces, touching = np.empty((time.size, 3)), np.empty((time.size, 4), dtype=np.bool_)
    _forces_along(time, states, *listing_constants(parameters, defects), divisor, forces, touching)
    return forces, touching


# Runs of the brush and of a linear system under its forces.

Workaround = Literal["none", "divide", "impulse"]
_NO_MACHINE = (np.empty((0, 0)), np.empty((0, 4)), np.empty((0, 4)), 1.0, 1.0, 0.0)


def run_listing(
    parameters: BrushParameters,
    time: Array,
    *,
    defects: ListingDefects,
    workaround: Workaround,
    relative: float,
) -> xr.Dataset:
    """Integrate listing D.1, evaluate the forces of D.2, and label both.

    Raises
    ------
    InvalidInputError
        If the tool does not move: the listings place the contacts along its velocity.
    SolverError
        If the steps become too small to go on.
    """
    constants, flags = listing_constants(parameters, defects)
    velocity = dataset.tool_velocity(0.0, parameters)
    speed = float(np.hypot(*velocity))
    if speed == 0.0:
        expected = "a feed or a circling, whose direction places C1 to C4"
        remedy = "Raise feed, or rotation_radius and rotation_rate."
        raise invalid("parameters", described("a tool at rest"), expected, remedy)
    slope = velocity[0] * constants.bend_x / speed
    place = constants.rim_distance + constants.circle
    state = np.array([atan(slope * place), 0.0, UPRIGHT, 0.0])  # theta, theta', psi, psi'
    interval = float(time[1] - time[0])
    states = np.empty((time.size, 4))
    states[0] = state
    done, *counts = _ode45(
        state, np.arange(time.size) * interval, interval, relative, _NO_MACHINE, constants, flags,
        np.eye(4), states, np.zeros(4),
    )  # fmt: skip
    if done < float(time[-2]):
        raise SolverError(
            f"The listing's equations could not be followed beyond {done:.4g} s at a relative "
            f"tolerance of {relative:g}. Raise the tolerance; the impact law is not well posed."
        )
    states[-1] = state
    theta, theta_rate, psi, psi_rate = states.T
    divisor = force_divisor(parameters, workaround)
    impacts, touching = listing_forces(parameters, defects, time, states, divisor)
    pressing = np.full(time.size, parameters.polishing_force)
    names = ("tilt towards the feed", "roll about the feed")
    variables = {
        **dataset.angle_variables((theta, psi, theta_rate, psi_rate), names, level=UPRIGHT),
        **dataset.force_variables(*impacts.T, pressing),
        "contact": dataset.variable(touching, "1", "whether the point touches", ("time", "point")),
        **dataset.path_variables(time, parameters),
    }
    attributes = {
        "simulator": "listing",
        "disc": "two-angle",
        **dataset.parameter_attributes(parameters),
        "workaround": workaround,
        "defects": " ".join(defects.names()),
        "relative_tolerance": relative,
        **dict(zip(("steps", "refused_steps", "impacts"), counts, strict=True)),
    }
    return dataset.labelled(time, variables, attributes)


def force_divisor(parameters: BrushParameters, workaround: str) -> float:
    """Return what the thesis divides impact forces by (section 9.4.5)."""
    if workaround == "divide":
        return 10000.0
    return 1.0 / parameters.impact_duration if workaround == "impulse" else 1.0


def listing_response(
    A: ArrayLike,
    B1: ArrayLike,
    C: ArrayLike,
    brush: xr.Dataset,
    *,
    bearing_mass: float | None = None,
    tolerance: float = 1e-3,
    sample_rate: float = 20e3,
) -> xr.Dataset:
    r"""Simulate x' = A x + B1 F(t, x), y = C x from rest under the listing's forces.

    The forces are evaluated inside the right-hand side from the stored brush states, which the
    listings interpolate wrongly (`ListingDefects.interpolation_weight`), so that they jump from
    one evaluation to the next. The answer therefore belongs to this integrator, ode45, and
    its tolerance; it is a reproduction, not a simulation. For any other purpose use an exact linear
    response to a `physical` run.

    Parameters
    ----------
    A : array_like, shape (12, 12)
        Closed or open loop; states (x_m, x_m', x, x', y_m, ..., z, z').
    B1 : array_like, shape (12, 4)
        How F_x, F_y, F_z, F_p [N] enter; the thesis has (10.39) with a controller, where F_y
        drives x, and (8.47) without.
    C : array_like, shape (p, 12)
        Outputs. The tables of chapter 11 show the total displacements x_m + x, y_m + y, z_m + z.
    brush : xarray.Dataset
        From ``simulate_brush("listing", ...)``; its attributes tell the mistakes and the
        workaround. The tables need its default sample rate, 1e5 Hz.
    bearing_mass : float, optional
        m_z [kg]: follow D.2, the loop without controller, where F_p and F_z change when the
        brush is up. Without it follow D.3, the loop with one.
    tolerance : float
        Relative tolerance of ode45; the thesis's is 1e-3.
    sample_rate : float
        Samples of the result per second [Hz].

    Returns
    -------
    xarray.Dataset
        `response` along `time` [s] and `output`, and `largest`, the largest magnitude of each
        output, read at the samples and at four points of every step of the solver.

    Raises
    ------
    InvalidInputError
        If a shape is wrong or `brush` comes from the other simulator.
    SolverError
        If the steps become too small, as for an unstable loop.

    Examples
    --------
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> from robustpolish.polishing import listing_response
    >>> brush = rp.polishing.simulate_brush("listing", run=1, duration=0.01)
    >>> A = np.kron(np.eye(6), [[0.0, 1.0], [-1e4, -20.0]])
    >>> B1 = np.zeros((12, 4))
    >>> B1[11, 2] = 1.0
    >>> answer = listing_response(A, B1, np.eye(12)[[10]], brush)
    >>> answer.response.sizes["time"], bool(answer.largest[0] > 0)
    (201, True)
    """
    A = matrix("A", A, (12, 12))
    B1 = matrix("B1", B1, (12, 4))
    C = matrix("C", C, (None, 12))
    relative = positive("tolerance", tolerance)
    rate = positive("sample_rate", sample_rate, "Hz")
    if brush.attrs.get("simulator") != "listing":
        shown = described(f"simulator {brush.attrs.get('simulator')!r}")
        expected = "a dataset of the listing simulator"
        raise invalid("brush", shown, expected, 'Make it with simulate_brush("listing", ...).')
    mass = 0.0 if bearing_mass is None else positive("bearing_mass", bearing_mass, "kg")
    parameters = dataset.parameters_from_attributes(brush.attrs)
    defects = ListingDefects.none(but=tuple(brush.attrs["defects"].split()))
    names = ("theta", "theta_rate", "psi", "psi_rate")
    stored = np.stack([brush[name].values for name in names], axis=1)
    spacing, duration = float(brush.time[1] - brush.time[0]), float(brush.time[-1])
    samples = np.linspace(0.0, duration, max(1, round(duration * rate)) + 1)
    response, largest = np.zeros((samples.size, len(C))), np.zeros(len(C))
    divisor = force_divisor(parameters, brush.attrs["workaround"])
    done, *_ = _ode45(
        np.zeros(12), samples, np.inf, relative, (A, B1, stored, spacing, divisor, mass),
        *listing_constants(parameters, defects), C, response, largest,
    )  # fmt: skip
    if done < duration:
        raise SolverError(
            f"The loop could not be followed beyond {done:.4g} s. Check that it is stable."
        )
    outputs = ("time", "output")
    return xr.Dataset(
        {
            "response": dataset.variable(response, "unit of C x", "outputs", outputs),
            "largest": dataset.variable(largest, "unit of C x", "largest magnitude", "output"),
        },
        {"time": ("time", samples, {"units": "s"})},
        {"tolerance": relative, "workaround": brush.attrs["workaround"]},
    )
