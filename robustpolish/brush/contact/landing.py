"""A pressed mass lands on a surface that obeys a contact law."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from scipy.integrate import solve_ivp

from robustpolish.arrays import Vector
from robustpolish.brush.contact.impact import quarter_period
from robustpolish.brush.contact.laws import (
    ContactLaw,
    EventImpulse,
    HuntCrossley,
    LinearSpring,
    ListingImpulse,
)
from robustpolish.validation import invalid, positive


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
    >>> from robustpolish.brush import EventImpulse, land
    >>> run = land(EventImpulse(1e6, 0.5), mass=0.05, speed=0.1, press=10.0, duration=0.01)
    >>> bool(abs(run.impulse[-1] - (10.0 * 0.01 + 0.05 * 0.1)) < 1e-12)  # at rest in the end
    True
    """
    mass, speed = positive("mass", mass, "kg"), positive("speed", speed, "m/s")
    press, duration = positive("press", press, "N"), positive("duration", duration, "s")
    if not isinstance(samples, int) or samples < 2:
        raise invalid("samples", samples, "an integer of at least 2", "Ask for more.")
    time = np.linspace(0.0, duration, samples)
    if isinstance(law, EventImpulse):
        impulse = _events(law, mass, speed, press, time)
    else:
        impulse = _integrated(law, mass, speed, press, time)
    velocity = speed + (press * time - impulse) / mass
    force = np.concatenate([[0.0], np.diff(impulse) / np.diff(time)])
    return xr.Dataset(
        {
            "impulse": ("time", impulse, {"units": "N s"}),
            "force": ("time", force, {"units": "N"}),
            "velocity": ("time", velocity, {"units": "m/s"}),
        },
        {"time": ("time", time, {"units": "s"})},
    )


def _integrated(
    law: LinearSpring | HuntCrossley | ListingImpulse,
    mass: float,
    speed: float,
    press: float,
    time: Vector,
) -> Vector:
    """Impulse of a law of depth and rate: contacts integrated, flights in closed form."""

    def slope(_: float, state: Vector) -> list[float]:
        push = law.force(float(state[0]), float(state[1]))
        return [state[1], (press - push) / mass, push]

    leaves = _leaving()
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


def _leaving() -> Any:
    """Event at which the mass comes back to the surface from below."""

    def leaves(_: float, state: Vector) -> float:
        return float(state[0])

    leaves.terminal, leaves.direction = True, -1.0  # type: ignore[attr-defined]
    return leaves


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
