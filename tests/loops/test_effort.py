"""What noise and disturbances make the controls do: closed forms, units, given signals."""

import control
import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from tests.loops.loops_for_tests import s


def machine(controller):
    plant = rp.GeneralizedPlant.from_matrices(
        [[0, 1.0], [-4.0, -0.4]], [[0], [1.0]], [[0], [1.0]], [[1.0, 0]], [[1.0, 0]],
        disturbances=["F_d"], controls=["F"], measurements=["x"],
        units={"F_d": "N", "F": "N", "x": "m"},
    )  # fmt: skip
    return rp.loop_analysis(plant, controller)


def test_noise_of_a_first_order_loop():
    # KS = -2 (s + 1) / (s^2 + 3 s + 4): its square integral is (2^2 4 + 2^2) / (2 3 4)
    found = rp.loop_analysis(control.tf([1], [1, 1]), control.tf([-2], [1, 2])).noise[0]
    assert found.rms == pytest.approx(np.sqrt(20 / 24))
    response = control.step_response(-2 * (s + 1) / (s**2 + 3 * s + 4), np.linspace(0, 20, 40001))
    assert found.step_peak == pytest.approx(np.abs(response.outputs).max(), rel=1e-4)
    assert found.step_rate == pytest.approx(2.0)


def test_noise_by_simulation():
    analysis = machine(control.ss([[-20.0]], [[20.0]], [[-3.0]], 0))
    rng = np.random.default_rng(0)
    step, samples = 2e-3, 400_000
    density = 0.5
    noise = density * np.sqrt(1 / step) * rng.standard_normal(samples)  # per root hertz
    time = np.arange(samples) * step
    u = control.forced_response(analysis.KS, time, noise).outputs
    assert np.std(u) == pytest.approx(density * analysis.noise[0].rms, rel=0.03)
    assert (analysis.noise[0].unit, analysis.noise[0].source_unit) == ("N", "m")


def test_a_controller_that_answers_at_once_has_no_finite_noise():
    analysis = machine(-2)
    assert analysis.noise[0].rms == np.inf
    assert analysis.noise[0].step_rate == np.inf
    assert analysis.noise[0].peak_gain == pytest.approx(float(rp.hinf_norm(analysis.KS)))
    assert "low-pass" in analysis.explain()
    assert np.isfinite(analysis.effort[0].rms)


def test_disturbances_of_the_plant():
    analysis = machine(control.ss([[-20.0]], [[20.0]], [[-3.0]], 0))
    row = analysis.effort[0]
    assert (row.source, row.control, row.unit, row.source_unit) == ("F_d", "F", "N", "N")
    whole = analysis.loop.plant.with_control_outputs().closed_loop(analysis.loop.controller)
    part = control.ss(whole.A, whole.B, np.asarray(whole.C)[1:], np.asarray(whole.D)[1:])
    time = np.linspace(0, 40, 80001)
    u = control.step_response(part, time).outputs.ravel()
    assert row.step_peak == pytest.approx(np.abs(u).max(), rel=1e-3)
    assert row.step_rate == pytest.approx(np.abs(np.gradient(u, time)).max(), rel=1e-3)
    assert row.rms == pytest.approx(float(rp.h2_norm(part)))
    assert analysis.largest_rate == {"F": row.step_rate}


def test_a_plain_plant_is_disturbed_at_its_controls():
    row = rp.loop_analysis(control.tf([1], [1, 0]), -5).effort[0]
    assert (row.source, row.step_peak) == ("u[0]", pytest.approx(1.0, rel=1e-3))
    assert row.step_rate == pytest.approx(5.0)


def test_fast_and_slow_modes_together():
    # The fast pole at 1e7 gives the rate, the slow one at 1e-2 the peak.
    row = rp.loop_analysis(control.tf([1e7], [1, 1e7]) * control.tf([1], [1, 0]), -0.01).effort[0]
    assert row.step_rate == pytest.approx(0.01, rel=1e-3)
    assert row.step_peak == pytest.approx(1.0, rel=2e-3)


def test_given_signals():
    controller = control.ss([[-20.0]], [[20.0]], [[-3.0]], 0)
    analysis = machine(controller)
    time = np.linspace(0, 10, 5001)
    force = xr.Dataset({"F_d": ("time", np.sin(2 * time))}, {"time": time})
    found = rp.loop_analysis(analysis.loop.plant, controller, disturbance=force)
    row = found.given[0]
    whole = analysis.loop.plant.with_control_outputs().closed_loop(controller)
    u = control.forced_response(whole, time, np.sin(2 * time)).outputs[1]
    assert row.peak == pytest.approx(np.abs(u).max(), rel=1e-6)
    assert row.rms == pytest.approx(np.sqrt(np.mean(u**2)), rel=1e-6)
    assert row.peak_rate == pytest.approx(np.abs(np.diff(u)).max() / time[1], rel=1e-6)
    assert "given disturbance" in found.explain()
    for bad in (force.rename(F_d="F_z"), force.rename(time="t"), 3):
        with pytest.raises(rp.InvalidInputError, match="disturbance"):
            rp.loop_analysis(analysis.loop.plant, controller, disturbance=bad)


def test_discrete_noise_counts_by_sample():
    row = rp.loop_analysis(control.tf([0.5], [1, -1], 0.1), -1).noise[0]
    # KS = -(z - 1)/(z - 0.5): -1, 0.5, 0.25, ...
    assert row.rms == pytest.approx(np.sqrt(1 + 0.25 / (1 - 0.25)))
    assert row.step_rate == pytest.approx(1 / 0.1)


def test_a_control_that_is_an_output_too_keeps_its_name_and_unit():
    plant = rp.GeneralizedPlant.from_matrices(
        [[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]],
        disturbances=["F_d"], controls=["F"], measurements=["x"], units={"F": "N"},
    ).with_control_outputs()  # fmt: skip
    effort = rp.loop_analysis(plant, [[-3.0]]).effort
    assert [(one.source, one.control, one.unit) for one in effort] == [("F_d", "F", "N")]
