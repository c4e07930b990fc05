import lmfit
import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.identification.refit import lmfit_name, refit
from robustpolish.machines.mechanical.parts import Damper, Dof, Output, Spring
from robustpolish.machines.simulation.run import simulate_model
from tests.hidden_effects.cases import Case, model_of, one, records
from tests.identification.oscillators import PLACE, of_rig, oscillator, record, rig

CUBIC = Case("cubic", one(), [("cubic_stiffness", PLACE, [4e6])], drive=8.0, samples=4000, seed=1)


def test_refit_finds_values_of_an_effect_without_any():
    (data, _), _ = records(CUBIC)
    fitted = refit(model_of(CUBIC).with_effect("cubic_stiffness", PLACE), data)
    value = fitted.model.parameters["effect[0].stiffness"]
    assert value == pytest.approx(4e6, rel=0.03)
    assert abs(value - 4e6) < 5 * fitted.stderr["effect[0].stiffness"]
    assert fitted.parameters["effect_0__stiffness"].stderr == fitted.stderr["effect[0].stiffness"]


@pytest.mark.parametrize("stiffness", [15.0, 22.0, 25.0, 40.0])
def test_a_free_decay_gives_its_frequency(stiffness):
    model = rp.MechanicalModel(
        [Dof("x", 1.0)],
        [Spring(("x", "ground"), stiffness)],
        [Damper(("x", "ground"), 0.4)],
        outputs=[Output("x", ("x", "ground"))],
    )
    time = np.arange(2000) * 0.01
    decay = np.exp(-0.2 * time) * np.cos(np.sqrt(25 - 0.04) * time)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(time.size)
    data = xr.Dataset({"x": ("time", decay + noise)}, coords={"time": time})
    fitted = rp.refit(model, data)
    found = fitted.model.parameters
    assert found["dof.x.mass"] == 1.0  # a decay shows ratios only
    assert found["spring[0].stiffness"] == pytest.approx(25, rel=1e-3)
    assert found["damper[0].damping"] == pytest.approx(0.4, rel=0.01)
    assert fitted.nrmse["x"] * np.std(decay + noise) == pytest.approx(1e-3, rel=0.05)


def test_values_and_errors_are_those_of_a_regression():
    data = of_rig(3000, noise=2.0)
    X = np.column_stack([data["x"], data["v"]])
    expected = np.linalg.lstsq(X, data["f"].values, rcond=None)[0]
    errors = 2.0 * np.sqrt(np.diag(np.linalg.inv(X.T @ X)))
    fitted = refit(rig(50.0, 4.0), data)
    for key, value, error in zip(fitted.units, expected, errors, strict=True):
        assert fitted.model.parameters[key] == pytest.approx(value, rel=1e-3)
        assert fitted.stderr[key] == pytest.approx(error, rel=0.15)
    assert fitted.units == {"spring[0].stiffness": "N/m", "damper[0].damping": "N s/m"}
    assert fitted.undetermined == ()
    np.testing.assert_allclose(np.sqrt(np.diag(fitted.covariance)), list(fitted.stderr.values()))


def test_what_the_data_leave_open_is_told():
    """The force of a damper of 0.01 N s/m is lost in the noise."""
    fitted = refit(rig(50.0, 0.01), of_rig(3000, noise=20.0, damping=0.0))
    assert fitted.undetermined == ("damper[0].damping",)


@pytest.mark.parametrize(
    ("key", "name"),
    [("dof.x.mass", "dof_x_mass"), ("spring[0].stiffness", "spring_0__stiffness")],
)
def test_names_suit_lmfit(key, name):
    assert lmfit_name(key) == name
    assert name in lmfit.create_params(**{name: 1.0})


def test_a_record_that_is_too_short_is_refused():
    with pytest.raises(InvalidInputError, match="at least 60"):
        refit(oscillator(), record().isel(time=slice(0, 59)))


def test_loops_that_stiffen_are_recovered():
    """Bouc-Wen with beta + gamma < 0: nothing yields, and the simulation stays finite."""
    true = {"force": 1.0, "stiffness": 150.0, "exponent": 1.0, "beta": 0.3, "gamma": -0.9}
    model = oscillator().with_effect("bouc_wen_hysteresis", PLACE, true)
    data = record(3000)
    outputs = simulate_model(model, data).outputs[:, 0]
    assert np.isfinite(outputs).all()
    noise = 1e-3 * np.std(outputs) * np.random.default_rng(0).standard_normal(3000)
    data = data.assign(x=("time", outputs + noise))
    first = {**true, "stiffness": 130.0, "beta": 0.4, "gamma": -0.8}
    fitted = refit(oscillator().with_effect("bouc_wen_hysteresis", PLACE, first), data)
    found = fitted.model.effects[0].values
    assert fitted.nrmse["x"] == pytest.approx(1e-3, rel=0.1)
    assert found["force"] == 1.0
    assert found["beta"] + found["gamma"] < 0
    for name in ("stiffness", "beta", "gamma"):
        error = fitted.stderr[f"effect[0].{name}"]
        assert abs(found[name] - true[name]) < 4 * error + 0.02 * abs(true[name])
        assert error < 0.3 * abs(true[name])
