"""The air bearing as wired, and the numbers of its hardware."""

import math

import numpy as np
import pytest

import robustpolish as rp


def test_forces_act_between_brush_and_bearing():
    ideal = dict.fromkeys(("sensor_bandwidth_hz", "actuator_bandwidth_hz"), math.inf)
    plant = rp.polishing.polishing_plant(rp.polishing.PolishingHardware(**ideal, sensor_noise=0.0))
    whole = rp.air_bearing(actuation="force", measured="displacement")
    np.testing.assert_array_equal(plant.A, whole.A)
    np.testing.assert_array_equal(plant.B2[:, 0], whole.B2[:, 1] - whole.B2[:, 0])
    np.testing.assert_array_equal(plant.C2[1], whole.C2[3] - whole.C2[2])


def test_axes_can_be_taken_apart():
    part = rp.polishing.polishing_plant(axes="y")
    assert part.nx == 6
    assert part.disturbance_names == ("F_y", "noise_gap_y")
    with pytest.raises(rp.InvalidInputError, match="axes"):
        rp.polishing.polishing_plant(axes="z")


@pytest.mark.parametrize("name", ["sensor_noise", "sample_rate_hz", "computation_delay"])
def test_nonsense_is_refused(name):
    with pytest.raises(rp.InvalidInputError, match=name):
        rp.polishing.PolishingHardware(**{name: -1.0})


def test_every_number_has_a_unit_and_a_source():
    for _, value, unit, source in rp.polishing.PolishingHardware().table():
        assert value > 0
        assert unit
        assert "typical" in source
