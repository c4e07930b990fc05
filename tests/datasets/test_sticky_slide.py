"""The simulated slide with an effect that its model does not know."""

import numpy as np

import robustpolish as rp
from robustpolish.machines.simulation.run import simulate_model as simulate


def test_the_record_is_the_model_with_friction_and_a_micron_of_noise():
    model, data = rp.datasets.sticky_slide()
    assert not model.effects
    truth = model.with_effect("coulomb_friction", ("x", "ground"), {"force": 3.0})
    rest = data["x"].values - simulate(truth, data).outputs[:, 0]
    assert 0.95e-6 < np.std(rest) < 1.05e-6
    assert abs(np.corrcoef(rest[1:], rest[:-1])[0, 1]) < 0.07  # white
    assert np.std(data["x"].values - simulate(model, data).outputs[:, 0]) > 20e-6


def test_it_is_always_the_same():
    first, again = (rp.datasets.sticky_slide()[1] for _ in range(2))
    assert first.identical(again)
    assert (first.sizes["time"], float(first["time"][1])) == (2000, 1e-3)
