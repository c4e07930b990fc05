"""A machine with a cubic spring and dry friction under blows that differ.

The large blow is cut before it dies out: friction is hardly seen beside the damper. The small one
moves so little that the spring is straight.
"""

import re

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from tests.identification.oscillators import PLACE, oscillator

TRUE = {"stiffness": 8e3, "force": 0.05}
NOISE = 1e-4
RATE = 200.0


def blow(size, samples, seed):
    """By an integrator that is not the package's, with coloured noise."""
    time = np.arange(samples) / RATE
    force = size * np.exp(-(((time - 0.2) / 0.01) ** 2))

    def rhs(t, s):
        held = 400 * s[0] + TRUE["stiffness"] * s[0] ** 3 + TRUE["force"] * np.tanh(s[1] / 1e-3)
        return [s[1], np.interp(t, time, force) - 0.8 * s[1] - held]

    x = solve_ivp(rhs, (0, time[-1]), (0, 0), t_eval=time, rtol=1e-8, atol=1e-11, max_step=2e-3)
    white = np.random.default_rng(seed).standard_normal(samples + 200)
    noise = 0.6 * NOISE * lfilter([1.0], [1.0, -0.8], white)[200:]
    return xr.Dataset({"F": ("time", force), "x": ("time", x.y[0] + noise)}, {"time": time})


@pytest.fixture(scope="module")
def blows():
    return {"small": blow(10, 1500, 1), "large": blow(120, 300, 2), "again": blow(120, 300, 3)}


def machine():
    return oscillator(damping=0.8)


def test_together_they_determine_what_each_leaves_open(blows):
    model = machine().with_effect("cubic_stiffness", PLACE)
    model = model.with_effect("coulomb_friction", PLACE)
    small, large = (rp.refit(model, blows[name]) for name in ("small", "large"))
    both = rp.refit(model, [blows["small"], blows["large"]])
    spring, friction = "effect[0].stiffness", "effect[1].force"
    assert spring in small.undetermined
    assert both.undetermined == ()
    for key, value in {spring: TRUE["stiffness"], friction: TRUE["force"]}.items():
        assert both.model.parameters[key] == pytest.approx(value, rel=0.03)
        assert both.stderr[key] < 0.02 * value
    assert large.stderr[friction] > 10 * both.stderr[friction]


def test_a_refit_tells_the_error_of_each_as_a_comparison_does(blows):
    given = {name: blows[name] for name in ("small", "large")}
    fitted = rp.refit(machine(), given)
    held = rp.compare(fitted.model, given).records
    assert list(fitted.records) == ["small", "large"]
    for name, errors in fitted.records.items():
        assert errors.outputs["x"].rmse == pytest.approx(held[name].outputs["x"].rmse, rel=1e-9)
        assert fitted.to_dict()["records"][name]["fit_percent"] == errors.fit_percent
    shown = repr(fitted)
    assert "Record by record" in shown
    assert any(line.split()[:2] == ["large", "x"] for line in shown.splitlines())
    alone = rp.refit(machine(), blows["small"])
    assert list(alone.records) == ["record 1"]
    assert "Record by record" not in repr(alone)


@pytest.mark.long
def test_they_name_both_effects_and_the_noise(blows, tmp_path):
    diagnosis = rp.diagnose(machine(), blows)
    assert diagnosis.verdict == "missing_effect"
    found = {effect.kind: effect.parameters for effect in diagnosis.effects}
    assert set(found) == {"cubic_stiffness", "coulomb_friction"}
    assert found["cubic_stiffness"]["stiffness"].value == pytest.approx(8e3, rel=0.03)
    assert found["coulomb_friction"]["force"].value == pytest.approx(0.05, rel=0.03)
    size = np.std(np.concatenate([data["x"].values for data in blows.values()]))
    assert NOISE / 1.5 < diagnosis.noise_floor["x"] * size < 1.5 * NOISE
    reasons = " ".join(diagnosis.reasons)
    assert "large and again repeat each other" in reasons
    assert re.search(r"Held out to judge: (large|again), blocks of small\.", reasons)
    assert diagnosis.time.size == diagnosis.missing_force.shape[1] == 2100
    assert diagnosis.plot_missing_force().get_xlabel().startswith("time")
    diagnosis.save(tmp_path / "blows.json")
    again = rp.load(tmp_path / "blows.json")
    assert again.reasons == diagnosis.reasons
    np.testing.assert_array_equal(again.time, diagnosis.time)


@pytest.mark.parametrize("call", [rp.diagnose, rp.refit])
def test_refused(call, blows):
    small = blows["small"]
    for given, said in [
        ([], "no record at all"),
        ({"a": small, "b": small[["F"]]}, "'x' in 'a', but not in 'b'"),
        ([small, small.isel(time=slice(0, 0))], "record 2: data: got 0 samples"),
        ([small, small.isel(time=slice(0, 50))], "50 samples in 'record 2', expected at least 60"),
    ]:
        with pytest.raises(InvalidInputError, match=said):
            call(machine(), given)
