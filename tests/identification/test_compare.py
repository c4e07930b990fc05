"""Comparisons of models with records: figures, several records, true models."""

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.identification.observer.runs import Reproducibility
from tests.identification.drawn_machines import drawn
from tests.identification.oscillators import PLACE, RATE, double_well, oscillator, record

# Error figures, initial states, windows.


def test_the_true_model_is_perfect_from_any_start():
    for start in [(0.0, 0.0), (0.02, -0.3)]:
        result = rp.compare(oscillator(), record(start=start))
        assert result.fit_percent > 99.95
        np.testing.assert_allclose(result.starts[0], start, atol=2e-5)
        assert result.reproducible
        assert result.notes == ()


def test_the_figures_are_those_of_their_definitions():
    data = record(noise=0.1)
    result = rp.compare(oscillator(stiffness=380.0), data)
    y, e = data["x"].values, data["x"].values - result.simulated["x"].values
    error = result.outputs["x"]
    assert error.rmse == pytest.approx(np.sqrt(np.mean(e**2)))
    assert error.nrmse == pytest.approx(np.linalg.norm(e) / np.linalg.norm(y - y.mean()))
    assert error.fit_percent == pytest.approx(100 * (1 - error.nrmse))
    assert error.relative == pytest.approx(np.linalg.norm(e) / np.linalg.norm(y))
    assert error.unit == "m"
    assert error.band[0] < error.rmse < error.band[1]
    assert error.fit_band[0] < error.fit_percent < error.fit_band[1]
    assert result.fit_percent == pytest.approx(error.fit_percent)
    np.testing.assert_allclose(result.residual["x"], e)
    np.testing.assert_allclose(result.measured["x"], y)


@pytest.mark.parametrize("colour", [0, 30])
def test_the_band_holds_the_true_size_of_the_noise(colour):
    """Of 95 % bands about 95 % have to hold the truth, for white and for slow errors."""
    data, held = record(), 0
    plain = rp.compare(oscillator(), data).simulated["x"].values
    random = np.random.default_rng(7)
    for _ in range(60):
        noise = random.standard_normal(plain.size + colour)
        noise = np.convolve(noise, np.ones(colour + 1) / np.sqrt(colour + 1), "valid")
        changed = data.assign(x=("time", plain + 0.002 * noise, {"units": "m"}))
        low, high = rp.compare(oscillator(), changed).outputs["x"].band
        held += low <= 0.002 <= high
    assert 51 <= held <= 60


def test_outputs_of_all_quantities_and_overall():
    quantities = {"x": "displacement", "v": "velocity", "f": "force"}
    model = oscillator(outputs=[rp.Output(name, PLACE, q) for name, q in quantities.items()])
    data = record()
    v = np.gradient(data["x"].values, 1 / RATE, edge_order=2)
    f = 400 * data["x"].values + v
    data = data.assign(v=("time", v, {"units": "m/s"}), f=("time", f, {"units": "N"}))
    result = rp.compare(model, data)
    assert result.outputs["v"].fit_percent > 99
    assert result.outputs["f"].fit_percent > 99.9
    assert [error.unit for error in result.outputs.values()] == ["m", "m/s", "N"]
    shares = [error.nrmse**2 for error in result.outputs.values()]
    assert result.nrmse == pytest.approx(np.sqrt(np.mean(shares)))
    assert "fit" in repr(result)


def test_no_unit_of_measurement_is_special():
    data, model = record(noise=0.02), oscillator()
    reference = rp.compare(model, data)
    tiny = rp.compare(model, data.assign({name: 1e-9 * data[name] for name in data.data_vars}))
    assert tiny.nrmse == pytest.approx(reference.nrmse, rel=1e-6)


def test_effects_take_part():
    cubic = 4e5
    data = record(cubic=cubic, start=(0.01, 0.1))
    model = oscillator().with_effect("cubic_stiffness", PLACE, {"stiffness": cubic})
    assert rp.compare(oscillator(), data).fit_percent < 90
    result = rp.compare(model, data)
    assert result.fit_percent > 99.9
    np.testing.assert_allclose(result.starts[0], [0.01, 0.1], atol=5e-4)


def test_windows_start_anew():
    data = record()
    drifting = oscillator(stiffness=350.0)
    free, short = rp.compare(drifting, data), rp.compare(drifting, data, window=0.25)
    assert short.method == "windows"
    assert short.span == 0.25
    assert len(short.starts) == 32
    assert short.nrmse < 0.6 * free.nrmse


