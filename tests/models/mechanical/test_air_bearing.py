"""The air bearing as a mechanical model."""

import numpy as np
import pytest

import robustpolish as rp


@pytest.mark.parametrize("actuation", ["force", "displacement"])
@pytest.mark.parametrize("measured", ["state", "displacement"])
@pytest.mark.parametrize("dissipation", [0.0, 0.001])
def test_the_air_bearing_is_the_same_plant(actuation, measured, dissipation):
    plant = rp.air_bearing(None, dissipation, actuation, measured)
    ours = rp.polishing.air_bearing_model(None, dissipation).linearize(
        actuation=actuation, measured=measured
    )
    for name in ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22"):
        np.testing.assert_allclose(getattr(ours, name), getattr(plant, name), rtol=1e-12)
    for names in ("states", "disturbance_names", "control_names", "performance_names"):
        assert getattr(ours, names) == getattr(plant, names)
    assert ours.measurement_names == plant.measurement_names
    assert dict(ours.units) == dict(plant.units)


def test_the_old_name_warns():
    with pytest.warns(DeprecationWarning, match="air_bearing_model"):
        old = rp.MechanicalModel.from_air_bearing(dissipation=0.0)
    assert old == rp.polishing.air_bearing_model(dissipation=0.0)
