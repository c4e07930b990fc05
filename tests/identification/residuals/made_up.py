"""Figures of a residual analysis that no analysis made."""

import numpy as np
import xarray as xr

from robustpolish.identification.residuals.analysis import ResidualFigures
from robustpolish.identification.residuals.tests import Coherence, Correlation, PlaceShares

OUTPUTS = ["x", "y"]


def table(dim, x, y, **coords):
    return xr.DataArray(
        np.array([x, y], dtype=float),
        {"output": OUTPUTS, **{name: (dim, values) for name, values in coords.items()}},
        ("output", dim),
    )


def figures(**changes):
    """Of two outputs with a quarter and three quarters of the error."""
    lags = {"lag": [0.1, 0.2]}
    correlation = Correlation(
        xr.DataArray([0.5, -0.7], lags, "lag"), xr.DataArray([0.6, 0.6], lags, "lag")
    )
    displacement = table(
        "displacement", [0.0, 1.0], [0.2, 0.8], displacement=[-1.0, 2.0], samples=[0.9, 0.1]
    )
    velocity = table("velocity", [0.5, 0.5], [0.5, 0.5], velocity=[-3.0, 3.0], samples=[0.5, 0.5])
    dims = ("displacement", "velocity")
    surface = xr.Dataset(
        {"force": (dims, np.zeros((2, 2)))},
        {
            "displacement": ("displacement", [-1.0, 2.0], {"units": "m"}),
            "velocity": ("velocity", [-3.0, 3.0], {"units": "m/s"}),
        },
    )
    made = {
        "residual": xr.Dataset(),
        "channels": xr.DataArray([0.25, 0.75], {"output": OUTPUTS}, "output"),
        "windows": table("window", [1.0, 0.0], [0.2, 0.8], begin=[0.0, 2.0], end=[2.0, 4.0]),
        "bands": table("band", [0.0, 1.0], [0.6, 0.4], low=[0.0, 10.0], high=[10.0, 50.0]),
        "modes": table("mode", [0.0, 0.3], [0.04, 0.3], frequency=[5.0, 20.0]),
        "harmonics": table("harmonic", [], [], frequency=[]),
        "places": {"x": PlaceShares(("x", "ground"), displacement, velocity, surface, True)},
        "phase": None,
        "contact": None,
        "autocorrelation": {"x": correlation, "y": correlation},
        "cross_correlation": {("F", "y"): correlation},
        "coherence": {
            ("F", "y"): Coherence(xr.DataArray([0.1, 0.2, 0.9, 0.1], dims="frequency"), 0.5)
        },
        "nrmse": {"x": 0.02, "y": 0.0346},
    }
    return ResidualFigures(**{**made, **changes})
