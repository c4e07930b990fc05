"""The main job: machine, disturbance, design, certificate, comparison."""

import numpy as np
import pytest

import robustpolish as rp
from tests import made_up


@pytest.fixture(scope="module")
def job():
    told = []
    made = rp.design_against_brush(
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


def test_a_price_is_set_where_none_is_named(job):
    made = job[0]
    assert (made.control_weight, made.gain_bound) == (1e-7, None)


def test_norms_are_those_without_the_price(job):
    made = job[0]
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
