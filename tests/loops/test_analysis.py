"""The analysis as a whole: figures, words, pictures, noise, effort, sampling."""

import json
import math
import re
from functools import cache

import control
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.base.saved import plain
from tests.loops.loops_for_tests import (
    CONDITIONAL,
    SATELLITE,
    TEXTBOOK,
    random_loop,
    s,
    satellite,
    textbook,
)


@pytest.fixture(scope="module")
def thesis():
    """The thesis's ideal state feedback: forces priced at 1e-7 m/N."""
    design = rp.state_feedback(rp.air_bearing(actuation="force"), control_weight=1e-7)
    return design, rp.loop_analysis(design)


def test_the_ideal_design_bears_a_fraction_of_a_microsecond(thesis):
    design, analysis = thesis
    assert 0.1e-6 < analysis.delay_margin < 0.3e-6
    fastest = np.abs(design.certificate.poles).max()
    # One fast pole: a quarter of a period at its rate.
    assert analysis.delay_margin == pytest.approx(np.pi / 2 / fastest, rel=1e-3)
    inputs = analysis.at_once["inputs"]
    assert inputs.any_delay_s == pytest.approx(analysis.delay_margin, rel=0.02)
    assert inputs.any_delay_s < analysis.delay_margin
    assert max(row.crossover_hz for row in analysis.bandwidths[:6]) == pytest.approx(
        fastest / (2 * np.pi), rel=1e-3
    )
    assert not analysis.buildable
    for text in ("makes it unstable", "takes all 12 states as measured", "without bound"):
        assert text in analysis.explain()


def test_the_ideal_design_cannot_be_sampled_at_a_megahertz(thesis):
    _, analysis = thesis
    assert 1e6 < analysis.sample_rate.lowest_stable_hz < analysis.sample_rate.needed_hz
    # One pole a with gain a and one sample of computation: z^2 - z + a T, stable while a T < 1.
    fastest = np.abs(analysis.loop.rates).max()
    assert analysis.sample_rate.lowest_stable_hz == pytest.approx(fastest, rel=0.02)


def test_it_shows_itself_and_gives_plain_numbers():
    analysis = textbook()
    text = repr(analysis)
    assert text.startswith("Loop analysis, continuous time: stable, cannot be built as it is")
    for caption in ("one loop at a time", "all at once", "Bandwidths", "Noise", "Sampling"):
        assert caption in text
    assert "<table>" in analysis._repr_html_()
    content = json.loads(json.dumps(plain(analysis.to_dict())))
    assert content["gain_margin"] == [0.0, pytest.approx(3.0)]
    assert content["at_once"]["inputs"]["disk"]["proven"] is True
    assert content["margins"][0]["gain_crossovers"][0]["frequency_hz"] == pytest.approx(
        0.749368 / (2 * math.pi), rel=1e-5
    )
    assert analysis.S.input_labels == ["y[0]"]
    assert [getattr(analysis, name)(0.3j) for name in ("S", "T", "KS", "GS")] == [
        getattr(analysis.output, name)(0.3j) for name in ("S", "T", "KS", "GS")
    ]


def test_the_worst_of_several_loops_counts():
    analysis = satellite()
    assert analysis.gain_margin == (0.0, math.inf)
    assert analysis.phase_margin == pytest.approx(90.0)
    assert analysis.delay_margin == min(
        m.common_delay_s for m in list(analysis.at_once.values())[:2]
    )
    assert analysis.disk_margin.alpha == pytest.approx(2.0)
    assert analysis.modulus_margin == pytest.approx(1.0)


def test_an_unstable_loop_says_so():
    analysis = textbook(1)
    assert not analysis.stable
    assert not analysis.buildable
    assert (analysis.margins, analysis.at_once, analysis.sample_rate) == ((), {}, None)
    numbers = [*analysis.gain_margin, analysis.phase_margin, analysis.delay_margin]
    assert np.isnan([*numbers, analysis.modulus_margin, analysis.disk_margin.alpha]).all()
    assert "NOT stable" in repr(analysis)
    for told in ("not stable", "with the opposite sign it would be", "no margins"):
        assert told in analysis.explain()
    assert "opposite" not in words(control.tf([1], [1, -1]) ** 2, -1)
    assert analysis.to_dict()["stable"] is False
    assert analysis.largest_rate == {}
    ax = analysis.plot(kind="nyquist")  # the curve shows why
    plt.close(ax.figure)
    with pytest.raises(rp.InvalidInputError, match="unstable"):
        analysis.plot(kind="step")


def test_marginal_loops_are_not_stable():
    analysis = rp.loop_analysis(control.tf([1], [1, 0, 1]), 0)
    assert not analysis.stable
    assert "imaginary axis" in analysis.explain()


