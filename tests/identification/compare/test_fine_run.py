"""Runs in steps that are no part of the error."""

import numpy as np

import robustpolish as rp
from robustpolish.identification.free_runs import refine_steps as fine_run_from
from robustpolish.identification.observer.runs import InitialState, StartedPiece, free_run
from robustpolish.identification.observer.starts import refine_starts
from robustpolish.identification.record import record_of
from robustpolish.machines.simulation.run import simulate_model
from tests.identification.oscillators import PLACE, double_well, oscillator, record

SIZES = np.array([0.1, 1.0])


def refine_steps(run, pieces, sizes, search=lambda finer: []):
    return fine_run_from(run, pieces, sizes, search)


def of(model, data, start):
    held = record_of(model, data)
    run = free_run(model, held)
    return run, [StartedPiece(held, InitialState(np.array(start), np.zeros(0)))]


def stiff(noise):
    """Seven samples for a swing of a spring that stiffens, in steps a hundred times finer."""
    model = oscillator(damping=0.3).with_effect("cubic_stiffness", PLACE, {"stiffness": 4e4})
    data = record(2000).isel(time=slice(None, None, 20)).drop_vars("x")
    seen = simulate_model(model, data, [0.1, 0.0], substeps=128).outputs[:, 0]
    white = np.random.default_rng(0).standard_normal(seen.size)
    return model, data.assign(x=("time", seen + noise * np.std(seen) * white))


def test_steps_are_halved_until_they_do_not_show():
    model, data = stiff(1e-3)
    run, pieces = of(model, data, [0.1, 0.0])
    finer, started = refine_steps(run, pieces, SIZES)
    assert finer.runner.substeps > run.runner.substeps
    noise = 1e-3 * np.std(data["x"].values)
    assert np.std(run.errors(pieces[0])) > 1.3 * noise
    assert np.std(finer.errors(started[0])) < 1.1 * noise


def test_steps_that_do_not_show_stay():
    model, data = stiff(0.3)
    run, pieces = of(model, data, [0.1, 0.0])
    finer, started = refine_steps(run, pieces, SIZES)
    assert finer is run
    assert started == pieces


def test_a_linear_model_needs_no_steps():
    run, pieces = of(oscillator(), record(), [0.0, 0.0])
    assert refine_steps(run, pieces, SIZES)[0] is run


def test_runs_that_part_whatever_the_steps_stay_as_they_are():
    model, data = double_well(400.0)
    run, pieces = of(model, data, [1.0, 0.0])
    assert refine_steps(run, pieces, SIZES)[0] is run


def test_where_starts_are_lost_the_search_begins_anew_and_the_error_never_rises():
    """Starts that make up for rough steps, and sizes so small that they cannot be improved."""
    model, data = stiff(1e-3)
    run, true = of(model, data, [0.1, 0.0])
    rough = refine_starts(run, true, 10**6, SIZES, np.ones(1))
    still, asked = np.full(2, 1e-30), []

    def search(finer):
        asked.append(finer.runner.substeps)
        return true

    finer, started = refine_steps(run, rough, still, search)
    assert asked == [finer.runner.substeps] > [run.runner.substeps]
    assert started == true
    elsewhere = of(model, data, [-0.1, 5.0])[1]
    assert refine_steps(run, rough, still, lambda _: elsewhere) == (run, rough)


def test_a_run_that_diverges_stays_as_it_is():
    model = oscillator().with_effect("cubic_stiffness", PLACE, {"stiffness": -1e12})
    run, pieces = of(model, record(), [1.0, 0.0])
    assert refine_steps(run, pieces, SIZES)[0] is run


def test_a_comparison_judges_the_model_and_not_its_steps():
    model, data = stiff(1e-3)
    error = rp.compare(model, data).outputs["x"].rmse
    assert error < 1.1e-3 * float(data["x"].std())
