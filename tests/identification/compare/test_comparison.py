from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from robustpolish.errors import InvalidInputError
from robustpolish.identification.compare import Comparison
from robustpolish.identification.free_runs import OutputError
from robustpolish.identification.observer.runs import Reproducibility
from robustpolish.machines.mechanical.parts import Output
from tests.identification.oscillators import PLACE, oscillator

TIME = np.arange(100) / 100
MODEL = oscillator(outputs=[Output("x", PLACE), Output("v", PLACE, "velocity")])


def output(name, unit, nrmse):
    """The error of a signal whose spread is 2 units, with a band of a fifth."""
    return OutputError(name, unit, nrmse, 2 * nrmse, (1.6 * nrmse, 2.4 * nrmse), 0.9 * nrmse)


def comparison(**changes):
    measured = xr.Dataset(
        {
            "x": ("time", np.sin(9 * TIME), {"units": "m"}),
            "v": ("time", np.cos(9 * TIME), {"units": "m/s"}),
        },
        {"time": ("time", TIME, {"units": "s"})},
    )
    made = Comparison(
        model=MODEL,
        data=measured.assign(F=("time", np.ones(100), {"units": "N"})),
        simulated=measured - 0.25,
        outputs={"x": output("x", "m", 0.3), "v": output("v", "m/s", 0.4)},
        method="free run",
        span=None,
        starts=np.zeros((1, 2)),
        reproducibility=Reproducibility(True, 1.0, None, ""),
        notes=("a note",),
    )
    return replace(made, **changes)


def test_the_fit_is_that_of_the_nrmse():
    error = output("x", "m", 0.25)
    assert error.fit_percent == pytest.approx(75.0)
    assert error.fit_band == pytest.approx((70.0, 80.0))
    assert OutputError("x", "m", 0.0, 0.0, (0.0, 0.0), 0.0).fit_band == (100.0, 100.0)


def test_outputs_count_alike():
    assert comparison().nrmse == pytest.approx(np.sqrt((0.09 + 0.16) / 2))
    assert comparison().fit_percent == pytest.approx(100 * (1 - np.sqrt(0.125)))


def test_the_residual_is_measured_minus_simulated():
    residual = comparison().residual
    assert list(residual) == list(comparison().measured) == ["x", "v"]
    np.testing.assert_allclose(residual["v"], 0.25)
    assert [residual[name].attrs["units"] for name in ("x", "v", "time")] == ["m", "m/s", "s"]


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
    with pytest.raises(InvalidInputError, match="output"):
        made.plot(output="F")
