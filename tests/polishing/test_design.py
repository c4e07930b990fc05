"""Designs against the brush: the ideal, the buildable one, and what hardware costs."""

import math

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.loops.disk_margins import disk_of
from robustpolish.loops.loop import loop_of
from robustpolish.polishing.design import relaxed_hardware
from tests import made_up

# The main job: machine, disturbance, design, certificate, comparison.


@pytest.fixture(scope="module")
def job():
    told = []
    made = rp.polishing.design_against_brush(
        run=2, duration=0.01, dissipation=0.01, realisation="ideal", tell=told.append
    )
    return made, told


def test_the_design_is_of_the_machine_that_was_asked_for(job):
    made, told = job
    plant = rp.air_bearing(dissipation=0.01, actuation="force")
    np.testing.assert_array_equal(made.plant.A, plant.A)
    assert made.disturbance.attrs["contact_stiffness"] == 1e6
    assert float(made.disturbance["time"][-1]) == pytest.approx(0.01)
    assert made.design.certificate.valid
    assert [text.split()[0] for text in told] == ["Designing", "Simulating", "Comparing"]


def test_norms_are_those_without_the_price(job):
    made = job[0]
    assert (made.control_weight, made.gain_bound) == (1e-7, None)
    assert float(made.open_loop_norm) == pytest.approx(0.00211825, rel=5e-6)
    loop = made.plant.state_feedback_loop(made.design.controller.D)
    assert float(made.closed_loop_norm) == float(rp.hinf_norm(loop))
    assert float(made.closed_loop_norm) < made.design.certificate.achieved


def test_the_verdict_names_norms_and_gains():
    made = made_up.brush_design()
    text = made.verdict()
    assert f"falls from {float(made.open_loop_norm):.4g}" in text
    assert f"to {float(made.closed_loop_norm):.4g} m/N" in text
    improvement = float(made.comparison.table["improvement"].sel(row="with control", signal="y"))
    assert f"y by {improvement:.2f} %" in text
    assert "x by" not in text  # at rest without control, too
    assert text in str(made).replace("\n", " ")


# The controller that can be built: margins, sampling, slower actuators, and what reality costs.


def test_the_default_keeps_its_margins_with_delay_and_sampling(buildable_job):
    assert buildable_job.good
    assert buildable_job.sampled.certificate.valid
    assert (buildable_job.sampled.period, buildable_job.sampled.delay) == (
        5e-5,
        2.5e-5,
    )
    for margins in buildable_job.loop.margins:
        assert margins.disk.gain_db >= 6
        assert margins.disk.phase_deg >= 30
    continuous = loop_of(buildable_job.design, None)
    for i in range(2):
        assert disk_of(continuous.balanced_peak(continuous.at("input", [i]))).gain_db >= 6
    assert buildable_job.ideal_loop.delay_margin < 1e-6 < buildable_job.loop.delay_margin


def test_it_bears_slower_actuators_and_is_unstable_beyond(buildable_job):
    assert all(found.valid for found in buildable_job.survived.values())
    slow = rp.polishing.PolishingHardware(actuator_bandwidth_hz=1400.0)
    found = rp.implementation.certify_sampled(
        rp.polishing.polishing_plant(slow), buildable_job.sampled.controller, delay=2.5e-5
    )
    assert found.valid
    period, slowest = (
        buildable_job.largest_period,
        buildable_job.slowest_actuator_hz,
    )
    plain = rp.given_controller(
        buildable_job.axis.problem.plant(),
        buildable_job.axis.continuous.controller,
    )
    plain.discretize(0.99 * period, delay=0.495 * period)
    with pytest.raises(rp.InfeasibleError):
        plain.discretize(1.02 * period, delay=0.51 * period)
    for factor, stable in ((1.02, True), (0.98, False)):
        plant = rp.polishing.polishing_plant(
            rp.polishing.PolishingHardware(actuator_bandwidth_hz=factor * slowest)
        )
        code = buildable_job.sampled.controller
        found = rp.implementation.certify_sampled(plant, code, delay=2.5e-5)
        assert found.stable is stable


def test_it_gains_within_its_limits_and_says_so(buildable_job):
    improvement = buildable_job.comparison.table["improvement"].sel(row="with control")
    assert float(improvement.sel(signal="y")) > 60
    assert float(improvement.sel(signal="z")) == pytest.approx(0, abs=1e-6)
    for name in buildable_job.plant.control_names:
        assert float(np.abs(buildable_job.run[name]).max()) < 20
        assert buildable_job.run[name].attrs["at_limit"] == 0
    assert 0 < buildable_job.noise_effort["u_y"] < 1
    assert buildable_job.slowest_actuator_hz < 1400
    assert buildable_job.verdict().startswith(
        "The controller can be built: sampled at 20 kHz with 25 µs"
    )
    beside, survived = buildable_job.tables()
    rows = {row[0]: row[1:] for row in beside.rows}
    delays = rows["delay that it bears besides its own [µs]"]
    assert delays == (
        1e6 * buildable_job.loop.delay_margin,
        1e6 * buildable_job.ideal_loop.delay_margin,
    )
    assert rows["measured signals"] == (2, 12)
    assert [row[:2] for row in survived.rows] == [(what, True) for what in buildable_job.survived]
    assert "This loop can be built" in str(buildable_job)


# What each limit of the hardware costs.


def test_one_limit_is_relaxed_at_a_time_and_options_do_not_mix():
    hardware = rp.polishing.PolishingHardware()
    found = dict(relaxed_hardware(hardware))
    assert list(found) == [
        "ideal sensors", "ideal actuators", "no computation delay", "ten times the sampling",
    ]  # fmt: skip
    assert all(other.lag < hardware.lag for other in found.values())
    assert math.isinf(found["ideal actuators"].actuator_limit)
    assert found["ideal sensors"].actuator_limit == hardware.actuator_limit
    assert found["ten times the sampling"].period == pytest.approx(hardware.period / 10)
    with pytest.raises(rp.InvalidInputError, match="hardware"):
        rp.polishing.design_against_brush(
            control_weight=1e-7, hardware=rp.polishing.PolishingHardware()
        )
    with pytest.raises(rp.InvalidInputError, match="realisation"):
        rp.polishing.design_against_brush(realisation="dream")
    with pytest.raises(rp.InvalidInputError, match="gain_bound"):
        rp.polishing.design_against_brush(realisation="buildable", gain_bound=1e6)


def test_the_rows_lie_between_no_control_and_the_ideal(buildable_job):
    rows = {row.what: row for row in buildable_job.limits}
    assert list(rows) == [
        "without control", "as it can be built", "ten times the sampling", "the thesis's ideal",
    ]  # fmt: skip
    norms = [row.norm for row in buildable_job.limits]
    assert norms == sorted(norms, reverse=True)
    built = rows["as it can be built"]
    assert built.stiffness == buildable_job.axis.stiffness
    assert built.norm == buildable_job.axis.sampled.certificate.achieved
    assert rows["without control"].effort == 0
    assert math.isnan(rows["the thesis's ideal"].stiffness)
    # the load of this short run is all within the landing
    assert built.deviation == pytest.approx(float(np.abs(buildable_job.run["y"]).max()), rel=1e-6)
    assert built.effort == pytest.approx(float(np.abs(buildable_job.run["u_y"]).max()), rel=1e-6)
