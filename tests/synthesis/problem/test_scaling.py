"""Scaling for synthesis: nothing changes but the units."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.problem.scaling import scale_plant


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


@pytest.mark.parametrize("seed", range(5))
def test_dynamic_controller_comes_back(seed):
    import control

    plant = wild_plant(seed)
    scaled = scale_plant(plant)
    rng = np.random.default_rng(seed)
    K = control.ss(-np.eye(2), rng.normal(size=(2, 2)), rng.normal(size=(2, 2)), np.eye(2) * 0.1)
    own = np.linalg.eigvals(plant.closed_loop(scaled.controller(K)).A)
    inside = np.linalg.eigvals(scaled.plant.closed_loop(K).A) / scaled.time
    np.testing.assert_allclose(np.sort_complex(own), np.sort_complex(inside), rtol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_entries_are_of_order_one(seed):
    scaled = scale_plant(wild_plant(seed))
    for name in ("A", "B2", "B1", "C1", "C2"):
        assert 0.1 < np.abs(getattr(scaled.plant, name)).max() < 20
    factors = np.concatenate([scaled.state, scaled.control, scaled.measurement, [scaled.time]])
    np.testing.assert_array_equal(np.log2(factors), np.round(np.log2(factors)))
