"""No controller, however it was found, has a norm below the bound that a design states."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis.problem.preflight import SolverPlant
from robustpolish.synthesis.riccati.gamma import lower_bound


def weighted_servo(seed):
    """A small plant, oscillating, unstable or integrating, perhaps delayed, with weights."""
    draw = np.random.default_rng(seed)
    rate = 10 ** draw.uniform(0, 2)
    kinds = (
        ([rate**2], [1.0, rate / 3, -(rate**2)]),
        ([rate**3], [1.0, 0.02 * rate, rate**2, 0.0]),
        ([-(rate**3)], np.poly([rate, -rate, -0.7 * rate])),
    )
    system = control.ss(control.tf(*kinds[seed % 3]))
    plant = rp.GeneralizedPlant(
        control.ss(system, inputs="u", outputs="y"), measurements="y", controls="u"
    )
    if draw.random() < 0.6:
        plant = plant.with_delay("u", 10 ** draw.uniform(-3, -1) / rate, order=2)
    performance = rp.weight(10 ** draw.uniform(1, 4), rate * 10 ** draw.uniform(-1.5, 0.5), 0.5)
    effort = rp.weight(10 ** draw.uniform(-3, -1), rate * 10 ** draw.uniform(0.5, 2), 100.0)
    robustness = rp.weight(0.9, rate * 10 ** draw.uniform(0.5, 2), 100.0, order=1 + seed % 2)
    some = {"performance": performance, "effort": effort, "robustness": robustness}
    kept = [name for name in some if draw.random() < 0.6] or ["effort"]
    return rp.mixed_sensitivity(plant, **{name: some[name] for name in kept}).without_delays()


def in_other_units(plant, seed):
    """Return the plant in another unit of time and of every state, which no norm sees."""
    draw = np.random.default_rng(seed)
    unit, rate = 10 ** draw.uniform(-1.5, 1.5, plant.nx), 10 ** draw.uniform(-3, 3)
    return plant.replace(
        A=rate * plant.A * unit / unit[:, None],
        B1=rate * plant.B1 / unit[:, None],
        B2=rate * plant.B2 / unit[:, None],
        C1=plant.C1 * unit,
        C2=plant.C2 * unit,
    )


@pytest.mark.parametrize(
    "seed",
    [
        seed if seed in (2, 5, 6, 8) else pytest.param(seed, marks=pytest.mark.long)
        for seed in range(10)
    ],
)
def test_no_certified_norm_lies_below_a_bound_of_the_plant_in_any_units(seed):
    plant = weighted_servo(seed)
    design = rp.output_feedback(plant)
    assert design.certificate.valid
    for k in range(4):
        part = SolverPlant.of(in_other_units(plant, k), mapped=True)
        found = lower_bound(part.matrices, 1e-4, Budget())
        if found is not None and found.proven:
            assert part.norm(found.value) <= design.certificate.achieved * (1 + 1e-5)


def test_an_estimate_of_the_infimum_is_no_bound(monkeypatch):
    """Where rounding decides every equation, nothing is stated and no status rests on it."""
    plant = weighted_servo(0)
    found = lower_bound(SolverPlant.of(plant, mapped=True).matrices, 1e-4, Budget())
    assert found is not None
    monkeypatch.setattr(
        "robustpolish.synthesis.driver.lower_bound",
        lambda *_: found._replace(proven=False, how="estimated"),
    )
    design = rp.output_feedback(plant)
    assert design.lower_bound is None
    assert design.status != "optimal"
    assert "no controller comes below" not in design.message
