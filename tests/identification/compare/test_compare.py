"""Comparisons: the figures, the starts, windows."""

import numpy as np
import pytest
import xarray as xr

from robustpolish.errors import InvalidInputError
from robustpolish.identification.compare import compare
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from tests.identification.oscillators import PLACE, RATE, oscillator, record


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
        outputs=[Output("x", PLACE), Output("v", PLACE, "velocity"), Output("f", PLACE, "force")]
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
    model = oscillator().with_effect("cubic_stiffness", PLACE, {"stiffness": cubic})
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


def test_a_free_decay_needs_no_input():
    time = np.arange(1000) / RATE
    x = 1e-3 * np.exp(-0.5 * time) * np.cos(np.sqrt(400 - 0.25) * time)
    data = xr.Dataset({"x": ("time", x, {"units": "m"})}, {"time": time})
    assert compare(oscillator(inputs=[]), data).fit_percent > 99.9


def test_a_test_rig_with_imposed_motion():
    rig = MechanicalModel(
        [Dof("x", 0.0)],
        [Spring(PLACE, 50.0)],
        [Damper(PLACE, 4.0)],
        [Input("x", PLACE, "displacement")],
        [Output("f", PLACE, "force")],
    )
    time = np.arange(1000) / RATE
    x, f = np.sin(5 * time), 50 * np.sin(5 * time) + 20 * np.cos(5 * time)
    data = xr.Dataset({"x": ("time", x), "f": ("time", f)}, {"time": time})
    assert compare(rig, data).fit_percent > 99.99


BAD = {
    "both": ({"window": 1.0, "horizon": 1.0}, "either"),
    "window": ({"window": 100.0}, "window"),
    "negative window": ({"window": -1.0}, "window"),
    "horizon": ({"horizon": 1e3}, "horizon"),
}


@pytest.mark.parametrize("case", BAD)
def test_refused(case):
    options, message = BAD[case]
    with pytest.raises(InvalidInputError, match=message):
        compare(oscillator(), record(), **options)
