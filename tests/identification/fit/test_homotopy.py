from dataclasses import replace

import numpy as np
import pytest

from robustpolish.identification.compare import compare
from robustpolish.identification.fit.least_squares import (
    best_stage,
    evaluate_fit,
    fit,
    free_run_rms_checked,
    homotopy,
    ranking_log_error,
    short_window_rms,
    windows_from_stage,
)
from robustpolish.identification.fit.prepared import prepare
from robustpolish.identification.observer.runs import InitialState, StartedPiece
from robustpolish.identification.policy import POLICY
from robustpolish.identification.record import record_of
from tests.hidden_effects.cases import Case, model_of, records, two
from tests.identification.oscillators import PLACE, double_well, oscillator, record


def prepared_of(model, data):
    return prepare(model, record_of(model, data), POLICY)


def fitted(model, samples=2000, **options):
    prepared = prepared_of(model, record(samples, noise=0.01))
    spans = prepared.spans(prepared.trial)
    return prepared, homotopy(model, prepared, prepared.trial, model, spans, **options)


def test_a_distant_model_is_fitted_over_windows_that_grow():
    """At 150 instead of 400 N/m a free run is out of phase after a second."""
    prepared, stages = fitted(oscillator(stiffness=150.0), 4000)
    spans = prepared.spans(prepared.trial)
    assert len(stages) == len(spans) > 3
    for span, stage in zip(spans, stages, strict=True):
        assert max(piece.record.samples for piece in stage.pieces) <= 1.5 * span
    found = best_stage(stages, prepared)
    numbers = found.model.parameters
    assert numbers["spring[0].stiffness"] / numbers["dof.x.mass"] == pytest.approx(400, rel=0.01)
    assert found.reproducible
    noise = 0.01 * np.std(record(4000)["x"].values)
    np.testing.assert_allclose(found.error, noise, rtol=0.1)
    np.testing.assert_array_equal(found.error, found.free)
    whole = homotopy(oscillator(stiffness=150.0), prepared, prepared.trial,
                     oscillator(stiffness=150.0), spans[-1:])  # fmt: skip
    assert whole[-1].rmse > 10 * stages[-1].rmse  # at once it ends in a wrong minimum


def test_the_last_stage_goes_on_as_long_as_the_likelihood_grows():
    """One step may be enough for what only the next stage begins with."""
    model = oscillator(stiffness=350.0)
    prepared = prepared_of(model, record(2000, noise=0.01))
    spans = prepared.spans(prepared.trial)[-1:]
    (few,), (enough,) = (
        homotopy(model, prepared, prepared.trial, model, spans, 1, **more)
        for more in ({}, {"last": POLICY.follows(2000)})
    )
    assert enough.cost == pytest.approx(0.5 * enough.errors.size, rel=0.01)
    assert enough.rmse < 0.9 * few.rmse


def test_where_the_smoothed_motion_makes_a_law_diverge_windows_begin_at_rest():
    """As that of an accelerometer whose offset is not known yet."""
    model = oscillator().with_effect("quadratic_damping", PLACE, {"coefficient": 5.0})
    prepared = prepared_of(oscillator(), record(1000, noise=0.01))
    fast = [
        StartedPiece(p.record, InitialState(np.array([0.0, 1e6]), np.zeros(0)))
        for p in prepared.trial
    ]
    spans = prepared.spans(prepared.trial)[-1:]
    (found,) = homotopy(model, prepared, fast, model, spans, 20)
    assert found.rmse < 0.1 * np.std(record(1000)["x"].values)
    assert abs(found.pieces[0].start.state[1]) < 1.0


def test_a_stage_begins_where_the_one_before_ended():
    prepared, stages = fitted(oscillator(stiffness=300.0))
    last, model = stages[-2], stages[-2].model
    span = prepared.spans(prepared.trial)[-1]
    windows = windows_from_stage(model, prepared, prepared.trial, span, last)
    assert [w.record.samples for w in windows] == [p.record.samples for p in prepared.trial]
    starts = {piece.record.first: piece.start.state for piece in last.pieces}
    for window in windows:
        np.testing.assert_array_equal(window.start.state, starts[window.record.first])
    # within a window of the stage before, a start is where its run passes
    run = prepared.runner(model).run(model)
    halves = windows_from_stage(model, prepared, prepared.trial, 100, last)
    assert len(halves) > len(last.pieces)
    whole = last.pieces[0]
    seen = run.over(whole, keep=True).states
    for window in halves:
        row = window.record.first - whole.record.first
        if row < whole.record.samples:
            np.testing.assert_array_equal(window.start.state, seen[row])


def test_without_a_stage_before_windows_begin_at_the_smoothed_motion():
    prepared = prepared_of(oscillator(), record(2000, noise=0.001))
    clean = record(2000)["x"].values
    windows = windows_from_stage(oscillator(), prepared, prepared.trial, 150, None)
    assert sum(w.record.samples for w in windows) == sum(p.record.samples for p in prepared.trial)
    for window in windows:
        assert window.start.state[0] == pytest.approx(clean[window.record.first], abs=1e-4)


def test_numbers_that_are_known_are_not_led_astray_by_starts_that_do_not_suit_them():
    """No smoothed motion shows where a friction with memory stands."""
    case = Case("sticks", two(), [("elastic_coulomb_friction", ("x", "ground"), [4.0, 5000.0])],
                samples=3000, drive=8.0, noise_db=40.0)  # fmt: skip
    model, data = model_of(case), records(case)[0][0]
    prepared = prepared_of(model, data)
    true = model.with_effect(
        "elastic_coulomb_friction", ("x", "ground"), {"force": 4.0, "stiffness": 5000.0}
    )
    span = prepared.spans(prepared.trial)[-1]
    run = prepared.runner(true).run(true)
    smoothed, suited = (
        np.mean(
            run.all_errors(windows_from_stage(true, prepared, prepared.trial, span, None, known))
            ** 2
        )
        for known in (False, True)
    )
    assert suited < 0.9 * smoothed
    (found,) = homotopy(true, prepared, prepared.trial, model, [span], known=True)
    assert found.model.effects[0].values["force"] == pytest.approx(4.0, rel=0.05)


