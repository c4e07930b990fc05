"""Two masses of which the outer one is pushed, and records with something put into their error."""

import numpy as np
import xarray as xr

from robustpolish.identification.compare import compare
from robustpolish.identification.residuals.analysis import residual_analysis
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from robustpolish.machines.simulation.run import simulate_model as simulate

RATE, SAMPLES = 2000.0, 8000
TIME = np.arange(SAMPLES) / RATE
RANDOM = np.random.default_rng(5)


def model(**changes):
    parts = {
        "dofs": [Dof("a", 1.0), Dof("b", 0.5)],
        "springs": [Spring(("a", "ground"), 4e4), Spring(("a", "b"), 6e4)],
        "dampers": [Damper(("a", "ground"), 8.0), Damper(("a", "b"), 4.0)],
        "inputs": [Input("F", ("b", "ground"))],
        "outputs": [Output("a", ("a", "ground")), Output("b", ("b", "ground"))],
        "spin_frequency": 31.0,
    }
    return MechanicalModel(**{**parts, **changes})


def record(truth=None, **extra):
    data = xr.Dataset(
        {"F": ("time", 10 * RANDOM.standard_normal(SAMPLES), {"units": "N"})}, {"time": TIME}
    )
    outputs = simulate(truth or model(), data).outputs
    for i, name in enumerate("ab"):
        noise = 1e-3 * np.std(outputs[:, i]) * RANDOM.standard_normal(SAMPLES)
        data[name] = ("time", outputs[:, i] + noise, {"units": "m"})
    for name, values in extra.items():
        if name in data:
            data[name] = data[name] + values
        else:
            data[name] = ("time", values)
    return data


def analyse(data, **options):
    return residual_analysis(compare(model(), data), **options)
