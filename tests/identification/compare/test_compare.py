"""Comparisons: the figures, the starts, windows, horizons, and what judges nothing."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

from robustpolish.errors import InvalidInputError
from robustpolish.identification import compare
from robustpolish.models import Damper, Dof, Input, MechanicalModel, Output, Spring

GROUND = ("x", "ground")
RATE = 500.0


def oscillator(stiffness=400.0, damping=1.0, **changes):
    parts = {
        "dofs": [Dof("x", 1.0)],
        "springs": [Spring(GROUND, stiffness)],
        "dampers": [Damper(GROUND, damping)],
        "inputs": [Input("F", GROUND)],
        "outputs": [Output("x", GROUND)],
    }
    return MechanicalModel(**{**parts, **changes})


def record(samples=4000, start=(0.0, 0.0), noise=0.0, cubic=0.0, seed=0, stiffness=400.0):
    """An oscillator on a smooth random force, by an integrator that is not the package's."""
    random = np.random.default_rng(seed)
    time = np.arange(samples) / RATE
    phases, lines = random.uniform(0, 2 * np.pi, 40), np.arange(1, 41) * 0.2
    amplitude = 10.0

    def force(t):
        return amplitude * np.cos(2 * np.pi * np.multiply.outer(t, lines) + phases).mean(axis=-1)

    def rhs(t, s):
        return [s[1], force(t) - s[1] - stiffness * s[0] - cubic * s[0] ** 3]

    x = solve_ivp(rhs, (0, time[-1]), start, t_eval=time, rtol=1e-9, atol=1e-12).y[0]
    x = x + noise * np.std(x) * random.standard_normal(samples)
    return xr.Dataset(
        {
            "F": ("time", force(time), {"units": "N"}),
            "x": ("time", x, {"units": "m"}),
        },
        {"time": ("time", time, {"units": "s"})},
    )


def test_the_true_model_is_perfect_from_any_start():
    for start in [(0.0, 0.0), (0.02, -0.3)]:
        result = compare(oscillator(), record(start=start))
        assert result.fit_percent > 99.95
        np.testing.assert_allclose(result.starts[0], start, atol=2e-5)
        assert result.reproducible
        assert result.notes == ()


def test_the_figures_are_those_of_their_definitions():
    data = record(noise=0.1)
    result = compare(oscillator(stiffness=380.0), data)
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


def test_the_dictionary_is_the_documented_json():
    found = compare(oscillator(), record(noise=0.01)).to_dict()["outputs"]["x"]
    assert {"nrmse", "fit_percent", "rmse", "unit"} <= set(found)
    assert found["unit"] == "m"
    assert found["nrmse"] == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("colour", [0, 30])
def test_the_band_holds_the_true_size_of_the_noise(colour):
    """Of 95 % bands about 95 % have to hold the truth, for white and for slow errors."""
    data, held = record(), 0
    plain = compare(oscillator(), data).simulated["x"].values
    random = np.random.default_rng(7)
    for _ in range(60):
        noise = random.standard_normal(plain.size + colour)
        noise = np.convolve(noise, np.ones(colour + 1) / np.sqrt(colour + 1), "valid")
        changed = data.assign(x=("time", plain + 0.002 * noise, {"units": "m"}))
        low, high = compare(oscillator(), changed).outputs["x"].band
        held += low <= 0.002 <= high
    assert 51 <= held <= 60


def test_outputs_of_all_quantities_and_overall():
    model = oscillator(
        outputs=[Output("x", GROUND), Output("v", GROUND, "velocity"), Output("f", GROUND, "force")]
    )
    data = record()
    v = np.gradient(data["x"].values, 1 / RATE, edge_order=2)
    f = 400 * data["x"].values + v
    data = data.assign(v=("time", v, {"units": "m/s"}), f=("time", f, {"units": "N"}))
    result = compare(model, data)
    assert result.outputs["v"].fit_percent > 99
    assert result.outputs["f"].fit_percent > 99.9
    assert [error.unit for error in result.outputs.values()] == ["m", "m/s", "N"]
    shares = [error.nrmse**2 for error in result.outputs.values()]
    assert result.nrmse == pytest.approx(np.sqrt(np.mean(shares)))
    assert "fit" in repr(result)


def test_no_unit_of_measurement_is_special():
    data, model = record(noise=0.02), oscillator()
    reference = compare(model, data)
    tiny = compare(model, data.assign({name: 1e-9 * data[name] for name in data.data_vars}))
    assert tiny.nrmse == pytest.approx(reference.nrmse, rel=1e-6)


def test_effects_take_part():
    cubic = 4e5
    data = record(cubic=cubic, start=(0.01, 0.1))
    model = oscillator().with_effect("cubic_stiffness", GROUND, {"stiffness": cubic})
    assert compare(oscillator(), data).fit_percent < 90
    result = compare(model, data)
    assert result.fit_percent > 99.9
    np.testing.assert_allclose(result.starts[0], [0.01, 0.1], atol=5e-4)


def test_windows_start_anew():
    data = record()
    drifting = oscillator(stiffness=350.0)
    free, short = compare(drifting, data), compare(drifting, data, window=0.25)
    assert short.method == "windows"
    assert short.span == 0.25
    assert len(short.starts) == 32
    assert short.nrmse < 0.6 * free.nrmse


def test_a_short_rest_belongs_to_the_last_window():
    result = compare(oscillator(), record(samples=1010), window=0.5)
    assert len(result.starts) == 4
    assert np.isfinite(result.simulated["x"]).all()