def test_a_stage_that_loses_the_data_is_no_start_for_the_next(monkeypatch):
    """The second stage's errors are made a hundredfold: the third begins at the first's numbers."""
    path = "robustpolish.identification.fit.least_squares.fit"
    began = []

    def spoilt(residuals, *rest):
        began.append(residuals.model)
        found = fit(residuals, *rest)
        return replace(found, errors=100 * found.errors) if len(began) == 2 else found

    monkeypatch.setattr(path, spoilt)
    _, stages = fitted(oscillator(stiffness=300.0), 4000)
    assert began[2].parameters == pytest.approx(stages[0].model.parameters)
    assert began[1].parameters == pytest.approx(stages[0].model.parameters)
    assert began[3].parameters != pytest.approx(stages[0].model.parameters)


def test_an_effect_that_vanished_begins_anew_over_longer_windows(monkeypatch):
    """At no stiffness its force has none to change it: no longer window would bring it back."""
    push = {"force": 2.0, "stiffness": 30.0}
    model = oscillator().with_effect("elastic_coulomb_friction", ("x", "ground"), push)
    began = []

    def emptied(residuals, *rest):
        began.append(residuals.model.effects[0].values)
        result = fit(residuals, *rest)
        gone = result.model.with_parameters({"effect[0].stiffness": 1e-5})
        return replace(result, model=gone) if len(began) == 1 else result

    monkeypatch.setattr("robustpolish.identification.fit.least_squares.fit", emptied)
    fitted(model)
    assert began[1] == began[0]
    assert began[1]["stiffness"] == 30.0


def test_the_last_stage_that_followed_the_data_is_among_the_last_two(monkeypatch):
    path = "robustpolish.identification.fit.least_squares.fit"
    found = []

    def spoilt(residuals, *rest):
        found.append(fit(residuals, *rest))
        return found[0] if len(found) == 1 else replace(found[-1], errors=1e3 * found[0].errors)

    monkeypatch.setattr(path, spoilt)
    _, stages = fitted(oscillator(stiffness=300.0))
    assert stages[-2] is stages[0] is found[0]


def test_a_wrong_model_is_closer_over_short_windows_than_over_long_ones():
    prepared, stages = fitted(oscillator())
    right, wrong = evaluate_fit(stages[-1], prepared), oscillator(stiffness=150.0)
    free, predictable = free_run_rms_checked(wrong, prepared, prepared.held_out)
    short = short_window_rms(wrong, prepared, prepared.held_out)
    assert predictable
    assert right.error < short < 0.5 * free
    # over windows of 80 samples a start for each takes two errors out of 80 away
    assert right.short == pytest.approx(right.free, rel=0.1)


def test_what_runs_once_only_is_judged_over_short_windows():
    prepared, stages = fitted(oscillator())
    found = evaluate_fit(stages[-1], prepared)
    np.testing.assert_array_equal(found.error, found.free)
    wild = replace(found, reproducible=False)
    np.testing.assert_array_equal(wild.error, found.short)


@pytest.mark.parametrize("length", [50, 66, 74, 100])
def test_comparison_and_diagnosis_agree_on_what_is_reproducible(length):
    model, data = double_well(length)
    prepared = prepared_of(model, data)
    predictable = free_run_rms_checked(model, prepared, prepared.everything)[1]
    assert predictable == compare(model, data).reproducible


def test_where_motion_fades_the_loud_pieces_rank_with_the_quiet_ones():
    prepared = prepared_of(oscillator(), record(2000, noise=0.01))
    found = evaluate_fit(
        homotopy(oscillator(), prepared, prepared.trial, oscillator(), [1000])[-1], prepared
    )
    np.testing.assert_array_equal(found.over_all, found.free)
    fading = replace(found, quieter_held_out=True)
    np.testing.assert_allclose(fading.over_all, np.sqrt(found.free * found.fitted))
    worse = replace(fading, over_fitted=lambda: 4 * found.fitted)
    assert ranking_log_error(worse, [fading]) - ranking_log_error(fading, [worse]) == pytest.approx(
        np.log(2)
    )


def test_windows_begun_anew_find_a_law_far_stronger_than_the_spring():
    """A smoothed motion knows nothing of a spring that is forty times as stiff in it."""
    machine = replace(two(), measured=[("x_m", "acceleration"), ("x", "displacement")])
    place, size = ("x", "x_m"), 1e9
    case = Case("stiff", machine, [("cubic_stiffness", place, [size])], excitation="none",
                start=0.01, samples=2500, noise_db=55.0)  # fmt: skip
    model, data = model_of(case), records(case)[0][0]
    prepared = prepared_of(model, data)
    begun = model.with_effect("cubic_stiffness", place, {"stiffness": 0.02 * size})
    spans = prepared.spans(prepared.trial, POLICY.growth)
    once, anew = (
        homotopy(begun, prepared, prepared.trial, model, spans, 2 * prepared.steps, anew=each)
        for each in (False, True)
    )
    found = anew[-1].model.effects[0].values["stiffness"]
    assert found == pytest.approx(size, rel=0.02)
    assert np.all(anew[-1].rmse < once[-1].rmse)
