"""Contact laws of the thesis, its listings, and Hunt and Crossley: restitution and landing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import asin, atan, cos, expm1, inf, log1p, pi, sin, sqrt
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike
from scipy import optimize
from scipy.integrate import cumulative_trapezoid, solve_ivp

from robustpolish.base.arrays import ROUNDING, Matrix, Vector
from robustpolish.base.budget import progress_bar
from robustpolish.base.checks import described, invalid, one_of, positive, whole_number
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.plots.charts import plot_bars
from robustpolish.plots.time import plot_time_series
from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.quantities import check_quantities, or_default
from robustpolish.polishing.simulate import simulate_brush
from robustpolish.polishing.surfaces.surface import Surface
from robustpolish.polishing.thesis.listing import ListingDefects, listing_forces

# Coulomb friction cone (section 7.1).


@dataclass(frozen=True)
class FrictionCone:
    """The forces that dry contact can carry: within an angle sigma of the normal.

    Parameters
    ----------
    friction : float
        Coefficient mu [-].

    Raises
    ------
    InvalidInputError
        If it is negative or not finite.

    References
    ----------
    M.L. Postma, Polishing robot: vibrations due to impact, (7.1) to (7.3).

    Examples
    --------
    >>> from robustpolish.polishing import FrictionCone
    >>> cone = FrictionCone(0.5)
    >>> round(cone.angle, 6), cone.holds([0.4, 0, 1], normal=[0, 0, 1])
    (0.463648, True)
    >>> cone.sliding(10.0, slip=[3.0, 0, 0], normal=[0, 0, 1]).tolist()
    [-5.0, 0.0, 10.0]
    """

    friction: float = field(metadata={"unit": "-"})

    def __post_init__(self) -> None:
        check_quantities(self, "FrictionCone.", zero=("friction",))

    @property
    def angle(self) -> float:
        """Angle of friction sigma [rad], tan(sigma) = mu (7.3)."""
        return atan(self.friction)

    def holds(self, force: ArrayLike, normal: ArrayLike) -> bool:
        """Whether contact carries a force without sliding: it pushes, and lies in the cone.

        Parameters
        ----------
        force : array_like, shape (3,)
            On the body that touches [N].
        normal : array_like, shape (3,)
            Of the surface, towards the body; of any length but zero.

        Returns
        -------
        bool
        """
        pushing, along = _parts(force, normal)
        return bool(pushing >= 0.0 and np.linalg.norm(along) <= self.friction * pushing)

    def sliding(self, normal_force: float, slip: ArrayLike, normal: ArrayLike) -> Vector:
        """Force of a contact that slides: on the edge of the cone, against the slip (7.2).

        Parameters
        ----------
        normal_force : float
            Above zero or zero [N].
        slip : array_like, shape (3,)
            Velocity of the body over the surface [m/s]; its part along the normal is left out.
        normal : array_like, shape (3,)
            Of the surface, towards the body; of any length but zero.

        Returns
        -------
        ndarray, shape (3,)
            In N.

        Raises
        ------
        InvalidInputError
            If nothing slips: then the cone says no more than a bound.
        """
        pushed = positive("normal_force", normal_force, "N", zero=True)
        _, along = _parts(slip, normal)
        speed = float(np.linalg.norm(along))
        if speed == 0.0:
            raise invalid("slip", slip, "a velocity along the surface", "Ask `holds` at rest.")
        unit = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
        return pushed * (unit - self.friction * along / speed)


def _parts(vector: ArrayLike, normal: ArrayLike) -> tuple[float, Vector]:
    """Component along the normal, and what is across it."""
    given, axis = np.asarray(vector, dtype=float), np.asarray(normal, dtype=float)
    length = np.linalg.norm(axis)
    if given.shape != (3,) or axis.shape != (3,) or not length > 0.0:
        shown = described(f"shapes {given.shape} and {axis.shape}, length {length:g}")
        raise invalid("normal", shown, "two vectors of shape (3,), a normal above 0", "Give both.")
    along = float(given @ axis / length)
    return along, given - along * axis / length


# Mass, duration and depth of an impact (section 7.5).


def rim_mass(parameters: BrushParameters) -> float:
    """Mass that a blow at the rim meets when the disc tilts about its joint, I_0 / r^2.

    Parameters
    ----------
    parameters : BrushParameters

    Returns
    -------
    float
        In kg; 0.053 for the thesis's disc, of which the listings let all 0.2 kg hit.

    Examples
    --------
    >>> import robustpolish as rp
    >>> from robustpolish.polishing import rim_mass
    >>> round(rim_mass(rp.polishing.BrushParameters()), 4)
    0.0533
    """
    return parameters.tilt_inertia / parameters.rim_distance**2


def quarter_period(mass: float, stiffness: float) -> float:
    """Duration t_m [s] of an impact as the thesis takes it, (7.39) and (7.40): until the rest.

    Parameters
    ----------
    mass : float
        In kg.
    stiffness : float
        k_p in N/m.

    Returns
    -------
    float
        In s.

    Examples
    --------
    >>> from robustpolish.polishing import quarter_period
    >>> round(1e3 * quarter_period(0.2, 1e4), 3)
    7.025
    """
    return 0.5 * pi * sqrt(positive("mass", mass, "kg") / positive("stiffness", stiffness, "N/m"))


def impact_depth(mass: float, stiffness: float, speed: float) -> float:
    """Largest deflection d_max [m] of a linear spring by a blow, (7.41) to (7.43).

    Parameters
    ----------
    mass : float
        In kg.
    stiffness : float
        k_p in N/m.
    speed : float
        In m/s.

    Returns
    -------
    float
        In m.

    Examples
    --------
    >>> from robustpolish.polishing import impact_depth
    >>> round(impact_depth(0.2, 1e8, 1.0), 9)
    4.4721e-05
    """
    mass, stiffness = positive("mass", mass, "kg"), positive("stiffness", stiffness, "N/m")
    return sqrt(mass / stiffness) * abs(speed)


# Contact laws: force over depth and rate, and coefficient of restitution.

# Untyped on purpose: checkers would read all of scipy's solvers for what it returns.
_brentq: Any = optimize.brentq


class _Law:
    """Numbers of a law: stiffness and mass above zero, the rest not below."""

    def __post_init__(self) -> None:
        check_quantities(self, f"{type(self).__name__}.", zero=("damping", "returned"))


@dataclass(frozen=True)
class HuntCrossley(_Law):
    """A spring whose damping grows with depth: k_p depth (1 + chi rate), never below zero.

    Unlike a damper beside the spring it neither begins with a jump nor ends by pulling.

    Parameters
    ----------
    stiffness : float
        k_p in N/m.
    damping : float
        chi in s/m.

    References
    ----------
    K. H. Hunt and F. R. E. Crossley, Coefficient of restitution interpreted as damping in
    vibroimpact, Journal of Applied Mechanics 42 (1975).

    Examples
    --------
    >>> from robustpolish.polishing import HuntCrossley
    >>> law = HuntCrossley.of_restitution(1e6, 0.5, speed=0.1)
    >>> round(law.restitution(0.1), 12), round(law.damping, 2)
    (0.5, 14.33)
    """

    stiffness: float
    damping: float

    @classmethod
    def of_restitution(cls, stiffness: float, restitution: float, speed: float) -> HuntCrossley:
        """Find the damping that leaves a share of the speed of a blow.

        Parameters
        ----------
        stiffness : float
            In N/m.
        restitution : float
            Between 0 and 1, both excluded.
        speed : float
            Of the blow [m/s].

        Returns
        -------
        HuntCrossley
        """
        if not 0.0 < restitution < 1.0:
            expected = "a share between 0 and 1, both excluded"
            raise invalid("restitution", restitution, expected, "Take LinearSpring for 1.")
        rate = positive("speed", speed, "m/s")
        # e falls as chi v grows, from 1 at 0; e chi v stays below 1.
        strength = _brentq(
            lambda s: _left_over(s) - restitution, 1e-9, 2.0 / restitution, xtol=1e-14
        )
        return cls(stiffness, float(strength) / rate)

    def force(self, depth: float, rate: float) -> float:
        """Return the push.

        Parameters
        ----------
        depth : float
            Below the surface [m].
        rate : float
            Of the depth [m/s].

        Returns
        -------
        float
            In N.
        """
        return max(0.0, self.stiffness * depth) * max(0.0, 1.0 + self.damping * rate)

    def restitution(self, speed: float) -> float:
        """Speed after over speed before a blow, from the energy that it loses.

        e with chi v - ln(1 + chi v) = -chi e v - ln(1 - chi e v). It depends on neither mass nor
        stiffness, and is near 1 - 2 chi v / 3 for slow blows.

        Parameters
        ----------
        speed : float
            Of the blow [m/s].

        Returns
        -------
        float
        """
        return _left_over(self.damping * positive("speed", speed, "m/s", zero=True))


@dataclass(frozen=True)
class LinearSpring(HuntCrossley):
    """A spring that pushes only: force k_p times depth, nothing lost.

    Parameters
    ----------
    stiffness : float
        k_p in N/m.

    Attributes
    ----------
    damping : float
        0: a law of Hunt and Crossley that loses nothing.

    Examples
    --------
    >>> from robustpolish.polishing import LinearSpring
    >>> LinearSpring(1e4).force(0.001, 0.0), LinearSpring(1e4).restitution(3.0)
    (10.0, 1.0)
    """

    damping: float = field(default=0.0, init=False, repr=False)


@dataclass(frozen=True)
class EventImpulse(_Law):
    """Impulse and duration, (7.37) to (7.40), as one event per blow.

    When the mass arrives with speed v its velocity is reversed to e v, once; the impulse
    (1 + e) m v is shown as a force over t_m. The thesis has e = 0.

    Parameters
    ----------
    stiffness : float
        k_p in N/m, which makes t_m.
    returned : float
        Restitution e, 0 to below 1.

    Examples
    --------
    >>> from robustpolish.polishing import EventImpulse
    >>> EventImpulse(1e4).restitution(1.0)
    0.0
    """

    stiffness: float
    returned: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.returned >= 1.0:
            expected = "a share below 1, or bounces never end"
            raise invalid("EventImpulse.returned", self.returned, expected, "Lower it.")

    def restitution(self, speed: float) -> float:
        """Speed after over speed before a blow.

        Parameters
        ----------
        speed : float
            Of the blow [m/s].

        Returns
        -------
        float
        """
        return self.returned


@dataclass(frozen=True)
class ListingImpulse(_Law):
    """The same impulse as listing D.1 has it: force m v / t_m for as long as contact lasts.

    That is a damper of m / t_m: it never lets go, and its force is as large as the speed that
    other forces keep up, however long.

    Parameters
    ----------
    stiffness : float
        k_p in N/m, which makes t_m.
    mass : float
        That counts as hitting [kg].

    Examples
    --------
    >>> from robustpolish.polishing import ListingImpulse
    >>> round(ListingImpulse(1e4, 0.2).force(0.001, 1.0), 2)
    28.47
    """

    stiffness: float
    mass: float

    def force(self, depth: float, rate: float) -> float:
        """Return the push; a mass that leaves is held back.

        Parameters
        ----------
        depth : float
            Below the surface [m].
        rate : float
            Of the depth [m/s].

        Returns
        -------
        float
            In N.
        """
        return self.mass * rate / quarter_period(self.mass, self.stiffness) if depth > 0.0 else 0.0

    def restitution(self, speed: float) -> float:
        """Speed after over speed before a blow: 0, the mass stays.

        Parameters
        ----------
        speed : float
            Of the blow [m/s].

        Returns
        -------
        float
        """
        return 0.0


ContactLaw = LinearSpring | HuntCrossley | EventImpulse | ListingImpulse


def _left_over(strength: float) -> float:
    """Solve s - ln(1 + s) = -s e - ln(1 - s e) for e, with s = chi v: energy lost in a blow."""
    if strength < 1e-4:  # the logarithms cancel there; the rest of the series is below 1e-12
        return 1.0 - 2.0 * strength / 3.0 + 4.0 * strength**2 / 9.0
    spent = strength - log1p(strength)
    # With b = -ln(1 - s e) > 0, s e = 1 - exp(-b): no root is lost next to s e = 1.
    found = _brentq(lambda b: b + expm1(-b) - spent, 0.0, strength + 2.0, xtol=1e-15)
    return -expm1(-float(found)) / strength


# Landing of a pressed mass.


def land(
    law: ContactLaw, mass: float, speed: float, press: float, duration: float, samples: int = 2001
) -> xr.Dataset:
    """Let a mass arrive at a surface that obeys a contact law, pressed on by a steady force.

    Parameters
    ----------
    law : LinearSpring, HuntCrossley, EventImpulse or ListingImpulse
    mass : float
        In kg.
    speed : float
        Of arrival [m/s].
    press : float
        In N.
    duration : float
        Simulated time [s].
    samples : int, optional
        Of the result; forces are averaged over each interval, so that they have the impulse of the
        contact.

    Returns
    -------
    xarray.Dataset
        `impulse` [N s] of the contact since the arrival, and `force` [N] and `velocity` [m/s],
        towards the surface, along `time` [s].

    Raises
    ------
    InvalidInputError
        If a number is out of its range.

    Notes
    -----
    Laws of depth are integrated; the impulse law is followed from event to event in closed form.
    Bounces that last less than t_m end in rest, with an impulse that takes the last speed.

    Examples
    --------
    >>> from robustpolish.polishing import EventImpulse, land
    >>> run = land(EventImpulse(1e6, 0.5), mass=0.05, speed=0.1, press=10.0, duration=0.01)
    >>> bool(abs(run.impulse[-1] - (10.0 * 0.01 + 0.05 * 0.1)) < 1e-12)  # at rest in the end
    True
    """
    mass, speed = positive("mass", mass, "kg"), positive("speed", speed, "m/s")
    press, duration = positive("press", press, "N"), positive("duration", duration, "s")
    whole_number("samples", samples, 2, remedy="Ask for more.")
    time = np.linspace(0.0, duration, samples)
    followed: Any = _events if isinstance(law, EventImpulse) else _integrated
    impulse = followed(law, mass, speed, press, time)
    velocity = speed + (press * time - impulse) / mass
    force = np.concatenate([[0.0], np.diff(impulse) / np.diff(time)])
    signals = {"impulse": (impulse, "N s"), "force": (force, "N"), "velocity": (velocity, "m/s")}
    variables = {name: ("time", y, {"units": unit}) for name, (y, unit) in signals.items()}
    return xr.Dataset(variables, {"time": ("time", time, {"units": "s"})})


def _integrated(law: Any, mass: float, speed: float, press: float, time: Vector) -> Vector:
    """Impulse of a law of depth and rate: contacts integrated, flights in closed form."""

    def slope(_: float, state: Vector) -> list[float]:
        push = law.force(float(state[0]), float(state[1]))
        return [state[1], (press - push) / mass, push]

    def leaves(_: float, state: Vector) -> float:
        return float(state[0])

    # The mass comes back to the surface from below.
    leaves.terminal, leaves.direction = True, -1.0  # type: ignore[attr-defined]
    impulse = np.zeros_like(time)
    moment, total = 0.0, 0.0
    while moment < time[-1]:
        depth = speed * np.sqrt(mass / law.stiffness) + press / law.stiffness
        answer = solve_ivp(
            slope, (moment, time[-1]), [0.0, speed, total], method="LSODA", events=leaves,
            t_eval=np.append(time[(time > moment) & (time < time[-1])], time[-1]),
            first_step=1e-3 * quarter_period(mass, law.stiffness), rtol=1e-9,
            atol=np.array([1e-9 * depth, 1e-9 * speed, 1e-9 * mass * speed]),
        )  # fmt: skip
        if len(answer.t):  # a contact may be over before the next sample
            impulse[np.searchsorted(time, answer.t)] = answer.y[2]
        if not answer.t_events[0].size:
            return impulse
        moment, (_, rate, total) = float(answer.t_events[0][0]), answer.y_events[0][0]
        impulse[time >= moment] = total
        speed = -float(rate)
        moment += 2.0 * speed * mass / press
    return impulse


def _events(law: EventImpulse, mass: float, speed: float, press: float, time: Vector) -> Vector:
    """Impulse of one event per blow at the times, each spread over t_m."""
    lasting = quarter_period(mass, law.stiffness)
    moment, impulse = 0.0, np.zeros_like(time)
    while moment < time[-1]:
        flight = 2.0 * law.returned * speed * mass / press
        rests = flight <= lasting
        blow = mass * speed * (1.0 if rests else 1.0 + law.returned)
        impulse += blow * np.clip((time - moment) / lasting, 0.0, 1.0)
        if rests:
            return impulse + press * np.maximum(time - moment, 0.0)
        moment, speed = moment + flight, law.returned * speed
    return impulse


# Comparison of one landing under every contact law.

_FIGURES = {"peak": "N", "restitution": "1", "window_impulse": "N s", "impulse": "N s"}
_WINDOW = 0.01  # seconds over which impulses are compared, as of the brush


@dataclass(frozen=True, eq=False, repr=False)
class ContactComparison(Displayed):
    """One landing under several laws of contact.

    Attributes
    ----------
    table : xarray.Dataset
        Over `law`: `peak` force [N] and `restitution` of the first blow, `window_impulse`, the
        largest impulse over 10 ms [N s], and `impulse` over all of the run [N s].
    runs : mapping of str to xarray.Dataset
        From :func:`land`.

    Examples
    --------
    >>> import robustpolish as rp
    >>> comparison = rp.polishing.compare_contact_laws(rp.polishing.BrushParameters.for_run(2))
    >>> [str(name) for name in comparison.table["law"].values][:2]
    ['spring', 'Hunt-Crossley']
    """

    table: xr.Dataset
    runs: Mapping[str, xr.Dataset]

    def plot(self, ax: Axes | None = None, *, signal: str = "force") -> Axes:
        """Draw one signal of every law over time.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        signal : {"force", "impulse", "velocity"}, optional

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.polishing.compare_contact_laws(duration=0.005).plot(signal="impulse").get_xlabel()
        'time [ms]'
        """
        return plot_time_series({name: run[signal] for name, run in self.runs.items()}, ax=ax)

    def _card(self) -> Card:
        rows = zip(*(self.table[key].values.tolist() for key in ("law", *_FIGURES)), strict=True)
        head = ("law", "peak [N]", "restitution", "most in 10 ms [N s]", "impulse [N s]")
        return Card("Contact laws side by side", (Table("", head, tuple(rows)),), ())


def compare_contact_laws(
    parameters: BrushParameters | None = None,
    *,
    speed: float = 0.05,
    duration: float = 0.05,
    restitution: float = 0.5,
) -> ContactComparison:
    """Let the rim of the disc land under every law with the same stiffness.

    Parameters
    ----------
    parameters : BrushParameters, optional
        Stiffness, damping, polishing force, and the mass at the rim, I_0 / r^2.
    speed : float, optional
        Of arrival [m/s].
    duration : float, optional
        Simulated time [s].
    restitution : float, optional
        Of the bouncing impulse, 0 to below 1.

    Returns
    -------
    ContactComparison
        "spring", "Hunt-Crossley", "impulse", "impulse, bouncing", "impulse as listed" and "impulse
        as listed, whole mass", which is what listing D.1 lets hit.

    Raises
    ------
    InvalidInputError
        If a number is out of its range.

    Examples
    --------
    >>> import robustpolish as rp
    >>> table = rp.polishing.compare_contact_laws().table
    >>> bool(table["peak"].sel(law="spring") > 10)
    True
    """
    p = BrushParameters() if parameters is None else parameters
    mass, k, press = rim_mass(p), p.contact_stiffness, p.polishing_force
    laws: dict[str, ContactLaw] = {
        "spring": LinearSpring(k),
        "Hunt-Crossley": HuntCrossley(k, p.contact_damping),
        "impulse": EventImpulse(k),
        "impulse, bouncing": EventImpulse(k, restitution),
        "impulse as listed": ListingImpulse(k, mass),
        "impulse as listed, whole mass": ListingImpulse(k, p.mass),
    }
    closely = 8.0 * quarter_period(p.mass, k)  # a peak needs finer samples than a landing
    runs, rows = {}, []
    for name, law in laws.items():
        runs[name] = land(law, mass, speed, press, duration)
        impulse, interval = runs[name].impulse.to_numpy(), float(runs[name].time[1])
        peak = float(land(law, mass, speed, press, closely).force.max())
        most = most_impulse(impulse, interval)
        rows.append((peak, law.restitution(speed), most, float(impulse[-1])))
    columns = zip(_FIGURES.items(), np.array(rows).T, strict=True)
    table = {key: ("law", values, {"units": unit}) for (key, unit), values in columns}
    return ContactComparison(xr.Dataset(table, {"law": list(laws)}), runs)


def most_impulse(impulse: Vector, interval: float) -> float:
    """Return the largest impulse within 10 ms, of one or of several columns.

    Parameters
    ----------
    impulse : ndarray, shape (samples,) or (samples, n)
        Since the beginning [N s].
    interval : float
        Between samples [s].

    Returns
    -------
    float
        In N s.
    """
    samples = max(1, min(round(_WINDOW / interval), len(impulse) - 1))
    return float(np.max(np.abs(impulse[samples:] - impulse[:-samples])))


# Static contact: resultant forces on the edge of the friction cone (section 7.2).


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
    >>> from robustpolish.polishing import rolling_angle
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
    >>> brush = rp.polishing.BrushParameters(friction=0.1)
    >>> found = rp.polishing.resultant_forces(brush, ahead=0.3, behind=0.3)
    >>> round(found.ahead, 3), round(found.behind, 3), found.tilting
    (3.524, 6.891, False)
    >>> doubtful = rp.polishing.resultant_forces(ahead=0.01, behind=0.01, unilateral=False)
    >>> doubtful.pulls, round(doubtful.ahead), round(doubtful.behind)
    (True, -162, 171)
    """
    p = or_default("parameters", parameters, BrushParameters)
    for name, value in {"ahead": ahead, "behind": behind, "side": side, "roll": roll}.items():
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
    at_c2 = pressed * _ratio(sin(beta), sin(alpha + beta), "ahead")
    at_c1 = pressed / cos(beta) - cos(alpha) / cos(beta) * at_c2
    pulls = at_c1 < 0.0 or at_c2 < 0.0
    if pulls and unilateral:
        only_c2 = at_c1 < 0.0
        at_c1 = 0.0 if only_c2 else pressed / cos(beta)
        at_c2 = pressed / cos(alpha) if only_c2 else 0.0
    lean = atan(p.height / (2.0 * p.radius))
    moment_x = (at_c1 * cos(beta + lean) - at_c2 * cos(alpha + lean)) * p.rim_distance
    moment_y = -at_side * cos(delta + lean) * p.rim_distance
    F_x, F_y = at_side * sin(delta), at_c1 * sin(beta) + at_c2 * sin(alpha)
    F_z = abs(at_c1) * cos(beta) + abs(at_c2) * cos(alpha) + abs(at_side) * cos(delta)
    forward = at_c2 * sin(alpha) - at_c1 * sin(beta)
    return ResultantForces(
        at_c1, at_c2, at_side, alpha, beta, delta, tilting, pulls, moment_x, moment_y,
        F_x, F_y, F_z, forward,
    )  # fmt: skip


