"""An oscillator, and records of it by an integrator that is not the package's."""

from functools import lru_cache

import numpy as np
import xarray as xr
from scipy.integrate import solve_ivp

from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring

PLACE = ("x", "ground")
RATE = 500.0


def oscillator(stiffness=400.0, damping=1.0, **changes):
    parts = {
        "dofs": [Dof("x", 1.0)],
        "springs": [Spring(PLACE, stiffness)],
        "dampers": [Damper(PLACE, damping)],
        "inputs": [Input("F", PLACE)],
        "outputs": [Output("x", PLACE)],
    }
    return MechanicalModel(**{**parts, **changes})


def rig(stiffness=50.0, damping=4.0):
    """A spring and a damper without mass, whose displacement and velocity are imposed."""
    return MechanicalModel(
        [Dof("x", 0.0)],
        [Spring(PLACE, stiffness)],
        [Damper(PLACE, damping)],
        [Input("x", PLACE, "displacement"), Input("v", PLACE, "velocity")],
        [Output("f", PLACE, "force")],
    )


@lru_cache
def record(
    samples=4000, start=(0.0, 0.0), noise=0.0, cubic=0.0, seed=0, stiffness=400.0, drift=0.0
):
    """An oscillator of 1 kg and 1 N s/m on a smooth random force, whose spring may stiffen."""
    random = np.random.default_rng(seed)
    time = np.arange(samples) / RATE
    phases, lines = random.uniform(0, 2 * np.pi, 40), np.arange(1, 41) * 0.2
    amplitude = 10.0

    def force(t):
        return amplitude * np.cos(2 * np.pi * np.multiply.outer(t, lines) + phases).mean(axis=-1)

    def rhs(t, s):
        return [s[1], force(t) - s[1] - (stiffness + drift * t) * s[0] - cubic * s[0] ** 3]

    x = solve_ivp(rhs, (0, time[-1]), start, t_eval=time, rtol=1e-9, atol=1e-12).y[0]
    x = x + noise * np.std(x) * random.standard_normal(samples)
    return xr.Dataset(
        {
            "F": ("time", force(time), {"units": "N"}),
            "x": ("time", x, {"units": "m"}),
        },
        {"time": ("time", time, {"units": "s"})},
    )


def of_rig(samples=1000, noise=0.0, seed=0, stiffness=50.0, damping=4.0):
    """Two incommensurable swings of the rig, and the force that they take."""
    time = np.arange(samples) / RATE
    x = np.sin(5 * time) + 0.3 * np.sin(17 * time)
    v = 5 * np.cos(5 * time) + 5.1 * np.cos(17 * time)
    f = stiffness * x + damping * v + noise * np.random.default_rng(seed).standard_normal(samples)
    return xr.Dataset({"x": ("time", x), "v": ("time", v), "f": ("time", f)}, {"time": time})


def double_well(length):
    """Holmes' double well under a strong harmonic force, where runs part slowly."""
    time = np.arange(0, length, 0.05)
    force = 0.3 * np.cos(1.2 * time)

    def rhs(t, s):
        return [s[1], 0.3 * np.cos(1.2 * t) - 0.15 * s[1] + s[0] - s[0] ** 3]

    x = solve_ivp(rhs, (0, length), [1.0, 0.0], t_eval=time, rtol=1e-9, atol=1e-11).y[0]
    x += 0.01 * np.random.default_rng(0).standard_normal(time.size)
    model = oscillator(stiffness=-1.0, damping=0.15)
    model = model.with_effect("cubic_stiffness", PLACE, {"stiffness": 1.0})
    return model, xr.Dataset({"F": ("time", force), "x": ("time", x)}, {"time": time})
