"""Free decays: nothing but the start drives them, and no force is known."""

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.models import Damper, Dof, Output, Spring


@pytest.mark.parametrize("stiffness", [15.0, 22.0, 25.0, 40.0])
def test_a_free_decay_gives_its_frequency(stiffness):
    model = rp.MechanicalModel(
        [Dof("x", 1.0)],
        [Spring(("x", "ground"), stiffness)],
        [Damper(("x", "ground"), 0.4)],
        outputs=[Output("x", ("x", "ground"))],
    )
    time = np.arange(2000) * 0.01
    decay = np.exp(-0.2 * time) * np.cos(np.sqrt(25 - 0.04) * time)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(time.size)
    data = xr.Dataset({"x": ("time", decay + noise)}, coords={"time": time})
    fitted = rp.refit(model, data)
    found = fitted.model.parameters
    assert found["dof.x.mass"] == 1.0  # a decay shows ratios only
    assert found["spring[0].stiffness"] == pytest.approx(25, rel=1e-3)
    assert found["damper[0].damping"] == pytest.approx(0.4, rel=0.01)
    assert fitted.nrmse["x"] * np.std(decay + noise) == pytest.approx(1e-3, rel=0.05)
