"""What each limit of the hardware costs."""

import math

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.polishing.buildable import relaxed_hardware


def test_one_limit_is_relaxed_at_a_time():
    hardware = rp.polishing.PolishingHardware()
    found = dict(relaxed_hardware(hardware))
    assert list(found) == [
        "ideal sensors", "ideal actuators", "no computation delay", "ten times the sampling",
    ]  # fmt: skip
    assert all(other.lag < hardware.lag for other in found.values())
    assert math.isinf(found["ideal actuators"].actuator_limit)
    assert found["ideal sensors"].actuator_limit == hardware.actuator_limit
    assert found["ten times the sampling"].period == pytest.approx(hardware.period / 10)


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


def test_a_limit_without_design_is_a_row_of_nothing(buildable_job, monkeypatch):
    from robustpolish.polishing import buildable as room

    def refused(*_):
        raise rp.InfeasibleError("hardware: none keeps its margins.")

    monkeypatch.setattr(room, "design_axis", refused)
    job = buildable_job
    asked = job.requirements
    rows = room.limits_of_hardware(job.axis, job.ideal.design, job.disturbance, asked)
    assert [math.isnan(row.norm) for row in rows] == [False, False, True, True, True, True, False]
