"""The controller that can be built: margins, sampling, slower actuators, and what reality costs."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.loops.disk_margins import disk_of
from robustpolish.loops.loop import loop_of


@pytest.fixture
def job(buildable_job):
    return buildable_job


def test_the_default_keeps_its_margins_with_delay_and_sampling(job):
    assert job.good
    assert job.sampled.certificate.valid
    assert (job.sampled.period, job.sampled.delay) == (5e-5, 2.5e-5)
    for margins in job.loop.margins:
        assert margins.disk.gain_db >= 6
        assert margins.disk.phase_deg >= 30
    continuous = loop_of(job.design, None)
    for i in range(2):
        assert disk_of(continuous.balanced_peak(continuous.at("input", [i]))).gain_db >= 6
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


def test_the_words_and_tables_tell_both(job):
    assert job.verdict().startswith("The controller can be built: sampled at 20 kHz with 25 µs")
    beside, survived = job.tables()
    rows = {row[0]: row[1:] for row in beside.rows}
    delays = rows["delay that it bears besides its own [µs]"]
    assert delays == (1e6 * job.loop.delay_margin, 1e6 * job.ideal_loop.delay_margin)
    assert rows["measured signals"] == (2, 12)
    assert [row[:2] for row in survived.rows] == [(what, True) for what in job.survived]
    assert "This loop can be built" in str(job)


def test_the_loop_is_unstable_beyond_what_it_bears(job):
    period, slowest = job.largest_period, job.slowest_actuator_hz
    plain = rp.given_controller(job.axis.problem.plant(), job.axis.continuous.controller)
    plain.discretize(0.99 * period, delay=0.495 * period)
    with pytest.raises(rp.InfeasibleError):
        plain.discretize(1.02 * period, delay=0.51 * period)
    for factor, stable in ((1.02, True), (0.98, False)):
        plant = rp.polishing_plant(rp.PolishingHardware(actuator_bandwidth_hz=factor * slowest))
        found = rp.certify_sampled(plant, job.sampled.controller, delay=2.5e-5)
        assert found.stable is stable


def test_options_of_the_ideal_do_not_mix_with_hardware():
    with pytest.raises(rp.InvalidInputError, match="hardware"):
        rp.design_against_brush(control_weight=1e-7, hardware=rp.PolishingHardware())
    with pytest.raises(rp.InvalidInputError, match="realisation"):
        rp.design_against_brush(realisation="dream")
    with pytest.raises(rp.InvalidInputError, match="gain_bound"):
        rp.design_against_brush(realisation="buildable", gain_bound=1e6)
