"""A record of an oscillator that started in motion, with an effect or without."""

import numpy as np
import xarray as xr

from robustpolish.identification.record import record_of
from robustpolish.models import Damper, Dof, Input, MechanicalModel, Output, Spring
from robustpolish.simulation.run import simulate

PLACE = ("x", "ground")


def case(effect=None, start=(2e-3, 0.1)):
    model = MechanicalModel(
        [Dof("x", 1.0)],
        [Spring(PLACE, 400.0)],
        [Damper(PLACE, 0.8)],
        [Input("F", PLACE)],
        [Output("x", PLACE)],
    )
    if effect:
        model = model.with_effect(*effect)
    time = np.arange(1200) * 5e-3
    force = np.random.default_rng(0).standard_normal(time.size)
    data = xr.Dataset({"F": ("time", force)}, {"time": time})
    data["x"] = ("time", 2e-3 * np.ones(time.size))  # decides on the steps, as below
    x = simulate(model, data, initial_state=start).outputs[:, 0]
    return model, record_of(model, data.assign(x=("time", x)))
