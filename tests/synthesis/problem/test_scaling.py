"""Scaling for synthesis: nothing changes but the units."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.polishing.air_bearing import air_bearing
from robustpolish.synthesis.problem.preflight import (
    decoupled_parts,
    joined_controller,
    scale_plant,
    whole_plant,
)


def wild_plant(seed, dt=0):
    rng = np.random.default_rng(seed)

    def units(count):
        return 10 ** rng.uniform(-3, 3, count)

    x, t = units(4), 1.0 if dt else units(1)[0]
    A = rng.normal(size=(4, 4)) - 3 * np.eye(4) if not dt else 0.3 * rng.normal(size=(4, 4))
    return rp.GeneralizedPlant.from_matrices(
        A * x[:, None] / x / t,
        rng.normal(size=(4, 2)) * x[:, None] / t * units(1),
        rng.normal(size=(4, 2)) * x[:, None] / t * units(2),
        rng.normal(size=(3, 4)) / x * units(1),
        rng.normal(size=(2, 4)) / x * units(2)[:, None],
        dt=dt,
    )


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("dt", [0, 0.1])
def test_norms_and_gains_come_back(seed, dt):
    plant = wild_plant(seed, dt)
    scaled = scale_plant(plant)
    for norm, measure in (("hinf", rp.hinf_norm), ("h2", rp.h2_norm)):
        if dt and not np.abs(np.linalg.eigvals(plant.A)).max() < 1:
            continue
        own = float(measure(plant.open_loop))
        if np.isfinite(own):
            inside = float(measure(scaled.plant.open_loop))
            assert scaled.norm(inside, norm) == pytest.approx(own, rel=1e-9)
            assert scaled.scaled_norm(own, norm) == pytest.approx(inside, rel=1e-9)
    F = 0.01 * np.random.default_rng(seed).normal(size=(2, 4))
    back = scaled.state_gain(F) * scaled.state / scaled.control[:, None]
    np.testing.assert_allclose(back, F)
    own = np.linalg.eigvals(plant.A + plant.B2 @ scaled.state_gain(F))
    inside = np.linalg.eigvals(scaled.plant.A + scaled.plant.B2 @ F) / scaled.time
    np.testing.assert_allclose(np.sort_complex(own), np.sort_complex(inside), rtol=1e-6)


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