@pytest.mark.parametrize("kind", ["bode", "sigma", "nyquist", "nichols", "step"])
def test_pictures(kind):
    analysis = satellite()
    for ax in (analysis.plot(kind), analysis.plot(kind=kind, place="output")):
        assert len(ax.lines) >= 2
        plt.close(ax.figure)
    own = plt.figure().subplots()
    assert analysis.plot(own, kind=kind, signal="u[1]") is own
    plt.close(own.figure)


def test_pictures_of_other_things_and_bad_names():
    analysis = satellite()
    for of in ("S", "KS", "GS"):
        plt.close(analysis.plot(kind="step", of=of, duration=3.0).figure)
    for bad in (
        {"kind": "smith"},
        {"place": "middle"},
        {"signal": "v"},
        {"kind": "step", "of": "L"},
    ):
        with pytest.raises(rp.InvalidInputError, match=list(bad)[-1]):
            analysis.plot(**bad)
    with pytest.raises(rp.InvalidInputError, match="requirements"):
        rp.loop_analysis(SATELLITE, -np.eye(2), requirements={"disk": 1})


def test_units_of_signals_change_no_margin():
    scale = np.diag([1e6, 1e-3])
    plant = control.ss(SATELLITE.A, SATELLITE.B @ scale, SATELLITE.C, 0)
    one, other = satellite(), rp.loop_analysis(plant, -np.linalg.inv(scale))
    assert other.delay_margin == pytest.approx(one.delay_margin, rel=1e-6)
    for where in ("inputs", "outputs", "inputs and outputs"):
        alphas = [analysis.at_once[where].disk.alpha for analysis in (one, other)]
        assert alphas[1] == pytest.approx(alphas[0], rel=2e-3)


def words(plant, controller=-1, **asked):
    asked = rp.LoopRequirements(**asked)
    return rp.loop_analysis(plant, controller, requirements=asked).explain()


def test_a_loop_that_can_be_built():
    text = words(control.tf([1], [1, 1]), control.tf([-4], [0.01, 1]))
    assert text.startswith("This loop can be built.")
    assert "per root hertz" in text


def test_noise_is_as_small_as_a_sensor_may_have():
    def told(unit):
        plant = rp.GeneralizedPlant.from_matrices(
            [[0, 1.0], [-1e6, -20.0]], [[0], [1.0]], [[0], [1.0]], [[1.0, 0]], [[1.0, 0]],
            measurements=["x"], controls=["F"], units={"x": unit, "F": "N"},
        )  # fmt: skip
        return words(plant, control.tf([-1e5], [1e-4, 1]))

    assert re.search(r"noise of 1 µm per root hertz on x moves F by [\d.]+ N RMS", told("m"))
    assert re.search(r"noise of 1 mm per root hertz on x moves F by \d.*e\+\d+ N RMS", told("mm"))


def test_delay_and_sampling_are_told_with_their_numbers():
    text = words(control.tf([1e6], [1, 0]))
    assert "a delay of 1.57 µs makes it unstable" in text
    assert "where 20 kHz can be bought" in text
    assert "of its delay margin" in words(control.tf([1e4], [1, 0]))
    assert words(control.tf([1e4], [1, 0]), sample_rate_hz=1e6, delay_s=0).startswith(
        "This loop can be built"
    )


def test_small_disks_alone_and_together():
    assert "disk margin at input u[0] is ±4.49 dB and ±28.4 deg" in textbook().explain()
    assert "at all inputs at once is ±0.866 dB" in satellite().explain()
    near = words(TEXTBOOK, disk_gain_db=3, disk_phase_deg=20)
    assert "comes within 0.432 of -1" in near


def test_conditional_stability_and_what_lies_outside():
    assert "only conditionally stable at input u[0]" in words(CONDITIONAL)
    plant = rp.GeneralizedPlant.from_matrices(
        [[-1.0, 0.0], [1.0, 0.0]], [[1.0], [0.0]], [[1.0], [0.0]], [[0.0, 1.0]], [[1.0, 0.0]],
        states=["x", "drift"],
    )  # fmt: skip
    assert "Outside the loop" in words(plant)
    assert "drift" in words(plant)


def test_all_states_measured_is_told():
    plant = rp.GeneralizedPlant.from_matrices(
        [[0, 1.0], [-4, -0.4]], [[0], [1.0]], [[0], [1.0]], [[1.0, 0]], [[1.0, 0]]
    ).with_full_state()
    assert "takes all 2 states as measured" in words(plant, [[-1.0, -2.0]])