def test_a_free_decay_needs_no_input():
    time = np.arange(1000) / RATE
    x = 1e-3 * np.exp(-0.5 * time) * np.cos(np.sqrt(400 - 0.25) * time)
    data = xr.Dataset({"x": ("time", x, {"units": "m"})}, {"time": time})
    assert rp.compare(oscillator(inputs=[]), data).fit_percent > 99.9


def test_a_test_rig_with_imposed_motion():
    rig = rp.MechanicalModel(
        [rp.Dof("x", 0.0)],
        [rp.Spring(PLACE, 50.0)],
        [rp.Damper(PLACE, 4.0)],
        [rp.Input("x", PLACE, "displacement")],
        [rp.Output("f", PLACE, "force")],
    )
    time = np.arange(1000) / RATE
    x, f = np.sin(5 * time), 50 * np.sin(5 * time) + 20 * np.cos(5 * time)
    data = xr.Dataset({"x": ("time", x), "f": ("time", f)}, {"time": time})
    assert rp.compare(rig, data).fit_percent > 99.99


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"window": 1.0, "horizon": 1.0}, "either"),
        ({"window": 100.0}, "window"),
        ({"window": -1.0}, "window"),
        ({"horizon": 1e3}, "horizon"),
    ],
)
def test_refused(options, message):
    with pytest.raises(rp.InvalidInputError, match=message):
        rp.compare(oscillator(), record(), **options)


TIME = np.arange(100) / 100
MODEL = oscillator(outputs=[rp.Output("x", PLACE), rp.Output("v", PLACE, "velocity")])


def output(name, unit, nrmse):
    """The error of a signal whose spread is 2 units, with a band of a fifth."""
    return rp.results.OutputError(
        name, unit, nrmse, 2 * nrmse, (1.6 * nrmse, 2.4 * nrmse), 0.9 * nrmse
    )


def comparison(**changes):
    measured = xr.Dataset(
        {
            "x": ("time", np.sin(9 * TIME), {"units": "m"}),
            "v": ("time", np.cos(9 * TIME), {"units": "m/s"}),
        },
        {"time": ("time", TIME, {"units": "s"})},
    )
    made = rp.results.Comparison(
        MODEL, measured.assign(F=("time", np.ones(100), {"units": "N"})), measured - 0.25,
        {"x": output("x", "m", 0.3), "v": output("v", "m/s", 0.4)}, "free run", None,
        np.zeros((1, 2)), Reproducibility(True, 1.0, None, ""), notes=("a note",),
    )  # fmt: skip
    return replace(made, **changes)


def test_the_dictionary_is_the_documented_json():
    told = comparison(method="windows", span=0.5).to_dict()
    assert told["outputs"]["v"] == {
        "nrmse": 0.4,
        "fit_percent": pytest.approx(60.0),
        "rmse": 0.8,
        "unit": "m/s",
        "rmse_band": pytest.approx([0.64, 0.96]),
    }
    assert told["overall"]["nrmse"] == pytest.approx(np.sqrt(0.125))
    assert (told["method"], told["span"], told["notes"]) == ("windows", 0.5, ["a note"])
    assert told["reproducible"] is True


def test_it_shows_how_it_was_made_and_what_to_know():
    assert "Comparison (free run), fit 64.64 %" in repr(comparison())
    shown = repr(comparison(method="windows", span=0.5))
    assert "Comparison (windows of 0.5 s)" in shown
    assert "a note" in shown


def test_it_is_drawn():
    band = xr.Dataset({name: ("time", np.full(100, 0.1)) for name in ("x", "v")}, {"time": TIME})
    made = comparison(band=band)
    assert made.plot().get_ylabel().startswith("v")  # the worse one
    assert made.plot(output="x").get_ylabel().startswith("x")
    assert len(made.plot_panels().axes) == 6
    with pytest.raises(rp.InvalidInputError, match="output"):
        made.plot(output="F")


# Refinement of integration steps.


def stiff(noise):
    """Seven samples for a swing of a spring that stiffens, in steps a hundred times finer."""
    model = oscillator(damping=0.3).with_effect("cubic_stiffness", PLACE, {"stiffness": 4e4})
    data = record(2000).isel(time=slice(None, None, 20)).drop_vars("x")
    seen = rp.simulation.simulate_model(model, data, [0.1, 0.0], substeps=128).outputs[:, 0]
    white = np.random.default_rng(0).standard_normal(seen.size)
    return model, data.assign(x=("time", seen + noise * np.std(seen) * white))


def test_a_comparison_judges_the_model_and_not_its_steps():
    model, data = stiff(1e-3)
    error = rp.compare(model, data).outputs["x"].rmse
    assert error < 1.1e-3 * float(data["x"].std())


