"""A record of an oscillator that started in motion, with an effect or without."""

import numpy as np
import xarray as xr

from robustpolish.identification.record import record_of
from robustpolish.machines.simulation.run import simulate_model as simulate
from tests.identification.oscillators import oscillator


def case(effect=None, start=(2e-3, 0.1)):
    model = oscillator(damping=0.8)
    if effect:
        model = model.with_effect(*effect)
    time = np.arange(1200) * 5e-3
    force = np.random.default_rng(0).standard_normal(time.size)
    data = xr.Dataset({"F": ("time", force)}, {"time": time})
    data["x"] = ("time", 2e-3 * np.ones(time.size))  # decides on the steps, as below
    x = simulate(model, data, initial_state=start).outputs[:, 0]
    return model, record_of(model, data.assign(x=("time", x)))