def _ratio(upper: float, lower: float, name: str) -> float:
    """Divide, or say which elevation makes the balance impossible."""
    # sine of the angle between two forces below which they cannot balance a third
    found = upper / lower if abs(lower) > ROUNDING else inf
    if abs(found) == inf:
        shown = described("forces that are parallel to each other, as on a level surface")
        expected = "an elevation at which they can balance the polishing force"
        remedy = "Use the physical brush, whose contact is well posed on every surface."
        raise invalid(name, shown, expected, remedy)
    return found


# Sensitivity of the listing's forces: one cause is changed at a time.

_OF_MOTION = ("tilt_cosine", "inertia_radius", "impact_mass", "pulling_surface", "feed_friction")
"""Mistakes of D.1 that change the brush's own motion and its forces."""

_SPACING = 1e-5  # seconds between stored states, for which the thesis's tables come out


_SUSPECTS = ("code", "duration", "friction", "geometry", "contact law")


@dataclass(frozen=True, eq=False, repr=False)
class ForceStudy(Displayed):
    """What each suspect does to the brush's forces.

    Attributes
    ----------
    table : xarray.Dataset
        Over `row`: `suspect`; `peak`, the largest force of the contact beyond the polishing force
        [N]; `factor`, that over the base row's; `impulse`, the most within 10 ms, beyond the
        polishing force, as a share of the polishing force's.
    run : int
        Of table 9.2.

    Examples
    --------
    >>> import robustpolish as rp
    >>> study = rp.polishing.force_study(duration=0.02, suspects=("friction",))
    >>> study.answer()["friction"] < 10
    True
    """

    table: xr.Dataset
    run: int

    def answer(self) -> dict[str, float]:
        """Return by what factor each suspect can change the peak force, at most.

        Returns
        -------
        dict of str to float
            Largest over smallest peak among the rows of a suspect and the base row.
        """
        peaks = self.table["peak"].values
        found: dict[str, list[float]] = {}
        for name, peak in zip(self.table["suspect"].values[1:], peaks[1:], strict=True):
            found.setdefault(str(name), [peaks[0]]).append(peak)
        return {name: float(max(sizes) / min(sizes)) for name, sizes in found.items()}

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the factors of the suspects as bars.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.polishing.force_study(duration=0.02, suspects=("friction",)).plot().get_xscale()
        'log'
        """
        found = self.answer()
        suspects = {"suspect": list(found)}
        bars = xr.DataArray(
            list(found.values()), suspects, name="factor of the peak", dims="suspect"
        )
        return plot_bars(bars.assign_attrs(units="1"), ax=ax)

    def _card(self) -> Card:
        keys = ("row", "suspect", "peak", "factor", "impulse")
        rows = tuple(zip(*(self.table[key].values.tolist() for key in keys), strict=True))
        head = ("changed", "suspect", "peak [N]", "times the base", "10 ms impulse / (F_p 10 ms)")
        told = [f"{name}: factor {value:.3g}" for name, value in self.answer().items()]
        title = f"Forces beyond the polishing force, run {self.run}"
        return Card(title, (Table("", head, rows, digits=3),), tuple(told))


def force_study(
    run: int = 1,
    duration: float = 0.1,
    *,
    suspects: tuple[str, ...] = _SUSPECTS,
) -> ForceStudy:
    """Change one thing at a time in the listing's brush and compare the forces.

    The thesis leaves open whether its forces are too large by its geometry, its coefficient of
    friction, the duration of impact or something else (section 9.4.5).

    Parameters
    ----------
    run : {1, 2, 3, 4}, optional
        Contact stiffness (table 9.2).
    duration : float, optional
        Simulated time [s]. The listing chatters on its own guard, so that its work grows
        quickly with it.
    suspects : tuple of str, optional
        Among "code", each mistake of the listings mended alone, all of them, and the forces as
        D.2 applies them, from states that it interpolates wrongly; "duration", t_m 10 and 100
        times as long; "friction", mu from 0.1 to 0.707; "geometry", troughs in which the disc
        fits; "contact law", the physical brush on a surface that fits, pressed and landing.

    Returns
    -------
    ForceStudy

    Raises
    ------
    InvalidInputError
        If an argument is out of its range.

    Examples
    --------
    >>> import robustpolish as rp
    >>> study = rp.polishing.force_study(duration=0.02, suspects=("duration",))
    >>> [str(name) for name in study.table["row"].values]
    ['as listed', 't_m 10 times as long', 't_m 100 times as long']
    """
    positive("duration", duration, "s")
    for name in suspects:
        one_of("suspects", name, _SUSPECTS)
    base = BrushParameters.as_published(run)
    press = base.polishing_force
    rows = []
    with progress_bar("Changing one thing at a time"):
        for suspect, row, forces in _rows(base, run, duration, suspects):
            spacing = duration / (len(forces) - 1)
            impulse = cumulative_trapezoid(forces, dx=spacing, axis=0, initial=0.0)
            most = most_impulse(np.asarray(impulse), spacing) / (press * min(0.01, duration))
            rows.append((row, suspect, float(np.max(np.linalg.norm(forces, axis=1))), most))
    names, found, peaks, impulses = zip(*rows, strict=True)
    columns = {
        "suspect": ("row", list(found)),
        "peak": ("row", np.array(peaks), {"units": "N"}),
        "factor": ("row", np.array(peaks) / peaks[0], {"units": "1"}),
        "impulse": ("row", np.array(impulses), {"units": "1"}),
    }
    return ForceStudy(xr.Dataset(columns, {"row": list(names)}), run)


def _rows(
    base: BrushParameters, run: int, duration: float, suspects: tuple[str, ...]
) -> Iterator[tuple[str, str, Matrix]]:
    """Yield suspect, row, and forces beyond the polishing force, shape (n, 3)."""

    def beyond(signals: xr.Dataset) -> Matrix:
        return np.column_stack([signals["F_x"], signals["F_y"], signals["F_z"] - signals["F_p"]])

    def listed(defects: ListingDefects | None = None, **changes: Any) -> Matrix:
        brush = replace(base, **changes)
        return beyond(simulate_brush("listing", None, duration, parameters=brush, defects=defects))

    yield "base", "as listed", listed()
    if "code" in suspects:
        yield "code", "as D.2 applies it", _as_applied(base, duration)
        every = ListingDefects().names()
        for name in _OF_MOTION:
            others = tuple(other for other in every if other != name)
            yield "code", f"{name} mended", listed(ListingDefects.none(but=others))
        yield "code", "all mended", listed(ListingDefects.none())
    if "duration" in suspects:
        for times in (10, 100):
            stiffness = base.contact_stiffness / times**2
            yield "duration", f"t_m {times} times as long", listed(contact_stiffness=stiffness)
    if "friction" in suspects:
        for mu in (0.1, 0.2, 0.5, 0.707):
            yield "friction", f"mu = {mu:g}", listed(friction=mu)
    if "geometry" in suspects:
        for across in (2.5, 1.0):
            surface = Surface(base.trough.along, across)
            row = f"trough of {1e3 * surface.trough_radius:.3g} mm"
            yield "geometry", row, listed(surface=surface)
    if "contact law" in suspects:
        for start in ("pressed", "landing"):
            signals = simulate_brush("physical", run, duration, start=start)
            yield "contact law", f"physical, {start}", beyond(signals)


def _as_applied(parameters: BrushParameters, duration: float) -> Matrix:
    """Return the forces that D.2 applies halfway between stored states, by its wrong weights."""
    signals = simulate_brush(
        "listing", None, duration, parameters=parameters, sample_rate=1.0 / _SPACING
    )
    names = ("theta", "theta_rate", "psi", "psi_rate")
    stored = np.column_stack([signals[name] for name in names])
    later, earlier = 0.5, (1.0 - 0.5 * _SPACING) / _SPACING
    states = later * stored[1:] + earlier * stored[:-1]
    halfway = signals["time"].to_numpy()[:-1] + 0.5 * _SPACING
    forces, _ = listing_forces(parameters, ListingDefects(), halfway, states, 1.0)
    return forces - np.array([0.0, 0.0, parameters.polishing_force])