def test_predictions_get_worse_with_the_horizon():
    data = record(samples=2000, noise=0.01)
    wrong = oscillator(stiffness=300.0)
    near, far = (rp.compare(wrong, data, horizon=h) for h in (0.0, 0.1))
    assert near.method == "prediction"
    assert near.nrmse < 0.1 < far.nrmse
    assert np.isnan(far.simulated["x"][:50]).all()
    assert np.isfinite(far.simulated["x"][51:]).all()


def test_standard_errors_make_a_band():
    data = record()
    result = rp.compare(oscillator(), data, standard_errors={"spring[0].stiffness": 4.0})
    off = rp.compare(oscillator(stiffness=404.0), data)
    difference = np.abs(off.simulated["x"] - result.simulated["x"])
    assert np.corrcoef(result.band["x"], difference)[0, 1] > 0.99


# Several records.

SOFT, HARD = record(1000, (0.02, -0.3), noise=0.05), record(1500, (-0.1, 0.0), noise=0.1, seed=1)
BOTH = {"soft": SOFT, "hard": HARD}


def same(one, other):
    assert one.rmse == pytest.approx(other.rmse, rel=1e-9)
    assert one.nrmse == pytest.approx(other.nrmse, rel=1e-9)


@pytest.mark.parametrize("options", [{}, {"window": 0.5}, {"horizon": 0.1}])
def test_each_record_is_run_as_if_it_were_alone(options):
    model = oscillator(stiffness=390.0)
    found = rp.compare(model, BOTH, **options)
    alone = {name: rp.compare(model, data, **options) for name, data in BOTH.items()}
    assert list(found.records) == ["soft", "hard"]
    for name, one in alone.items():
        same(found.records[name].outputs["x"], one.outputs["x"])
        np.testing.assert_allclose(found.records[name].starts, one.starts)
        (itself,) = one.records.values()
        same(itself.outputs["x"], one.outputs["x"])
    assert len(found.starts) == sum(len(one.starts) for one in alone.values())
    sizes = np.array([one.simulated["x"].notnull().sum() for one in alone.values()])
    squares = np.array([one.outputs["x"].rmse ** 2 for one in alone.values()])
    assert found.outputs["x"].rmse == pytest.approx(np.sqrt(sizes @ squares / sizes.sum()))


def test_a_joined_comparison_may_be_compared_again():
    found = rp.compare(oscillator(), BOTH)
    assert found.data.sizes["time"] == found.simulated.sizes["time"] == 2500
    again = rp.compare(oscillator(stiffness=390.0), found.data)
    assert list(again.records) == ["soft", "hard"]
    assert "Record by record" in repr(again)
    assert "Record by record" not in repr(rp.compare(oscillator(), SOFT))
    told = json.loads(json.dumps(again.to_dict(), allow_nan=False))
    assert set(told["records"]) == {"soft", "hard"}
    assert told["records"]["hard"]["fit_percent"] == again.records["hard"].fit_percent
    assert again.plot().get_ylabel() == "x [mm]"
    assert len(again.plot_panels().axes) == 3


def test_records_of_other_rates_come_down_to_the_slowest():
    model, time = oscillator(), np.arange(4000) / (4 * RATE)
    force = np.interp(time, SOFT["time"], SOFT["F"])
    fast = xr.Dataset({"F": ("time", force)}, {"time": time})
    fast["x"] = ("time", rp.simulation.simulate_model(model, fast).outputs[:, 0])
    found = rp.compare(model, {"soft": record(1000), "fast": fast})
    assert found.fit_percent > 99.9
    assert "fast: decimated from 2000 to 500 Hz" in found.notes[0]


def test_a_phase_is_that_at_time_0_of_each_record():
    values = {"amplitude": 3.0, "frequency": 2.3, "phase": 0.4}
    model = oscillator().with_effect("harmonic_force", ("x",), values)
    parts = []
    for begin in (0.0, 5.1):
        data = SOFT.assign_coords(time=SOFT["time"] + begin)
        parts.append(
            data.assign(x=("time", rp.simulation.simulate_model(model, data).outputs[:, 0]))
        )
    assert rp.compare(model, parts).fit_percent > 99.9
    late = [parts[0], parts[1].assign_coords(time=SOFT["time"])]
    assert rp.compare(model, late).records["record 2"].fit_percent < 95


def test_notes_say_whose_they_are():
    limit = 0.5 * float(HARD["x"].max())
    clipped = HARD.assign(x=HARD["x"].clip(-limit, limit))
    (note,) = rp.compare(oscillator(), {"soft": SOFT, "hard": clipped}).notes
    assert note.startswith("hard: x sticks at its extremes")


