"""Decays of a pendulum with known damping, by an integrator that is not the package's."""

from functools import lru_cache

import numpy as np
import xarray as xr
from scipy.integrate import solve_ivp

from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring

AT = ("arm", "ground")
STEP = 0.02
COULOMB = ("coulomb_friction", "force", 0.15)
DRAG = ("quadratic_damping", "coefficient", 0.01)
GRAVITY = 60.0


def pendulum(damping=0.02, inputs=()):
    """A pendulum that knows gravity and a viscous damper."""
    model = MechanicalModel(
        [Dof("arm", 1.0, rotational=True)],
        [Spring(AT, 1.0)],
        [Damper(AT, damping)],
        [Input(name, AT) for name in inputs],
        [Output("angle", AT, "angle")],
    )
    return model.with_effect("pendulum_gravity", ("arm",), {"moment": GRAVITY})


@lru_cache
def decay(coulomb=COULOMB[2], drag=DRAG[2], viscous=0.02, shape=0.0, samples=1400, noise=1e-3):
    """The pendulum let go at 1.5 rad; `shape` is what damping grows with the angle squared."""
    time = np.arange(samples) * STEP

    def rhs(_, s):
        q, v = s
        lost = (viscous + shape * q * q + drag * abs(v)) * v + coulomb * np.tanh(v / 5e-3)
        return [v, -GRAVITY * np.sin(q) - q - lost]

    q = solve_ivp(rhs, (0, time[-1]), [1.5, 0.0], t_eval=time, rtol=1e-7, atol=1e-9).y[0]
    q = q + noise * np.random.default_rng(0).standard_normal(samples)
    return xr.Dataset({"angle": ("time", q)}, {"time": time})
