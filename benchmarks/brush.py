"""The polishing brush against scipy's RK45 on the same compiled right-hand side.

Ours is the method of Dormand and Prince too, compiled with its loop. Errors are those of the
impulse of the contact over 10 ms, on the same nodes along the rim, measured by RK45 at a tolerance
of 1e-10; RK45 gets the loosest tolerance of a list that errs no more than ours. Neither may step
past a sample. What the nodes themselves leave out is told beside it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp

import robustpolish as rp
from benchmarks.row import Row, milliseconds, once
from robustpolish.polishing import contact as disc
from robustpolish.polishing import contact as rim
from robustpolish.polishing.brush import (
    PhysicalRun,
    contact_constants,
    impulse_difference,
    integrate,
    motion_constants,
    rim_points,
)

RATE = 20e3
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)


def runge_kutta(
    parameters: rp.polishing.BrushParameters, first: np.ndarray, time: np.ndarray, rtol: float
):
    """Return the states at the samples by scipy's RK45."""
    contact, motion = contact_constants(parameters), motion_constants(parameters, False)
    nodes = rim.rim_nodes(rim_points(parameters))
    found, room = rim.work_array(nodes.shape[1]), np.zeros((3, rim.LOADS))

    def rate(t, state):
        result = np.zeros(disc.STATES)
        disc.slope(t, state, motion, contact, nodes, found, room, result)
        return result

    size = np.maximum(np.abs(first), 1e-4)
    answer = solve_ivp(
        rate, (0, time[-1]), first, "RK45", time, rtol=rtol, atol=rtol * size, max_step=time[1]
    )
    return answer.y.T


def _error(
    run: PhysicalRun, measure: np.ndarray, parameters: rp.polishing.BrushParameters
) -> float:
    """Return the largest difference of impulses over 10 ms, relative to the polishing force's."""
    return impulse_difference(run, replace(run, track=measure), parameters.polishing_force)


def rows(quick: bool) -> Iterator[Row]:
    """Time both on the softest and a stiffer brush."""
    seconds = 0.05 if quick else 0.5
    time = np.arange(round(seconds * RATE) + 1) / RATE
    for stiffness in (1e4, 1e6):
        parameters = rp.polishing.BrushParameters(contact_stiffness=stiffness)
        ours = milliseconds(3, integrate, parameters, time, 0)
        run, exact = integrate(parameters, time, 0), integrate(parameters, time, 2)
        nodes = _error(run, exact.track, parameters)
        # The nodes are those of the coarse run for both, so RK45's own limit is the measure.
        measure = runge_kutta(parameters, run.track[0], time, 1e-10)
        own = _error(run, measure, parameters)
        for rtol in TOLERANCES:
            spent, track = once(runge_kutta, parameters, run.track[0], time, rtol)
            theirs = _error(replace(run, track=track), measure, parameters)
            if theirs <= own:
                break
        yield Row(
            "brush", f"brush of {stiffness:g} N/m, {seconds:g} s at 20 kHz",
            "rp.polishing.simulate_brush, one pass", ours, f"solve_ivp RK45, rtol {rtol:g}", spent,
            f"impulses err by {own:.0e}, RK45's by {theirs:.0e} (the rim's nodes: {nodes:.0e})",
        )  # fmt: skip
