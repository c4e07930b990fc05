"""A defect that is known and open."""

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.models import Damper, Dof, Output, Spring


@pytest.mark.xfail(reason="refit loses a lightly damped free decay", strict=True)
def test_a_free_decay_gives_its_frequency():
    model = rp.MechanicalModel(
        [Dof("x", 1.0)],
        [Spring(("x", "ground"), 22.0)],
        [Damper(("x", "ground"), 0.4)],
        outputs=[Output("x", ("x", "ground"))],
    )
    time = np.arange(2000) * 0.01
    decay = np.exp(-0.2 * time) * np.cos(np.sqrt(25 - 0.04) * time)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(time.size)
    data = xr.Dataset({"x": ("time", decay + noise)}, coords={"time": time})
    found = rp.refit(model, data).model.parameters
    assert found["spring[0].stiffness"] / found["dof.x.mass"] == pytest.approx(25, abs=0.05)
