from itertools import pairwise

import numpy as np
import pytest
import xarray as xr

from robustpolish.errors import InvalidInputError
from robustpolish.identification.fit.prepared import has_integrator, prepare, with_initial_memory
from robustpolish.identification.observer.runs import StartedPiece, free_run
from robustpolish.identification.policy import POLICY, Policy
from robustpolish.identification.record import record_of
from tests.identification.oscillators import PLACE, RATE, of_rig, oscillator, record, rig


def prepared_of(model, data, policy=POLICY):
    return prepare(model, record_of(model, data), policy)


def ranges(pieces):
    return [(p.record.first, p.record.first + p.record.samples) for p in pieces]


def test_what_is_held_out_is_fitted_to_by_nobody():
    prepared = prepared_of(oscillator(), record(noise=0.01), Policy(trial=1000))
    assert ranges(prepared.estimation) == [(0, 1600), (2200, 3400)]
    assert ranges(prepared.held_out) == [(1600, 2200), (3400, 4000)]
    assert ranges(prepared.trial) == [(0, 1000), (2200, 3200)]
    assert ranges(prepared.everything) == [(0, 4000)]
    windows = ranges(prepared.windows)
    assert len(windows) == 25
    assert windows[0] == (0, 160)
    assert all(a[1] == b[0] for a, b in pairwise(windows))


def test_starts_are_those_of_the_motion():
    """The same as where a free run of the true model passes."""
    prepared = prepared_of(oscillator(), record(noise=0.001))
    clean = record()["x"].values
    for piece in prepared.held_out:
        assert piece.start.state[0] == pytest.approx(clean[piece.record.first], abs=1e-4)
    spread = [np.std(clean), np.std(np.gradient(clean, 1 / RATE))]
    np.testing.assert_allclose(prepared.motion_sizes, spread, rtol=0.02)
    run = free_run(oscillator(), prepared.record)
    for piece in prepared.with_fitted_starts(run, prepared.held_out):
        assert np.std(run.errors(piece)) < 0.0011 * np.std(clean)


def test_starts_that_the_smoothed_motion_loses_are_those_of_the_linear_part():
    """Smoothed accelerations drift: displacements of a piece may begin far off."""
    model = oscillator().with_effect("cubic_stiffness", PLACE, {"stiffness": 2e4})
    prepared = prepared_of(oscillator(), record(cubic=2e4))
    run = prepared.runner(model).run(model)
    far = [
        StartedPiece(piece.record, piece.start.with_vector(np.array([-0.5, 10.0])))
        for piece in prepared.held_out
    ]
    for piece in prepared.with_fitted_starts(run, far):
        assert np.std(run.errors(piece)) < 0.02 * np.std(piece.record.Y)


def test_decays_keep_their_beginning_and_half_of_the_rest_for_the_fit():
    time = np.arange(1000) / RATE
    x = 1e-3 * np.exp(-0.5 * time) * np.cos(np.sqrt(400 - 0.25) * time)
    data = xr.Dataset({"x": ("time", x)}, {"time": time})
    prepared = prepared_of(oscillator(inputs=[]), data)
    assert ranges(prepared.estimation) == [(0, 350), (650, 900)]
    assert ranges(prepared.held_out) == [(350, 650), (900, 1000)]


def loud(times, samples=1000):
    """A record so many times as large."""
    return record(samples, noise=0.01).map(lambda values: times * values)


def test_starts_and_memory_are_those_of_each_record():
    data = [record(1000, start, noise=0.001) for start in [(0.02, 0.0), (-0.02, 0.1)]]
    prepared = prepared_of(oscillator(), data)
    clean = [record(1000, start)["x"].values[0] for start in [(0.02, 0.0), (-0.02, 0.1)]]
    for piece, x in zip(prepared.everything, clean, strict=True):
        assert piece.start.state[0] == pytest.approx(x, abs=1e-4)
    values = {"force": 0.5, "static_force": 0.6, "velocity": 0.1, "stiffness": 3e3}
    model = oscillator().with_effect("lugre_friction", PLACE, values)
    windows = prepared.cut_windows(oscillator(), prepared.everything, 500)
    remembered = [p.start.internal[0] for p in prepared.with_propagated_memory(model, windows)]
    assert remembered[0] == remembered[2] == 0.0
    assert min(abs(remembered[1]), abs(remembered[3])) > 1e-6