def test_predictions_get_worse_with_the_horizon():
    data = record(samples=2000, noise=0.01)
    wrong = oscillator(stiffness=300.0)
    near, far = (compare(wrong, data, horizon=h) for h in (0.0, 0.1))
    assert near.method == "prediction"
    assert near.nrmse < 0.1 < far.nrmse
    assert np.isnan(far.simulated["x"][:50]).all()
    assert np.isfinite(far.simulated["x"][51:]).all()


def test_a_free_decay_needs_no_input():
    time = np.arange(1000) / RATE
    x = 1e-3 * np.exp(-0.5 * time) * np.cos(np.sqrt(400 - 0.25) * time)
    data = xr.Dataset({"x": ("time", x, {"units": "m"})}, {"time": time})
    assert compare(oscillator(inputs=[]), data).fit_percent > 99.9


def test_a_test_rig_with_imposed_motion():
    rig = MechanicalModel(
        [Dof("x", 0.0)],
        [Spring(GROUND, 50.0)],
        [Damper(GROUND, 4.0)],
        [Input("x", GROUND, "displacement")],
        [Output("f", GROUND, "force")],
    )
    time = np.arange(1000) / RATE
    x, f = np.sin(5 * time), 50 * np.sin(5 * time) + 20 * np.cos(5 * time)
    data = xr.Dataset({"x": ("time", x), "f": ("time", f)}, {"time": time})
    assert compare(rig, data).fit_percent > 99.99


def test_an_integrating_model_says_that_windows_judge_it_better():
    model = oscillator(springs=[])
    result = compare(model, record())
    assert result.reproducible
    assert any("integrates" in note for note in result.notes)
    assert compare(model, record(), window=0.5).notes == ()


def test_a_chaotic_run_judges_nothing_and_says_so():
    """Holmes' double well under a strong harmonic force."""
    time = np.arange(0, 300, 0.05)
    force = 0.3 * np.cos(1.2 * time)
    model = oscillator(stiffness=-1.0, damping=0.15).with_effect(
        "cubic_stiffness", GROUND, {"stiffness": 1.0}
    )

    def rhs(t, s):
        return [s[1], 0.3 * np.cos(1.2 * t) - 0.15 * s[1] + s[0] - s[0] ** 3]

    x = solve_ivp(rhs, (0, 300), [1.0, 0.0], t_eval=time, rtol=1e-9, atol=1e-11).y[0]
    x += 0.01 * np.random.default_rng(0).standard_normal(time.size)
    data = xr.Dataset({"F": ("time", force), "x": ("time", x)}, {"time": time})
    result = compare(model, data)
    assert not result.reproducible
    assert any("not reproducible" in note for note in result.notes)
    assert 0 < result.reproducibility.diverged_after < 300
    short = compare(model, data, window=5.0)
    assert short.reproducible
    assert short.fit_percent > 95


def test_an_unstable_model_diverges_and_says_so():
    result = compare(oscillator(damping=-200.0), record())
    assert not result.reproducible
    assert result.outputs["x"].nrmse > 1 or np.isinf(result.outputs["x"].nrmse)


def test_standard_errors_make_a_band():
    data = record()
    result = compare(oscillator(), data, standard_errors={"spring[0].stiffness": 4.0})
    off = compare(oscillator(stiffness=404.0), data)
    difference = np.abs(off.simulated["x"] - result.simulated["x"])
    assert np.corrcoef(result.band["x"], difference)[0, 1] > 0.99
    with pytest.raises(InvalidInputError, match="standard_errors"):
        compare(oscillator(), data, standard_errors={"spring[7].stiffness": 4.0})


def test_files_and_frames_are_read(tmp_path):
    data = record()
    frame = pd.DataFrame(
        {"time [s]": data["time"], "F [N]": data["F"], "x [mm]": 1e3 * data["x"].values}
    )
    frame.to_csv(tmp_path / "data.csv", index=False)
    for source in (frame, tmp_path / "data.csv"):
        assert compare(oscillator(), source).fit_percent > 99.9


def test_it_is_drawn():
    result = compare(oscillator(), record(), standard_errors={"spring[0].stiffness": 4.0})
    assert len(result.plot_panels().axes) == 3


def changed(**columns):
    return record().assign(columns)


BAD = {
    "no column": (lambda: (oscillator(), record()[["F"]]), {}, "no column 'x'"),
    "unit": (lambda: (oscillator(), changed(x=record()["F"])), {}, "a column in N"),
    "nan": (
        lambda: (oscillator(), changed(x=record()["x"].where(record()["time"] < 2))),
        {},
        "nan",
    ),
    "no time": (lambda: (oscillator(), record().drop_vars("time")), {}, "time"),
    "jitter": (
        lambda: (oscillator(), record().assign_coords(time=np.sort(np.random.rand(4000)))),  # noqa: NPY002
        {},
        "uniform",
    ),
    "short": (lambda: (oscillator(), record().isel(time=slice(0, 2))), {}, "samples"),
    "slow": (lambda: (oscillator(stiffness=4e6), record()), {}, "sampling rate"),
    "both": (lambda: (oscillator(), record()), {"window": 1.0, "horizon": 1.0}, "either"),
    "window": (lambda: (oscillator(), record()), {"window": 100.0}, "window"),
    "negative window": (lambda: (oscillator(), record()), {"window": -1.0}, "window"),
    "horizon": (lambda: (oscillator(), record()), {"horizon": 1e3}, "horizon"),
    "no model": (lambda: ("model.toml", record()), {}, "MechanicalModel"),
    "no data": (lambda: (oscillator(), 3), {}, "measurement"),
}


@pytest.mark.parametrize("case", BAD)
def test_refused(case):
    make, options, message = BAD[case]
    model, data = make()
    with pytest.raises(InvalidInputError, match=message):
        compare(model, data, **options)
