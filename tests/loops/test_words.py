"""The paragraph: what limits a loop, in words that name the number."""

import re

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.loops.report import explain, problems
from tests.loops.loops_for_tests import CONDITIONAL, SATELLITE, TEXTBOOK


def words(plant, controller=-1, **asked):
    analysis = rp.loop_analysis(plant, controller, requirements=rp.LoopRequirements(**asked))
    assert explain(analysis) == analysis.explain()
    assert tuple(problems(analysis)) == analysis.problems
    return analysis.explain()


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


def test_an_unstable_loop_has_no_margins():
    text = words(TEXTBOOK, 1)
    assert "not stable" in text
    assert "with the opposite sign it would be" in text
    assert "no margins" in text
    assert "opposite" not in words(control.tf([1], [1, -1]) ** 2, -1)


def test_delay_and_sampling_are_told_with_their_numbers():
    text = words(control.tf([1e6], [1, 0]))
    assert "a delay of 1.57 µs makes it unstable" in text
    assert "where 20 kHz can be bought" in text
    assert "of its delay margin" in words(control.tf([1e4], [1, 0]))
    assert words(control.tf([1e4], [1, 0]), sample_rate_hz=1e6, delay_s=0).startswith(
        "This loop can be built"
    )


def test_small_disks_alone_and_together():
    assert "disk margin at input u[0] is ±4.49 dB and ±28.4 deg" in words(TEXTBOOK)
    assert "at all inputs at once is ±0.866 dB" in words(SATELLITE, -np.eye(2))
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