def test_repeats_say_how_large_the_noise_is():
    data = [record(2000, noise=0.03, seed=0), record(2000, noise=0.03, seed=0)]
    noise = 0.03 * np.std(record(2000)["x"].values)
    assert prepared_of(oscillator(), data).repeats is None  # one and the same
    white = np.random.default_rng(5).standard_normal(2000)
    data[1] = record(2000).assign(x=record(2000)["x"] + noise * white)
    prepared = prepared_of(oscillator(), data)
    assert prepared.repeats.pairs == (("record 1", "record 2"),)
    assert prepared.scales.noise[0] == pytest.approx(noise, rel=0.1)


def test_pieces_of_several_records():
    """As many samples are tried as of one record."""
    data = [loud(times) for times in (10, 1, 12, 1.3, 15, 1.2)]
    prepared = prepared_of(oscillator(), data)
    assert [(p.record.name, p.record.samples) for p in prepared.held_out] == [
        ("record 3", 1000),
        ("record 6", 1000),
    ]
    assert [p.record.samples for p in prepared.trial] == [1000] * 4
    assert ranges(prepared.everything) == [(1000 * i, 1000 * (i + 1)) for i in range(6)]
    few = prepared_of(oscillator(), data, Policy(trial=500))
    assert [p.record.samples for p in few.trial] == [250] * 4


def test_the_liveliest_of_several_records_is_screened():
    prepared = prepared_of(oscillator(), [loud(1), loud(3), loud(2)])
    assert (prepared.screened.first, prepared.screened.samples) == (1000, 1000)


def test_what_integrates_is_run_in_short_pieces():
    assert has_integrator(oscillator(springs=[]), 100.0)
    assert not has_integrator(oscillator(), 100.0)
    # a pole at -0.0101 1/s forgets within 99 s
    assert not has_integrator(oscillator(stiffness=1e-2), 100.0)
    assert has_integrator(oscillator(stiffness=1e-2), 98.0)
    assert not has_integrator(rig(), 100.0)
    prepared = prepared_of(oscillator(springs=[]), record(noise=0.01))
    assert len(prepared.everything) == 25
    assert len(prepared.estimation) == 10 + 8


