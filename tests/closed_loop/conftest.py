"""A load and two controllers that need no synthesis."""

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.synthesis import Design, certify


def spring_design(stiffness: float) -> Design:
    """Six springs of the same stiffness to ground, with some damping."""
    plant = rp.air_bearing(actuation="force")
    damping = 2e-5 * stiffness
    gain = np.kron(np.eye(6), [[-stiffness, -damping]])
    certificate = certify(plant, gain)
    assert certificate.valid, certificate.reasons
    return Design(
        plant=plant,
        controller=plant.static_controller(gain),
        closed_loop=plant.closed_loop(gain),
        norm="hinf",
        status="suboptimal",
        message="springs and dampers",
        certificate=certificate,
        method="by hand",
        backend="none",
        elapsed=0.0,
    )


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
