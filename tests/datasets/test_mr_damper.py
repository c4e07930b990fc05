"""The magnetorheological damper without voltage."""

import numpy as np
import pytest

import robustpolish as rp


def test_it_moves_to_and_fro_and_takes_energy():
    test = rp.datasets.mr_damper()
    assert test.sizes["time"] == 1340
    assert [test[name].attrs["units"] for name in ("x", "v", "F")] == ["m", "m/s", "N"]
    assert float(np.ptp(test["x"].values)) / 2 == pytest.approx(12.6e-3, rel=0.01)
    assert float(np.mean(test["v"] * test["F"])) > 3.0  # watts


def test_the_velocity_is_that_of_the_displacement():
    test = rp.datasets.mr_damper()
    slope = np.gradient(test["x"].values, 0.01)
    assert np.std(slope - test["v"].values) < 0.05 * np.std(slope)
