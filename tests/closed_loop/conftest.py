"""A load and two controllers that need no synthesis."""

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp


def spring_design(stiffness: float) -> rp.results.Design:
    """Six springs of the same stiffness to ground, with some damping."""
    gain = np.kron(np.eye(6), [[-stiffness, -2e-5 * stiffness]])
    return rp.given_controller(rp.air_bearing(actuation="force"), gain)


@pytest.fixture(scope="session")
def soft():
    return spring_design(1e5)


@pytest.fixture(scope="session")
def stiff():
    return spring_design(1e7)


@pytest.fixture
def load():
    """A step of 10 N in y and a polishing force of 10 N."""
    time = np.arange(4001) / 20e3
    forces = {"F_x": 0.0, "F_y": 10.0, "F_z": 10.0, "F_p": 10.0}
    return xr.Dataset(
        {
            name: ("time", np.full(time.size, value), {"units": "N"})
            for name, value in forces.items()
        },
        coords={"time": time},
    )
