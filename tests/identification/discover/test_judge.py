from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from robustpolish.identification.policy import POLICY
from robustpolish.identification.record import record_of
from robustpolish.identification.structure.moves_add import select_effect
from robustpolish.identification.structure.score import (
    equivalence_tolerance,
    motion_line_reason,
    ranking_error,
    rejection_reason,
    required_advantage,
    undetermined_parameter,
)
from robustpolish.machines.effects.effect import Effect
from tests.identification.discover.searches import (
    MODEL,
    STRIBECK,
    cubic,
    drag,
    judged,
    prepared_of,
    refitted,
    search_of,
)
from tests.identification.oscillators import PLACE, RATE, oscillator, record


def test_short_windows_judge_unless_all_runs_can_be_repeated():
    predictable, wild = cubic(2.0, short=3.0), drag(9.0, short=0.5, reproducible=False)
    assert ranking_error(predictable.fitted, [predictable]) == pytest.approx(np.log(2.0))
    assert ranking_error(predictable.fitted, [predictable, wild]) == pytest.approx(np.log(3.0))
    assert ranking_error(wild.fitted, [predictable, wild]) == pytest.approx(np.log(0.5))
    two = judged(MODEL, [2.0, 8.0])
    assert ranking_error(two, []) == pytest.approx(np.log(4.0))
    assert np.isfinite(ranking_error(judged(MODEL, 0.0), []))


def test_an_effect_has_to_make_the_error_fall_visibly(search):
    before = judged(MODEL, 10.0)
    assert rejection_reason(before, cubic(7.9).fitted, search.prepared) is None
    assert (
        rejection_reason(before, cubic(8.1).fitted, search.prepared)
        == "the held-out error falls by 19 % only"
    )
    assert (
        rejection_reason(before, cubic(12.0).fitted, search.prepared)
        == "the held-out error falls by 0 % only"
    )


def test_errors_of_several_outputs_may_fall_visibly_together(search):
    before = judged(MODEL, [10.0, 10.0])
    assert (
        rejection_reason(before, cubic([8.5, 9.2]).fitted, search.prepared) is None
    )  # 0.78 of both
    assert rejection_reason(before, cubic([8.5, 9.6]).fitted, search.prepared) is not None


@pytest.mark.parametrize(
    ("held_out", "fitted", "earned"),
    [(1.0, 3.0, True), (1.05, 3.0, True), (1.2, 3.0, False), (1.0, 4.0, False)],
)
def test_where_what_is_held_out_is_far_quieter_the_fitted_blocks_judge(
    search, held_out, fitted, earned
):
    """As of a decay whose end says nothing of a law that shows in large motions alone."""
    before, after = judged(MODEL, 2.0), cubic(2 * held_out).fitted
    loud, left = sized(before, 20.0), sized(after, 2 * fitted)
    assert (rejection_reason(loud, left, search.prepared) is None) == earned
    assert rejection_reason(sized(before, 5.0), sized(after, 1.0), search.prepared) is not None


@pytest.mark.parametrize(
    ("held_out", "loud", "left", "earned"),
    [
        (1.0, 2.5, 1.2, True),
        (1.0, 2.5, 1.3, False),  # the fitted blocks still have more than the held-out ones
        (1.0, 2.5, 0.7, False),  # the held-out ones have something that does not go
        (1.0, 1.9, 1.2, False),  # they fall by less than twice what held-out ones would have to
        (1.15, 2.5, 1.2, False),  # and the held-out errors rise
    ],
)
def test_what_acts_in_fitted_blocks_alone_has_to_leave_all_blocks_alike(
    search, held_out, loud, left, earned
):
    """As after a sweep that passed a resonance in none of the held-out blocks."""
    before, after = judged(MODEL, 2.0), cubic(2 * held_out).fitted
    told = rejection_reason(sized(before, 2 * loud), sized(after, 2 * left), search.prepared)
    assert (told is None) == earned


@pytest.mark.parametrize(
    ("held_out", "left", "earned"),
    [(1.0, 5.5, True), (1.0, 6.5, False), (1.15, 5.5, False)],
)
def test_where_noise_alone_is_held_out_the_fitted_blocks_judge(search, held_out, left, earned):
    """As of a decay that is over before the first held-out block begins."""
    before, after = judged(MODEL, 1.0), cubic(held_out).fitted
    told = rejection_reason(sized(before, 10.0), sized(after, left), search.prepared)
    assert (told is None) == earned