def test_the_liveliest_part_is_screened():
    data = record(noise=0.01)
    lively = (data["time"] >= 5.0) & (data["time"] < 7.8)
    quiet = data.assign(x=data["x"] * np.where(lively, 1.0, 0.1))
    part = prepared_of(oscillator(), quiet, Policy(screened=1400)).screened
    assert part.samples == 1400
    assert part.first == pytest.approx(2500, abs=1400 // 20)
    imposed = prepared_of(rig(), of_rig(), Policy(screened=100))
    assert imposed.screened.samples == 1000  # quick: all of it


def test_new_effects_begin_at_rest():
    pieces = prepared_of(oscillator(), record(noise=0.01)).held_out
    model = oscillator().with_effect("lugre_friction", PLACE)
    for before, after in zip(pieces, with_initial_memory(model, pieces), strict=True):
        np.testing.assert_array_equal(after.start.state, before.start.state)
        np.testing.assert_array_equal(after.start.internal, [0.0])
        after.start.internal[:] = 3.0
        kept = with_initial_memory(model.with_effect("bouc_wen_hysteresis", PLACE), [after])[0]
        np.testing.assert_array_equal(kept.start.internal[:1], [3.0])
        assert not kept.start.internal[1:].any()


def test_a_record_in_the_wrong_unit_is_refused():
    data = record(noise=0.01)
    with pytest.raises(InvalidInputError, match="units"):
        prepared_of(oscillator(), data.assign(x=1e-15 * data["x"]))


def test_windows_grow_from_a_few_swings_to_whole_pieces():
    prepared = prepared_of(oscillator(), record(noise=0.01))
    longest = max(piece.record.samples for piece in prepared.estimation)
    for growth in (2, 4):
        spans = prepared.spans(prepared.estimation, growth)
        assert spans[-1] == longest
        assert all(b == growth * a for a, b in pairwise(spans[:-1]))
        assert 2 * spans[-2] < longest <= 2 * growth * spans[-2]
    swing = 2 * np.pi / prepared.scales.bandwidth * RATE
    assert spans[0] == pytest.approx(1.5 * swing, abs=1)  # above the least of 50
    few = prepared.cut_windows(oscillator(), prepared.everything, 40)[:1]
    assert prepared.spans(few) == [40]


def test_pieces_are_cut_into_windows_with_starts_of_their_own():
    model = oscillator().with_effect("lugre_friction", PLACE)
    prepared = prepared_of(oscillator(), record(noise=0.001))
    windows = prepared.cut_windows(model, prepared.held_out, 150)
    assert ranges(windows) == [
        (1600, 1750), (1750, 1900), (1900, 2050), (2050, 2200),
        (3400, 3550), (3550, 3700), (3700, 3850), (3850, 4000),
    ]  # fmt: skip
    clean = record()["x"].values
    for window in windows:
        assert window.start.state[0] == pytest.approx(clean[window.record.first], abs=1e-4)
        np.testing.assert_array_equal(window.start.internal, [0.0])
    whole = prepared.cut_windows(model, prepared.held_out, 600)
    assert ranges(whole) == ranges(prepared.held_out)


def test_an_effect_remembers_what_happened_in_the_window_before():
    """The force of bristles at the end of a window is where that of the next begins."""
    values = {"force": 0.5, "static_force": 0.6, "velocity": 0.1, "stiffness": 3e3}
    model = oscillator().with_effect("lugre_friction", PLACE, values)
    prepared = prepared_of(oscillator(), record(noise=0.001))
    cut = prepared.cut_windows(oscillator(), prepared.held_out, 300)
    assert [p.start.internal.size for p in cut] == [0] * 4
    pieces = prepared.with_propagated_memory(model, cut)
    run = free_run(model, prepared.record)
    still = with_initial_memory(model, cut)
    for i in (1, 3):
        end = run.over(still[i - 1], keep=True).internal[-1]
        np.testing.assert_array_equal(pieces[i].start.internal, end)
        assert abs(end[0]) > 0.05
    for i in (0, 2):  # nothing is known of what happened before
        np.testing.assert_array_equal(pieces[i].start.internal, [0.0])
    none = prepared.with_propagated_memory(oscillator(), cut)
    assert ranges(none) == ranges(cut)


def test_a_decay_fades_and_a_steady_motion_does_not():
    """What is held out of a decay is quieter than what is fitted."""
    data = record(noise=0.01)
    time = data["time"] - data["time"][0]
    assert not prepared_of(oscillator(), data).quieter_held_out
    dying = data.assign(x=data["x"] * np.exp(-time))
    assert prepared_of(oscillator(), dying).quieter_held_out
    assert not prepared_of(oscillator(), dying, Policy(quieter_held_out=1e6)).quieter_held_out


def test_what_is_screened_ends_with_the_motion():
    data = record(noise=0.01)
    noise = float(data["x"].std()) * 1e-3 * np.random.default_rng(3).standard_normal(data.time.size)
    early = data.assign(x=data["x"] * np.exp(-20 * (data["time"] - data["time"][0])) + noise)
    part = prepared_of(oscillator(), early).screened
    assert part.first == 0
    assert POLICY.least_moving <= part.samples < data.time.size / 2


def test_every_step_of_a_run_is_counted():
    prepared = prepared_of(oscillator(), record(noise=0.01))
    run = prepared.runner(oscillator()).run(oscillator())
    before = prepared.work.spent
    run.all_errors(prepared.trial)
    run.over(prepared.trial[0])
    samples = [piece.record.samples for piece in (*prepared.trial, prepared.trial[0])]
    assert prepared.work.spent - before == sum(samples) * run.run.substeps
    assert prepared.work.left()
    little = prepared_of(oscillator(), record(noise=0.01), Policy(work=1.0))
    little.runner(oscillator()).run(oscillator()).all_errors(little.trial)
    assert not little.work.left()
    assert little.work.refused


def test_runs_that_were_found_last_are_kept():
    prepared, model = prepared_of(oscillator(), record(noise=0.01)), oscillator()
    run, started = prepared.run_with_fitted_starts(model, prepared.everything)
    spent = prepared.work.spent
    again = prepared.run_with_fitted_starts(model, prepared.everything)
    assert again[0] is run
    assert again[1] is started
    assert prepared.work.spent == spent
    assert prepared.run_with_fitted_starts(model, prepared.windows)[1] is not started
    assert prepared.run_with_fitted_starts(oscillator(), prepared.everything)[0] is not run
    assert prepared.work.spent > spent
