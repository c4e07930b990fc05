"""The thesis's static contact: resultant forces on the edge of the friction cone (section 7.2)."""

from __future__ import annotations

from dataclasses import dataclass
from math import asin, atan, cos, inf, sin

from robustpolish.brush.contact.friction_cone import FrictionCone
from robustpolish.brush.parameters import BrushParameters
from robustpolish.validation import described, instance_of, invalid, positive

_PARALLEL = 1e-12  # sine of the angle between two forces below which they cannot balance a third


@dataclass(frozen=True)
class ResultantForces:
    """Forces at C1 (ahead), C2 (behind) and the tilting point C3 or C4, and what they add up to.

    Attributes
    ----------
    ahead, behind, side : float
        Magnitudes at C1, C2 and C3 or C4 [N]; `side` is negative at C4 (7.22 to 7.27).
    alpha, beta, delta : float
        Angles of the three from the polishing force [rad].
    tilting : bool
        Whether C3 or C4 touches.
    pulls : bool
        Whether the equations make the surface pull at C1, which no surface does.
    moment_x, moment_y : float
        About the ball joint [N m] (7.29, 7.30).
    F_x, F_y, F_z : float
        As the thesis adds them up [N] (7.32 to 7.34): magnitudes, without regard to their signs.
    forward : float
        What C1 and C2 push the tool with along the feed [N]: zero where they balance (7.5).
    """

    ahead: float
    behind: float
    side: float
    alpha: float
    beta: float
    delta: float
    tilting: bool
    pulls: bool
    moment_x: float
    moment_y: float
    F_x: float
    F_y: float
    F_z: float
    forward: float


def rolling_angle(roll: float, tilt: float) -> float:
    """Part of the precession that rolls the disc about the feed, gamma (7.11).

    Parameters
    ----------
    roll : float
        psi - psi_0 [rad].
    tilt : float
        theta [rad].

    Returns
    -------
    float
        In rad.

    Examples
    --------
    >>> from math import pi
    >>> from robustpolish.brush import rolling_angle
    >>> round(rolling_angle(0.3, pi / 2), 12)  # a disc on its edge rolls by all of it
    0.3
    """
    return asin(sin(roll) * sin(tilt))


def resultant_forces(
    parameters: BrushParameters | None = None,
    *,
    ahead: float,
    behind: float,
    side: float = 0.0,
    roll: float = 0.0,
    share: float = 0.5,
    unilateral: bool = True,
) -> ResultantForces:
    """Balance the polishing force by forces that lean on the friction cone, (7.4) to (7.34).

    Parameters
    ----------
    parameters : BrushParameters, optional
        Polishing force, friction and size of the disc.
    ahead, behind, side : float
        Elevation xi of the surface [rad] at C1, C2 and the tilting point.
    roll : float, optional
        gamma [rad], see :func:`rolling_angle`; above zero C3 goes down.
    share : float, optional
        n of (7.21), 0 to 1: how much the height of the joint over the tilting point follows from
        the surface there.
    unilateral : bool, optional
        Where C1 would have to pull, leave it out: C2 alone then carries the load, and
        `forward` is what is left over for the robot to hold. Otherwise follow the thesis.

    Returns
    -------
    ResultantForces

    Raises
    ------
    InvalidInputError
        If an angle is not below 1.5 rad, or if C1 and C2 are parallel, as on a level surface,
        where (7.8) divides by zero: its forces grow without bounds towards it.

    References
    ----------
    M.L. Postma, Polishing robot: vibrations due to impact, sections 7.2.1 to 7.2.3.

    Examples
    --------
    >>> import robustpolish as rp
    >>> brush = rp.BrushParameters(friction=0.1)
    >>> found = rp.resultant_forces(brush, ahead=0.3, behind=0.3)
    >>> round(found.ahead, 3), round(found.behind, 3), found.tilting
    (3.524, 6.891, False)
    >>> doubtful = rp.resultant_forces(ahead=0.01, behind=0.01, unilateral=False)
    >>> doubtful.pulls, round(doubtful.ahead), round(doubtful.behind)
    (True, -162, 171)
    """
    p = BrushParameters() if parameters is None else parameters
    remedy = "Build them with BrushParameters(...)."
    instance_of("parameters", p, BrushParameters, "BrushParameters", remedy)
    angles = {"ahead": ahead, "behind": behind, "side": side, "roll": roll}
    for name, value in angles.items():
        if not abs(value) < 1.5:
            raise invalid(name, value, "an angle below 1.5 rad", "Give it in rad.")
    if not positive("share", share, zero=True) <= 1.0:
        raise invalid("share", share, "0 to 1", "Choose the share of (7.21).")
    sigma = FrictionCone(p.friction).angle
    alpha, beta, delta = behind - sigma, ahead + sigma, side + sigma
    height = share * p.radius * sin(side) + (1.0 - share) * p.radius * sin(ahead)
    tilting = roll != 0.0 and height <= p.rim_distance * abs(sin(roll))
    at_side, pressed = 0.0, p.polishing_force
    if tilting:
        at_side = p.polishing_force * _ratio(sin(roll), sin(delta), "side")
        pressed = p.polishing_force * cos(roll) - abs(at_side) * cos(delta)
    behind_force = pressed * _ratio(sin(beta), sin(alpha + beta), "ahead")
    ahead_force = pressed / cos(beta) - cos(alpha) / cos(beta) * behind_force
    pulls = ahead_force < 0.0 or behind_force < 0.0
    if pulls and unilateral:
        only_behind = ahead_force < 0.0
        ahead_force = 0.0 if only_behind else pressed / cos(beta)
        behind_force = pressed / cos(alpha) if only_behind else 0.0
    lean = atan(p.height / (2.0 * p.radius))
    moment = ahead_force * cos(beta + lean) - behind_force * cos(alpha + lean)
    up = abs(ahead_force) * cos(beta) + abs(behind_force) * cos(alpha)
    return ResultantForces(
        ahead=ahead_force,
        behind=behind_force,
        side=at_side,
        alpha=alpha,
        beta=beta,
        delta=delta,
        tilting=tilting,
        pulls=pulls,
        moment_x=moment * p.rim_distance,
        moment_y=-at_side * cos(delta + lean) * p.rim_distance,
        F_x=at_side * sin(delta),
        F_y=ahead_force * sin(beta) + behind_force * sin(alpha),
        F_z=up + abs(at_side) * cos(delta),
        forward=behind_force * sin(alpha) - ahead_force * sin(beta),
    )


def _ratio(upper: float, lower: float, name: str) -> float:
    """Divide, or say which elevation makes the balance impossible."""
    found = upper / lower if abs(lower) > _PARALLEL else inf
    if abs(found) == inf:
        raise invalid(
            name,
            described("forces that are parallel to each other, as on a level surface"),
            "an elevation at which they can balance the polishing force",
            "Use the physical brush, whose contact is well posed on every surface.",
        )
    return found
