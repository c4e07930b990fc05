import control
import numpy as np
import pytest

import robustpolish as rp


def test_the_plant_is_the_equation_of_motion():
    axis = rp.polishing.PolishingAxis(stiffness=300.0)
    plant, omega = axis.plant(), 2 * np.pi * 7.0
    s = 1j * omega
    lag = 1 / (1 + s / (2 * np.pi * axis.surface_bandwidth))
    push = 1 / (1 + s / (2 * np.pi * axis.actuator_bandwidth))
    contact = axis.contact_stiffness + axis.contact_damping * s
    hung = axis.mass * s**2 + axis.damping * s + axis.stiffness
    tool = {"surface": contact * lag / (hung + contact), "push": push / (hung + contact)}
    system = control.ss(plant.A, np.hstack([plant.B1, plant.B2]), plant.C1,
                        np.hstack([plant.D11, plant.D12]))  # fmt: skip
    found = system(s)
    assert found[1, 0] == pytest.approx(tool["surface"])
    assert found[1, 2] == pytest.approx(tool["push"])
    assert found[0, 0] == pytest.approx(contact * (lag - tool["surface"]))
    assert found[0, 2] == pytest.approx(-contact * tool["push"])


def test_numbers_are_checked():
    for values in ({"mass": 0.0}, {"damping": -1.0}, {"contact_stiffness": np.nan}):
        with pytest.raises(rp.InvalidInputError, match="PolishingAxis"):
            rp.polishing.PolishingAxis(**values)