@pytest.mark.parametrize(("quieter_held_out", "colour", "earned"), [
    (True, 2.0, True), (True, 1.5, False), (False, 2.0, False),
])  # fmt: skip
def test_noise_that_is_held_out_of_a_decay_has_its_colour(
    search, monkeypatch, quieter_held_out, colour, earned
):
    """The end of the decay shows that there is more of it than its white part."""
    path = "robustpolish.identification.residuals.tests.residual_noise_floor"
    monkeypatch.setattr(path, lambda model, prepared, predictable: np.array([colour]))
    before, after = (
        replace(
            fading(fitted, loud), quieter_held_out=quieter_held_out, fit=sized(fitted, loud).fit
        )
        for fitted, loud in ((judged(MODEL, 2.0), 5.2), (cubic(2.0).fitted, 2.7))
    )
    assert (rejection_reason(before, after, search.prepared) is None) == earned


@pytest.mark.parametrize(("loud", "earned"), [(1.5, True), (1.3, False)])
def test_where_noise_alone_is_left_everywhere_a_visible_fall_is_enough(search, loud, earned):
    before, after = judged(MODEL, 1.0), cubic(1.0).fitted
    told = rejection_reason(sized(before, loud), sized(after, 1.1), search.prepared)
    assert (told is None) == earned


def test_a_rise_of_quiet_held_out_errors_weighs_less_than_the_fall_of_loud_ones(search):
    """One of two held-out errors rises by a little more than the other falls, all others fall."""
    before, after = judged(MODEL, [1.1, 2.0]), cubic([1.35, 1.7]).fitted
    loud, left = sized(before, [2.4, 6.0]), sized(after, [1.6, 2.0])
    assert rejection_reason(loud, left, search.prepared) is None
    assert rejection_reason(before, after, search.prepared) is not None


def test_several_outputs_may_fall_by_half_of_that_together(search):
    """The fitted blocks count where held-out errors fall by a tenth in all, none of them alone."""
    before, after = judged(MODEL, [10.0, 10.0, 10.0]), cubic([9.1, 9.3, 9.9]).fitted
    loud = sized(before, 20.0)
    assert rejection_reason(loud, sized(after, 5.0), search.prepared) is None
    assert rejection_reason(loud, sized(after, 18.0), search.prepared) is not None
    less = cubic([9.7, 9.8, 9.9]).fitted
    assert rejection_reason(loud, sized(less, 5.0), search.prepared) is not None


def test_numbers_that_stand_for_each_other_keep_nothing_out_that_takes_the_error_away(search):
    """Of a mass that hangs somewhere a free decay tells the frequency, and hardly the mass."""
    loops = {"force": 1.0, "stiffness": 5.0, "exponent": 1.0}
    for left, refused in ((4.0, True), (2.0, False)):
        vague = refitted(MODEL, "bouc_wen_hysteresis", PLACE, loops, left, share=0.7)
        said = rejection_reason(judged(MODEL, 10.0), vague.fitted, search.prepared)
        assert (said is not None) == refused


def sized(found, rms):
    """The same with another error where it was fitted."""
    errors = found.fit.errors * rms / found.fit.rmse
    return replace(found, fit=replace(found.fit, errors=errors))


def test_no_output_may_pay_for_another(search):
    before = judged(MODEL, [10.0, 10.0])
    assert rejection_reason(before, cubic([5.0, 11.0]).fitted, search.prepared) is None
    assert rejection_reason(before, cubic([5.0, 19.0]).fitted, search.prepared) == (
        "one output gains what another loses"
    )


def test_an_output_that_sees_nothing_of_an_effect_says_nothing_against_it(search):
    before = judged(MODEL, [10.0, 10.0, 10.0])
    assert rejection_reason(before, cubic([7.9, 10.0, 10.0]).fitted, search.prepared) is None


def test_short_windows_count_where_a_run_cannot_be_repeated(search):
    before = judged(MODEL, 10.0)
    wild = cubic(20.0, short=5.0, reproducible=False)
    assert rejection_reason(before, wild.fitted, search.prepared) is None
    assert rejection_reason(before, cubic(20.0, short=5.0).fitted, search.prepared)