def test_one_run_that_judges_nothing_is_enough():
    model, data = double_well(200)
    found = rp.compare(model, {"short": data.isel(time=slice(0, 100)), "long": data})
    states = {name: e.reproducibility.reproducible for name, e in found.records.items()}
    assert states == {"short": True, "long": False}
    assert not found.reproducible
    assert any(note.startswith("long: the free run is not reproducible") for note in found.notes)


def test_repeats_are_told_with_their_noise():
    noise = 0.05 * np.std(record(1000)["x"].values)
    random = np.random.default_rng(3)
    again = [record(1000)["x"] + noise * random.standard_normal(1000) for _ in range(2)]
    pair = [record(1000).assign(x=x) for x in again]
    (note,) = rp.compare(oscillator(), pair).notes
    assert note.startswith("record 1 and record 2 repeat each other; they differ by noise of x ")
    assert float(note.split()[-2]) == pytest.approx(noise, rel=0.1)


def test_uncertain_numbers_give_a_band_over_all_records():
    errors = {"spring[0].stiffness": 4.0}
    both = rp.compare(oscillator(), BOTH, standard_errors=errors).band["x"].values
    soft = rp.compare(oscillator(), SOFT, standard_errors=errors).band["x"].values
    np.testing.assert_allclose(both[:1000], soft, atol=1e-6 * soft.max())
    assert both.size == 2500


def test_where_the_error_of_several_records_is():
    model = oscillator(stiffness=390.0)
    analysis = rp.residual_analysis(rp.compare(model, BOTH), windows=5)
    share = analysis.windows.sel(output="x").values
    assert share[:2].sum() < share[2:].sum()  # the second record is the larger
    assert analysis.places["x"].observed
    assert "x" in analysis.explain()
    short = rp.residual_analysis(rp.compare(model, [SOFT, HARD.isel(time=slice(0, 50))]))
    assert not short.places["x"].observed  # too short for an observer
    ahead = rp.compare(model, BOTH, horizon=0.1)
    with pytest.raises(rp.InvalidInputError, match="predictions of 2 records"):
        rp.residual_analysis(ahead)


# True models of drawn machines: the error is the noise.


def held(seed, most=9000):
    machine = drawn(seed, most)
    found = rp.compare(machine.model, machine.data)
    if not found.reproducible:  # runs of other steps part from each other there
        return
    error = found.residual.to_array().values.T / machine.noise
    assert np.max(np.sqrt(np.mean(counted(machine.model, error) ** 2, axis=0))) < 1.1, seed


def counted(model, error):
    """Return the errors that count: all, but for one of a thousand where accelerations jump.

    Friction jumps as it turns round, by up to a hundred noises. Whether a sample beside the jump is
    before or after it is a matter of a thousandth of a sample, less than any start is known to:
    seed 133 has one such sample in 2552, whose error alone makes 1.00 noises 1.15.
    """
    if "coulomb_friction" not in {effect.kind for effect in model.effects}:
        return error
    for i, output in enumerate(model.outputs):
        if output.quantity == "acceleration":
            worst = np.argsort(-np.abs(error[:, i]))[: len(error) // 1000]
            error[worst, i] = 0.0
    return error


@pytest.mark.parametrize("seed", range(5))
def test_the_true_model_runs_at_the_noise(seed):
    held(seed, most=2500)


@pytest.mark.long
@pytest.mark.parametrize("seed", [*range(100, 220), *range(1000, 1120)])
def test_the_true_model_runs_at_the_noise_of_longer_records(seed):
    """The second half was drawn after the search for starts had been made with the first."""
    held(seed)


def test_an_integrating_model_says_that_windows_judge_it_better():
    model = oscillator(springs=[])
    result = rp.compare(model, record())
    assert result.reproducible
    assert any("integrates" in note for note in result.notes)
    assert rp.compare(model, record(), window=0.5).notes == ()


def test_a_chaotic_run_judges_nothing_and_says_so():
    model, data = double_well(300)
    result = rp.compare(model, data)
    assert not result.reproducible
    assert any("not reproducible" in note for note in result.notes)
    assert 0 < result.reproducibility.diverged_after < 300
    short = rp.compare(model, data, window=5.0)
    assert short.reproducible
    assert short.fit_percent > 95


def test_an_unstable_model_diverges_and_says_so():
    result = rp.compare(oscillator(damping=-200.0), record())
    assert not result.reproducible
    assert "diverges" in result.notes[0]
    assert result.outputs["x"].nrmse > 1 or np.isinf(result.outputs["x"].nrmse)
