"""Parts of a plant, and controllers put back together."""

import control
import numpy as np
import pytest

from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.polishing.air_bearing import air_bearing
from robustpolish.synthesis.problem.scaling import decoupled_parts, joined_controller, whole_plant


def test_the_air_bearing_is_three_axes():
    plant = air_bearing(actuation="force", measured="displacement")
    parts = decoupled_parts(plant)
    assert [part.plant.nx for part in parts] == [4, 4, 4]
    assert parts[2].plant.disturbance_names == ("F_z", "F_p")
    assert parts[1].controls == (2, 3)
    norms = [float(hinf_norm(part.plant.open_loop)) for part in parts]
    assert max(norms) == pytest.approx(float(hinf_norm(plant.open_loop)), rel=1e-9)


def test_a_structure_joins_parts():
    plant = air_bearing(measured="displacement")
    structure = np.zeros((6, 6), bool)
    structure[0, 2] = True  # x actuator from y sensor
    assert [part.plant.nx for part in decoupled_parts(plant, structure)] == [8, 4]
    assert whole_plant(plant).states == tuple(range(12))


def test_joined_controller_has_the_loops_of_its_parts():
    plant = air_bearing(measured="displacement")
    parts = decoupled_parts(plant)
    rng = np.random.default_rng(0)
    own = [
        control.ss(-np.eye(2), rng.normal(size=(2, 2)), rng.normal(size=(2, 2)), -np.eye(2))
        for _ in parts
    ]
    K = joined_controller(plant, parts, [own[0], None, own[2]])
    assert K.input_labels == list(plant.measurement_names)
    assert K.output_labels == list(plant.control_names)
    poles = np.concatenate(
        [
            parts[0].plant.closed_loop(own[0]).poles(),
            np.linalg.eigvals(parts[1].plant.A),
            parts[2].plant.closed_loop(own[2]).poles(),
        ]
    )
    found = np.sort_complex(plant.closed_loop(K).poles())
    assert found == pytest.approx(np.sort_complex(poles), rel=1e-7, abs=1e-6)