def test_delays_that_the_plant_keeps_are_named():
    plant = rp.GeneralizedPlant.from_matrices([[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    assert "Padé" not in words(plant)
    assert "Delays of the plant (2 ms at u1) are exact" in words(plant.with_delay("u1", 2e-3))


def test_discrete_loops_count_samples():
    text = words(control.tf([0.5], [1, -1], 0.1))
    assert "sampled (10 Hz)" in text
    assert "further delay of less than 2.61 samples" in text
    assert "sampled at 10 Hz, where 5 Hz can be bought" in words(
        control.tf([0.5], [1, -1], 0.1), sample_rate_hz=5
    )
    bare = words(control.tf([0.5], [1, -1], True))
    assert "per sample" in bare
    assert " Hz" not in bare
    assert "per second" not in bare


def test_a_gain_far_beyond_the_plant():
    assert "times the plant's fastest own frequency" in words(control.tf([1e5], [1, 1]))
    assert "The gain of no single loop reaches 1" in words(control.tf([0.1], [1, 1]))


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e3, 1e9])
def test_time_may_be_counted_in_any_unit(scale):
    slow = control.ss(TEXTBOOK)
    plant = control.ss(scale * slow.A, scale * slow.B, slow.C, slow.D)
    found = rp.loop_analysis(plant, -1)
    assert found.delay_margin == pytest.approx(0.7595810246 / scale, rel=1e-8)
    assert found.disk_margin.alpha == pytest.approx(0.5053253, rel=1e-6)
    assert found.sample_rate.lowest_stable_hz == pytest.approx(1.955 * scale, rel=1e-3)


LAGGED = control.ss([[-20.0]], [[20.0]], [[-3.0]], 0)


@cache
def machine(controller=LAGGED):
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
    response = control.step_response(-2 * (s + 1) / (s**2 + 3 * s + 4), np.linspace(0, 20, 8001))
    assert found.step_peak == pytest.approx(np.abs(response.outputs).max(), rel=1e-4)
    assert found.step_rate == pytest.approx(2.0)


def test_noise_by_simulation():
    analysis = machine()
    rng = np.random.default_rng(0)
    step, samples = 2e-3, 200_000
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
    analysis = machine()
    row = analysis.effort[0]
    assert (row.source, row.control, row.unit, row.source_unit) == ("F_d", "F", "N", "N")
    whole = analysis.loop.plant.with_control_outputs().closed_loop(analysis.loop.controller)
    part = control.ss(whole.A, whole.B, np.asarray(whole.C)[1:], np.asarray(whole.D)[1:])
    time = np.linspace(0, 40, 20001)
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
    controller = LAGGED
    analysis = machine()
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


def test_rules_have_their_numbers():
    asked = rp.LoopRequirements(phase_loss_deg=10, delay_share=0.25)
    rate = rp.loop_analysis(control.tf([1], [1, 0]), -10, requirements=asked).sample_rate
    crossover = 10 / (2 * np.pi)
    assert rate.rules["phase at the gain crossover"] == pytest.approx(1.5 * 36 * crossover)
    assert rate.rules["delay margin"] == pytest.approx(1.5 / (0.25 * np.pi / 20))
    assert rate.rules["bandwidth"] == pytest.approx(20 * crossover)
    assert rate.rules["fastest closed-loop pole"] == pytest.approx(4 * 10 / 2.2)
    assert rate.needed_hz == max(rate.rules.values())
    assert rate.rules[rate.limited_by] == rate.needed_hz


def test_loops_that_any_or_no_rate_suits():
    quiet = rp.loop_analysis(control.tf([0.5], [1, 1]), -1).sample_rate
    assert quiet.lowest_stable_hz == 0.0
    static = rp.loop_analysis(control.ss([[-1.0]], [[1.0]], [[1.0]], [[2.0]]), -1)
    assert static.sample_rate.needed_hz == np.inf
    assert "No sampling is fast enough" in static.explain()
    assert rp.loop_analysis(control.tf([0.5], [1, -1], 0.1), -1).sample_rate is None


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


def lowest_rate(plant, controller, samples):
    asked = rp.LoopRequirements(computation_samples=samples)
    return rp.loop_analysis(plant, controller, requirements=asked).sample_rate.lowest_stable_hz


def test_an_integrator_with_gain():
    integrator = control.tf([1], [1, 0])
    assert lowest_rate(integrator, -10, 0) == pytest.approx(5.0)  # 1 - K T = -1
    assert lowest_rate(integrator, -10, 1) == pytest.approx(10.0)  # z^2 - z + K T
    assert lowest_rate(integrator, -10, 2) > 10.0


@pytest.mark.parametrize("samples", [0, 1, 2])
def test_the_lowest_rate_is_the_edge_of_stability_by_python_control(samples):
    plant, controller = random_loop(3)
    rate = lowest_rate(plant, controller, samples)
    for share, stable in ((1.01, True), (0.99, False)):
        period = 1 / (rate * share)
        held = control.c2d(plant, period, "zoh")
        K = control.c2d(controller, period, "tustin")
        late = control.ss(control.tf([1], [1] + [0] * samples, period))
        K = control.append(late, late) * K if samples else K
        assert bool(np.abs(control.feedback(held, K, 1).poles()).max() < 1) is stable


# For which machines near the model a loop is proven stable, and poles that are cancelled.


def two_masses(stiffness=2000.0):
    return rp.MechanicalModel(
        [rp.Dof("motor", 1.0), rp.Dof("load", 0.5)],
        [rp.Spring(("load", "motor"), stiffness)],
        [rp.Damper(("motor", "ground"), 5.0), rp.Damper(("load", "motor"), 0.5)],
        inputs=[rp.Input("F", ("motor", "ground"))],
        outputs=[rp.Output("tool", "load")],
    )


def sampled_oscillator():
    G = control.ss(1 / (s**2 + 0.1 * s + 1))
    return rp.implementation.plant_at_samples(rp.GeneralizedPlant(G, 1, 1), 0.01)


RANGES = {  # static feedback k g against stiffness k0: k0 (1 - 0.05 r) = k g (1 + 0.1 r)
    "oscillator": (1 / (s**2 + 0.1 * s + 1), 0.9, 0.1 / 0.14),
    "pendulum": (1 / (s**2 - 9), -(10 + 2 * s) / (0.01 * s + 1), 1 / 1.45),
    "sampled": (sampled_oscillator(), 0.9, 0.1 / 0.14),
    "damping": ((2 * s) / (s**2 + 0.2 * s + 1), 0.05, 0.1 / (0.02 + 0.01)),
}


@pytest.mark.parametrize("name", RANGES)
def test_the_range_for_which_a_loop_is_proven_is_that_of_closed_forms(name):
    plant, controller, want = RANGES[name]
    found = rp.loop_analysis(plant, controller).proven_range
    assert found.proven
    assert found.lower == pytest.approx(want, rel=0.03)
    assert found.lower <= want * (1 + 1e-3 * (name == "sampled"))


def test_a_servo_that_inverts_a_resonance_is_told_so():
    plant = rp.mixed_sensitivity(
        two_masses().state_space(), performance=control.tf([0.5, 60.0], [1, 0.06]), effort=1e-5
    )
    design = rp.output_feedback(plant)
    found = rp.loop_analysis(design)
    assert found.disk_margin.gain_db > 6
    assert not rp.loop_analysis(two_masses(0.9 * 2000), design.controller).stable
    assert not found.buildable
    assert found.proven_range.lower * 5 < 10
    for words in ("proven only for 0.8", "stiffness of the mode at 12.3 Hz", "-1.58 ± 77.4j"):
        assert words in found.explain()
    wider = rp.LoopRequirements(stiffness_percent=2.5, damping_percent=5, actuator_percent=5)
    assert rp.loop_analysis(design, requirements=wider).buildable


def test_a_cancelled_integrator_behind_a_delay_has_one_verdict_and_its_name():
    motor = rp.GeneralizedPlant.from_loop(control.ss(2 / (s * (0.1 * s + 1)))).with_delay(
        "u[0]", 0.05
    )
    for low in (4e-2, 4e-4, 4e-6):
        plant = rp.mixed_sensitivity(motor, performance=control.tf([0.5, 4], [1, low]), effort=1.0)
        design = rp.output_feedback(plant)
        found = rp.loop_analysis(design)
        assert design.certificate.exact_delays.stability.verdict == "stable"
        assert found.stable
        assert found.phase_margin > 60
        kept = np.abs(found.stability.poles).min() < 1e-3
        assert ("zeros at the plant's pole at 0 rad/s" in found.explain()) == kept


def test_an_integrator_outside_a_delayed_loop_is_outside():
    plant = rp.GeneralizedPlant.from_matrices(
        [[-1.0, 0.0], [1.0, 0.0]], [[1.0], [0.0]], [[1.0], [0.0]], [[0.0, 1.0]], [[1.0, 0.0]]
    ).with_delay("u1", 0.05)
    found = rp.loop_analysis(plant, [[-2.0]])
    assert found.stable
    assert "Outside the loop" in found.explain()


def test_a_rule_of_thumb_alone_is_no_verdict():
    quick = rp.loop_analysis(1 / (s + 1), -4 / (1e-5 * s + 1))
    assert quick.sample_rate.needed_hz > 100e3
    assert quick.sample_rate.lowest_stable_hz < 20e3
    assert quick.buildable
