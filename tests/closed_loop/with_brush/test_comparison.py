"""Replayed against coupled: equal where the machine is stiff, apart where it is not."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from tests.closed_loop.with_brush.test_carrier import springs


@pytest.fixture(scope="module")
def brush():
    """Soft contact with little damping: then stiffness is what matters."""
    gentle = rp.polishing.BrushParameters(contact_damping=1.0)
    return rp.simulate_brush(duration=0.1, parameters=gentle, tolerance=5e-3)


@pytest.mark.long
def test_a_machine_a_hundred_times_stiffer_may_replay(brush):
    """At rest and wherever both are moved: then displacements agree to 1 %."""
    comparison = rp.polishing.compare_coupled(springs(1.2e7), brush)
    assert comparison.stiffness_ratio > 100
    assert 1 / comparison.loop_gain > 100
    assert comparison.replay_is_good_enough(0.01)


def test_they_part_as_the_machine_softens(brush):
    found = [rp.polishing.compare_coupled(springs(k), brush) for k in (1e4, 1e5, 1e6, 1e7)]
    shares = [one.largest_share for one in found]
    assert all(np.diff(shares) < 0)
    assert shares[0] > 0.05
    assert not found[0].replay_is_good_enough()
    # The gain of the loop through machine and contact bounds what replay leaves out.
    assert all(one.largest_share < 1.5 * one.loop_gain for one in found)


def test_contact_damps_what_replay_lets_ring():
    """The thesis's machine hardly damps 194 Hz; the spinning rim's friction and contact do."""
    comparison = rp.polishing.compare_coupled(
        rp.air_bearing(), rp.simulate_brush(run=1, duration=0.3)
    )
    late = [
        run["y"].sel(time=slice(0.2, None)) for run in (comparison.replayed, comparison.coupled)
    ]
    swing = [float((run - run.rolling(time=200, center=True).mean()).std()) for run in late]
    assert swing[1] < 0.2 * swing[0]
    assert comparison.stiffness_ratio > 10
    assert comparison.largest_share > 0.3


def test_it_shows_itself(brush):
    comparison = rp.polishing.compare_coupled(springs(1e5), brush.isel(time=slice(0, 401)))
    assert "Replayed against coupled" in repr(comparison)
    assert "times stiffer" in repr(comparison)
    assert comparison.plot(signal="x").get_xlabel() == "time [ms]"
    with pytest.raises(InvalidInputError, match="signal"):
        comparison.plot(signal="u")
