"""Designs for machines: those of the methods, judged on the machine without weights."""

import numpy as np
import pytest

import robustpolish as rp
from tests.machine_design.machines import DESIGN, SPINDLE, WEIGHTS

MODEL = rp.MechanicalModel.from_toml(SPINDLE)


def test_an_output_feedback_with_sampling():
    found = rp.design_machine(SPINDLE + DESIGN, sample_rate_hz=20e3, computation_delay=2e-5)
    task = found.task
    own = rp.output_feedback(task.plant, control_weight=1e-6, measurement_noise=1e-3)
    assert found.design.certificate.achieved == own.certificate.achieved
    (channel,) = found.channels
    assert (channel.disturbance, channel.output, channel.unit) == ("F_cut", "spindle", "m/N")
    assert channel.without == pytest.approx(float(rp.hinf_norm(task.plant.open_loop)))
    assert channel.controlled == pytest.approx(float(rp.hinf_norm(found.loop)))
    assert found.sampled is not None
    assert found.sampled.period == 5e-5
    assert found.to_dict()["sampled"]["delay"] == 2e-5
    assert found.analysis.requirements.sample_rate_hz == 20e3
    assert found.tables()[0].caption == "Largest gains"
    assert "H-infinity" in found.verdict()
    assert found.plot().get_xlabel() == "frequency"
    assert "Design for a machine: optimal" in repr(found)


def test_mixed_sensitivity_is_judged_on_the_machine():
    task = rp.read_design_task(
        SPINDLE + DESIGN + WEIGHTS, control_weight=None, measurement_noise=None
    )
    found = rp.design_machine(task)
    S = found.analysis.output.S
    W = rp.weight(20.0, 10.0, 0.3)
    bound = found.design.certificate.bound
    for hertz in np.geomspace(0.01, 1e4, 50):
        s = 2j * np.pi * hertz
        assert abs(W(s) * S(s)) <= bound * (1 + 1e-6)
    assert found.machine.performance_names == ("spindle",)


def test_too_slow_a_sampling_does_not_stop_the_design():
    unstable = rp.GeneralizedPlant.from_matrices([[50.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    found = rp.design_machine(
        unstable, control_weight=0.1, measurement_noise=0.1, sample_rate_hz=5.0
    )
    assert found.sampled is None
    assert found.to_dict()["sampled"] is None
    assert "longest period" in found.sampling
    assert found.channels[0].without == np.inf


def test_state_feedback_and_prescribed_order():
    whole = rp.design_machine(MODEL, controls=["F"], full_state=True, control_weight=1e-6)
    assert whole.design.gain is not None
    assert whole.design.gain.shape == (1, 4)
    named = rp.design_machine(
        MODEL, controls=["F"], measurements=["slide", "spindle", "dslide", "dspindle"],
        control_weight=1e-6, method="riccati",
    )  # fmt: skip
    assert named.design.certificate.achieved == pytest.approx(
        whole.design.certificate.achieved, rel=1e-3
    )
    short = rp.design_machine(
        MODEL, controls=["F"], measurements=["x"], order=1, control_weight=1e-6, norm="h2",
        measurement_noise=1e-6,
    )  # fmt: skip
    assert short.design.controller.nstates == 1
    assert short.design.norm == "h2"


def test_a_mode_that_no_control_reaches_is_named():
    text = SPINDLE.replace("stiffness = 9.0e5", "stiffness = 0.0")
    text = text.replace("damping = 40.0", "damping = 0.0")
    with pytest.raises(rp.InfeasibleError, match="spindle"):
        rp.design_machine(text, controls=["F"], measurements=["x"])
