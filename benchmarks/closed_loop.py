"""A closed loop over five seconds against general integrators.

The loop is the air bearing under a state feedback, twelve states with modes up to 4.6 kHz, pushed
by forces that are straight lines between samples at 20 kHz. For those our response is exact, and
so is ``control.forced_response``, which is the measure. RK45 gets the loosest relative tolerance
of a list with which its outputs err by at most 1e-6 of their largest value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import control
import numpy as np
import xarray as xr
from scipy.integrate import solve_ivp

import robustpolish as rp
from benchmarks.row import Row, milliseconds, once

RATE = 20e3
ERROR = 1e-6
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)


def forces(count: int, names: list[str]) -> xr.Dataset:
    """Return smooth random forces, up to 200 Hz, in N."""
    rng = np.random.default_rng(0)
    time = np.arange(count) / RATE
    waves = 2 * np.pi * np.geomspace(0.5, 200, 20)
    pushes = {
        name: sum(
            np.cos(wave * time + phase)
            for wave, phase in zip(waves, rng.uniform(0, 2 * np.pi, waves.size), strict=True)
        )
        for name in names
    }
    return xr.Dataset({n: ("time", f) for n, f in pushes.items()}, {"time": time})


def runge_kutta(loop: control.StateSpace, time: np.ndarray, u: np.ndarray, rtol: float):
    """Return the outputs at the samples by scipy's RK45."""
    A, B = np.asarray(loop.A), np.asarray(loop.B)
    step, last = time[1], time.size - 2

    def rate(t, x):
        k = min(int(t / step), last)
        share = t / step - k
        return A @ x + B @ ((1 - share) * u[:, k] + share * u[:, k + 1])

    x0 = np.zeros(A.shape[0])
    # The absolute tolerance follows the sizes of the states, so that units do not matter.
    size = np.abs(control.forced_response(loop, time[:2001], u[:, :2001]).states).max(axis=1)
    atol = rtol * np.maximum(size, 1e-15)
    x = solve_ivp(rate, (0, time[-1]), x0, "RK45", time, rtol=rtol, atol=atol).y
    return np.asarray(loop.C) @ x + np.asarray(loop.D) @ u


def error(found: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest error over the largest value, of the worst output that moves."""
    size = np.abs(exact).max(axis=1)
    return float(np.max(np.abs(found - exact).max(axis=1)[size > 0] / size[size > 0]))


def loosest(run: Callable[[float], np.ndarray], exact: np.ndarray) -> float:
    """Return the loosest tolerance that is accurate enough."""
    return next((rtol for rtol in TOLERANCES if error(run(rtol), exact) <= ERROR), TOLERANCES[-1])


def rows(quick: bool) -> Iterator[Row]:
    """Time one loop with all three."""
    seconds = 0.5 if quick else 5.0
    plant = rp.air_bearing()
    gain = rp.state_feedback(plant, norm="h2", control_weight=1e-4).controller
    loop = plant.state_feedback_loop(np.asarray(gain.D))
    pushes = forces(round(seconds * RATE) + 1, list(loop.input_labels))
    time = pushes["time"].to_numpy()
    u = np.array([pushes[name].to_numpy() for name in loop.input_labels])
    ours = milliseconds(5, rp.simulate, loop, pushes)
    response = rp.simulate(loop, pushes)
    found = np.array([response[name].to_numpy() for name in loop.output_labels])
    spent, answer = once(control.forced_response, loop, time, u)
    exact = answer.outputs
    task = f"air bearing with state feedback, {seconds:g} s at 20 kHz"
    yield Row(
        "closed loops", task, "rp.simulate", ours, "control.forced_response", spent,
        f"differ by {error(found, exact):.0e} of the largest value",
    )  # fmt: skip
    short = time <= 0.1
    rtol = loosest(lambda r: runge_kutta(loop, time[short], u[:, short], r), exact[:, short])
    spent, y = once(runge_kutta, loop, time, u, rtol)
    yield Row(
        "closed loops", task, "rp.simulate", ours, f"solve_ivp RK45, rtol {rtol:g}", spent,
        f"RK45 errs by {error(y, exact):.0e}, ours by {error(found, exact):.0e}", asked=0.01,
    )  # fmt: skip
