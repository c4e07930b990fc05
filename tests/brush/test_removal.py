import numpy as np
import pytest

import robustpolish as rp

PATH = rp.polishing.ToolPath.spiral((0.0, 0.0), 0.012, 0.003, speed=0.04)


@pytest.mark.parametrize("disc", ["two-angle", "three-angle"])
def test_the_volume_is_force_times_way(disc):
    signals = rp.simulate_brush(duration=0.2, disc=disc)
    depth = rp.polishing.removal_map(signals, rp.polishing.Surface(), preston=1e-12, cell=1e-3)
    force = signals["contact_force"].sum("point")
    spin = signals["omega_z"] if disc == "three-angle" else signals.attrs["spin"]
    # The rim slips at radius times spin; circling adds up to 1 %.
    way = float((force * spin * 0.010).mean()) * 0.2
    assert float(depth.sum()) * 1e-6 == pytest.approx(1e-12 * way, rel=0.02)
    assert float(depth.min()) >= 0


def test_in_a_groove_it_is_taken_off_at_both_sides():
    signals = rp.simulate_brush(duration=0.1)
    depth = rp.polishing.removal_map(signals, rp.polishing.Surface())
    profile = depth.sum("x")
    # The middle is 3.5 of 24 mm; the rim touches at both sides of it.
    middle = profile.sel(y=slice(-0.001, 0.0025)).sum()
    assert float(middle) < 0.02 * float(profile.sum())


def test_an_even_force_takes_off_its_volume_and_less_where_it_is_weak():
    time = np.linspace(0.0, 2.0, 4001)
    even = rp.polishing.removal_of_force(PATH, time, np.full(time.size, 10.0), preston=1e-12)
    # Mean speed over a disc is two thirds of that of its rim.
    way = 2 / 3 * 0.010 * 100 * np.pi * 2.0
    assert float(even.sum()) * 2.5e-7 == pytest.approx(1e-11 * way, rel=0.01)
    lifted = rp.polishing.removal_of_force(
        PATH, time, np.where(time < 1, 10.0, -5.0), preston=1e-12
    )
    assert float(lifted.sum()) == pytest.approx(0.5 * float(even.sum()), rel=0.01)


def test_inputs_are_checked():
    with pytest.raises(rp.InvalidInputError, match="physical simulator"):
        rp.polishing.removal_map(
            rp.simulate_brush("listing", duration=0.001), rp.polishing.Surface()
        )
    with pytest.raises(rp.InvalidInputError, match="one number for each time"):
        rp.polishing.removal_of_force(PATH, [0.0, 1.0], [1.0])