def test_numbers_have_to_be_determined_and_plausible(search):
    before = judged(MODEL, 10.0)
    assert rejection_reason(before, cubic(2.0, share=0.4).fitted, search.prepared) is None
    vague = cubic(2.0, share=0.7).fitted
    assert rejection_reason(before, vague, search.prepared) == "its stiffness is not determined"
    loops = {"force": 1.0, "stiffness": 5.0, "exponent": 20.0}
    odd = refitted(MODEL, "bouc_wen_hysteresis", PLACE, loops, 2.0)
    assert "elastic Coulomb" in str(rejection_reason(before, odd.fitted, search.prepared))


def test_a_delay_within_a_sample_is_no_finding():
    """What an input does between its samples looks like a delay of a part of one."""
    model = oscillator()
    prepared = prepared_of(model, record(1000))

    def remark(samples):
        delay = {"delay": samples * prepared.record.dt}
        late = refitted(model, "input_delay", ("F",), delay, 2.0)
        return rejection_reason(judged(model, 10.0), late.fitted, prepared)

    assert str(remark(0.4)).startswith("a delay of 0.4 samples is what its input does")
    assert remark(1.6) is None
    # held, it is late by half a sample already: one more is none of the hold
    model = oscillator().with_effect("input_hold", ("F",), {"order": 0.0})
    assert str(remark(0.1)).startswith("a delay of 0.1 samples is what its input does")
    assert remark(0.5) is None


@pytest.mark.parametrize(("mass", "earned"), [(1.0, True), (1e5, False)])
def test_what_hangs_on_a_machine_is_not_the_ground(mass, earned):
    """With a mass without end it drifts as the offset of a sensor makes a motion seem to."""
    model = oscillator()
    prepared = prepared_of(model, record(1000))
    values = {"mass": mass, "stiffness": 1.0, "damping": 1.0}
    item = refitted(model, "attached_resonator", ("x",), values, 2.0)
    told = rejection_reason(judged(model, 10.0), item.fitted, prepared)
    assert (told is None) == earned
    assert earned or "far more than the machine has" in told


def test_an_effect_in_the_middle_is_judged_by_its_own_numbers(search):
    first = MODEL.with_effect("cubic_stiffness", PLACE, {"stiffness": 3.0})
    both = judged(first.with_effect("quadratic_damping", PLACE, {"coefficient": 3.0}), 2.0, share=1)
    before = judged(MODEL, 10.0)
    assert rejection_reason(before, both, search.prepared) == "its coefficient is not determined"
    assert (
        rejection_reason(before, both, search.prepared, place=-2)
        == "its stiffness is not determined"
    )


def test_more_numbers_ask_for_a_visible_advantage_far_above_the_noise(search):
    friction = {"force": 3.0, "static_force": 4.0, "velocity": 0.5}
    noise = float(search.prepared.scales.noise[0])
    for error, numbers, visible in ((5.0, 1, True), (5.0, 3, False), (2.0, 1, False)):
        stribeck = refitted(MODEL, "stribeck_friction", PLACE, friction, error * noise)
        asked = (
            -np.log(1 - search.policy.visible_fall) if visible else equivalence_tolerance(search)
        )
        assert required_advantage(stribeck, numbers, search) == pytest.approx(asked)


def test_a_line_of_inputs_that_repeat_is_no_force_from_outside():
    """Noise that repeats every second has all lines of whole hertz, and no other."""
    random = np.random.default_rng(0)
    time = np.arange(1500) / RATE
    data = xr.Dataset(
        {
            "F": ("time", np.tile(random.standard_normal(500), 3)),
            "x": ("time", 0.01 * random.standard_normal(1500)),
        },
        {"time": time},
    )
    search = search_of(oscillator(), data)
    search.stage = judged(oscillator(), 10.0)

    def humming(hertz, free, **options):
        values = {"amplitude": 1.0, "frequency": hertz}
        return refitted(oscillator(), "harmonic_force", "x", values, free, **options)

    assert rejection_reason(search.stage, humming(7.5, 2.0).fitted, search.prepared) is None
    said = rejection_reason(search.stage, humming(7.0, 2.0).fitted, search.prepared)
    assert said is not None
    assert "repeat every 1 s" in said
    drag = refitted(oscillator(), "quadratic_damping", PLACE, {"coefficient": 3.0}, 2.1, score=-1.0)
    likely = replace(drag, screened=replace(drag.screened, score=50.0))
    assert select_effect([drag], search) == [drag]
    assert select_effect([humming(7.0, 2.0), likely], search) == [likely]
    assert select_effect([humming(7.0, 2.0), drag], search) == []
    assert any("merely repeats with the inputs" in reason for reason in search.reasons)


