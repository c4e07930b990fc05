"""What is asked of a loop: sources in the docstring, bad numbers refused."""

import pytest

import robustpolish as rp


def test_gain_and_phase_ask_for_one_disk():
    asked = rp.LoopRequirements()
    assert asked.disk == pytest.approx(2 * (10**0.3 - 1) / (10**0.3 + 1))  # the gain decides
    assert rp.LoopRequirements(disk_gain_db=1).disk == pytest.approx(0.5359, abs=1e-4)
    assert asked.sampling_delay_samples == 1.5
    assert asked.disk_at_once < asked.disk


@pytest.mark.parametrize(
    "change",
    [
        {"disk_gain_db": 0},
        {"disk_phase_deg": 180},
        {"delay_share": 1.5},
        {"sample_rate_hz": "fast"},
        {"delay_s": -1e-6},
    ],
)
def test_bad_numbers(change):
    with pytest.raises(rp.InvalidInputError, match=next(iter(change))):
        rp.LoopRequirements(**change)
