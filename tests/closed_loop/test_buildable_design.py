"""The controller that can be built: margins, sampling, slower actuators, and what reality costs."""

import numpy as np
import pytest

import robustpolish as rp


@pytest.fixture(scope="module")
def job():
    return rp.design_against_brush(duration=0.02)


def test_the_default_keeps_its_margins_with_delay_and_sampling(job):
    assert job.good
    assert job.sampled.certificate.valid
    assert (job.sampled.period, job.sampled.delay) == (5e-5, 2.5e-5)
    for margins in job.loop.margins:
        assert margins.disk.gain_db >= 6
        assert margins.disk.phase_deg >= 30
    continuous = rp.loop_analysis(job.design)
    assert min(m.disk.gain_db for m in continuous.margins if m.place == "input") >= 6
    assert job.ideal_loop.delay_margin < 1e-6 < job.loop.delay_margin


def test_slower_actuators_are_certified_again(job):
    assert all(found.valid for found in job.survived.values())
    slow = rp.PolishingHardware(actuator_bandwidth_hz=1400.0)
    found = rp.certify_sampled(rp.polishing_plant(slow), job.sampled.controller, delay=2.5e-5)
    assert found.valid


def test_it_gains_within_its_limits(job):
    improvement = job.comparison.table["improvement"].sel(row="with control")
    assert float(improvement.sel(signal="y")) > 60
    assert float(improvement.sel(signal="z")) == pytest.approx(0, abs=1e-6)
    for name in job.plant.control_names:
        assert float(np.abs(job.run[name]).max()) < 20
        assert job.run[name].attrs["at_limit"] == 0
    assert 0 < job.noise_effort["u_y"] < 1
    assert job.slowest_actuator_hz < 1400


def test_options_of_the_ideal_do_not_mix_with_hardware():
    with pytest.raises(rp.InvalidInputError, match="hardware"):
        rp.design_against_brush(control_weight=1e-7, hardware=rp.PolishingHardware())
    with pytest.raises(rp.InvalidInputError, match="realisation"):
        rp.design_against_brush(realisation="dream")
    with pytest.raises(rp.InvalidInputError, match="gain_bound"):
        rp.design_against_brush(realisation="buildable", gain_bound=1e6)