def test_a_force_whose_frequency_is_known_well_is_told_from_lines_of_the_inputs():
    """The record resolves 0.06 Hz; a fit knows the frequency far better than that."""
    time = np.arange(2000) / 125.0
    rng = np.random.default_rng(0)
    phases = rng.uniform(0, 2 * np.pi, 9)
    push = sum(np.cos(2 * np.pi * k * time / 8 + p) for k, p in enumerate(phases, 1))
    data = xr.Dataset({"F": ("time", push), "x": ("time", 1e-3 * push)}, {"time": time})
    model = oscillator()
    measured = record_of(model, data)
    near = Effect("harmonic_force", "x", {"amplitude": 1.0, "frequency": 7.01})
    assert motion_line_reason(near, model, measured)
    assert motion_line_reason(near, model, measured, error=0.003)
    assert motion_line_reason(near, model, measured, error=0.001) is None
    on = Effect("harmonic_force", "x", {"amplitude": 1.0, "frequency": 7.0})
    assert motion_line_reason(on, model, measured, error=1e-9)


def test_a_decay_has_its_own_line():
    """A decay at 3.18 Hz, which a frequency that shifts with the amplitude blurs by a tenth."""
    model = oscillator(inputs=[])
    time = np.arange(2000) / RATE
    x = 1e-3 * np.exp(-0.5 * time) * np.cos(20 * time)
    record = record_of(model, xr.Dataset({"x": ("time", x)}, {"time": time}))
    own = 20 / (2 * np.pi)
    for ratio, said in ((1.0, True), (1.05, True), (0.95, True), (1.3, False), (3.0, False)):
        hum = Effect("harmonic_force", "x", {"amplitude": 1.0, "frequency": ratio * own})
        assert bool(motion_line_reason(hum, model, record)) == said
    assert motion_line_reason(Effect("cubic_stiffness", PLACE), model, record) is None


def test_where_it_takes_the_error_away_by_far_a_line_near_a_mode_comes_from_outside():
    model = oscillator(inputs=[])
    time = np.arange(2000) / RATE
    x = 1e-3 * np.exp(-0.5 * time) * np.cos(20 * time)
    prepared = prepared_of(model, xr.Dataset({"x": ("time", x)}, {"time": time}))
    own = {"amplitude": 1.0, "frequency": 1.05 * 20 / (2 * np.pi)}
    for left, refused in ((5.0, True), (3.0, False)):
        hum = refitted(model, "harmonic_force", "x", own, left)
        said = rejection_reason(judged(model, 10.0), hum.fitted, prepared)
        assert (said is not None and "by itself" in said) == refused


@pytest.mark.parametrize(
    ("held_out", "left", "earned"),
    [(2.4, 0.3, True), (2.4, 0.5, False), (2.1, 0.5, True), (2.0, 0.7, False), (1.6, 0.9, True)],
)
def test_where_motion_fades_quiet_and_loud_blocks_judge_together(search, held_out, left, earned):
    """What is still missing may cost the quiet blocks a part of what the loud ones gain."""
    before, after = fading(judged(MODEL, 2.0), 8.0), fading(cubic(held_out).fitted, 8.0 * left)
    told = rejection_reason(before, after, search.prepared)
    assert (told is None) == earned


def fading(fitted, loud):
    """A fit in a motion that fades, with the error of its louder blocks."""
    return replace(fitted, quieter_held_out=True, over_fitted=lambda: np.array([loud]))


@pytest.mark.parametrize(("share", "open_"), [(0.05, None), (0.15, "static_force")])
def test_a_friction_at_rest_that_may_be_the_sliding_one_is_open(share, open_):
    """Each may be well known, and what they differ by is not."""
    fit = judged(MODEL.with_effect("stribeck_friction", PLACE, STRIBECK), 10.0, share=share).fit
    assert undetermined_parameter(fit, 0, POLICY, every=True) == open_
    assert undetermined_parameter(fit, 0, POLICY) is None
