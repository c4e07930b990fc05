"""The analysis finds the error where it was put."""

import json

import numpy as np
import pytest
import xarray as xr

from robustpolish.errors import InvalidInputError
from robustpolish.identification import compare, residual_analysis
from robustpolish.models import Damper, Dof, Input, MechanicalModel, Output, Spring
from robustpolish.simulation.run import simulate

RATE, SAMPLES = 2000.0, 8000
TIME = np.arange(SAMPLES) / RATE
RANDOM = np.random.default_rng(5)


def model(**changes):
    parts = {
        "dofs": [Dof("a", 1.0), Dof("b", 0.5)],
        "springs": [Spring(("a", "ground"), 4e4), Spring(("a", "b"), 6e4)],
        "dampers": [Damper(("a", "ground"), 8.0), Damper(("a", "b"), 4.0)],
        "inputs": [Input("F", ("b", "ground"))],
        "outputs": [Output("a", ("a", "ground")), Output("b", ("b", "ground"))],
        "spin_frequency": 31.0,
    }
    return MechanicalModel(**{**parts, **changes})


def record(truth=None, **extra):
    data = xr.Dataset(
        {"F": ("time", 10 * RANDOM.standard_normal(SAMPLES), {"units": "N"})}, {"time": TIME}
    )
    outputs = simulate(truth or model(), data).outputs
    for i, name in enumerate("ab"):
        noise = 1e-3 * np.std(outputs[:, i]) * RANDOM.standard_normal(SAMPLES)
        data[name] = ("time", outputs[:, i] + noise, {"units": "m"})
    for name, values in extra.items():
        if name in data:
            data[name] = data[name] + values
        else:
            data[name] = ("time", values)
    return data


def analyse(data, **options):
    return residual_analysis(compare(model(), data), **options)


def test_rows_of_shares_add_up_to_one():
    result = analyse(record(), contact=RANDOM.random(SAMPLES) < 0.5)
    tables = [result.windows, result.bands, result.phase, result.contact]
    for place in result.places.values():
        tables += [place.displacement, place.velocity]
    for table in tables:
        np.testing.assert_allclose(table.sum(table.dims[1]), 1.0)
        assert float(result.overall(table).sum()) == pytest.approx(1.0)
    assert float(result.channels.sum()) == pytest.approx(1.0)


def test_noise_alone_is_evenly_spread():
    result = analyse(record())
    share = result.overall(result.windows)
    assert float(share.max()) < 2 / share.size
    assert all(0.003 < test.flagged_share < 0.02 for test in result.autocorrelation.values())
    for test in result.cross_correlation.values():
        assert test.flagged_share < 0.03


def test_the_channel():
    result = analyse(record(b=1e-5 * np.sin(700 * TIME)))
    assert float(result.channels.sel(output="b")) > 0.95


def test_the_time():
    burst = 1e-4 * np.sin(900 * TIME) * ((TIME > 1.0) & (TIME < 1.2))
    share = analyse(record(a=burst)).windows.sel(output="a")
    worst = int(np.argmax(share.values))
    assert float(share["begin"][worst]) == pytest.approx(1.0, abs=1e-3)
    assert float(share[worst]) > 0.9


def test_the_frequency_and_the_spin_harmonic():
    result = analyse(record(a=1e-4 * np.sin(2 * np.pi * 62 * TIME)))
    share = result.bands.sel(output="a")
    worst = int(np.argmax(share.values))
    assert float(share["low"][worst]) < 62 < float(share["high"][worst])
    harmonics = result.harmonics.sel(output="a")
    np.testing.assert_allclose(harmonics["frequency"], 31 * np.arange(1, 6))
    assert float(harmonics[1]) > 0.8
    assert float(harmonics[3]) < 0.1


def test_the_mode():
    result = analyse(
        record(model(dampers=[Damper(("a", "ground"), 8.0), Damper(("a", "b"), 30.0)]))
    )
    assert float(result.overall(result.modes).max()) > 0.3


def test_the_spin_phase():
    result = analyse(record(a=1e-4 * (np.mod(31 * TIME, 1) < 0.1)))
    share = result.phase.sel(output="a")
    assert float(share.sel(phase=slice(0, 0.1 * 2 * np.pi)).sum()) > 0.6
    mean = result.phase["mean"].sel(output="a")
    assert float(mean[0]) > float(mean[12]) + 5e-5


def test_contact_and_flight():
    touches = (np.mod(TIME, 0.5) < 0.1).astype(float)
    error = 1e-4 * touches * RANDOM.standard_normal(SAMPLES)
    result = analyse(record(a=error, contact=touches))
    assert float(result.contact.sel(output="a", state="contact")) > 0.9
    assert float(result.contact["samples"][0]) == pytest.approx(0.2, abs=0.01)
    named = analyse(record(a=error, gate=touches), contact="gate")
    assert float(named.contact.sel(output="a", state="contact")) > 0.9
    assert analyse(record()).contact is None


@pytest.mark.parametrize("place", [("a", "ground"), ("a", "b")])
def test_the_restoring_force_surface_shows_a_cubic_spring_at_its_place(place):
    truth = model().with_effect("cubic_stiffness", place, {"stiffness": 1e11})
    result = analyse(record(truth))
    shown = result.places["a" if place[1] == "ground" else "a - b"]
    assert shown.observed
    assert shown.at == place
    force = shown.surface["force"].weighted(shown.surface["samples"]).mean("velocity")
    q = shown.surface["displacement"].values
    good = shown.surface["samples"].sum("velocity").values > 0.01
    assert np.corrcoef(force.values[good], -(q[good] ** 3))[0, 1] > 0.95
    size = np.polyfit(q[good] ** 3, force.values[good], 1)[0]
    assert size == pytest.approx(-1e11, rel=0.5)


def test_errors_at_large_motion_are_seen_in_the_bins():
    truth = model().with_effect("cubic_stiffness", ("a", "ground"), {"stiffness": 1e11})
    share = analyse(record(truth)).places["a"].displacement
    outside = share.sel(output="a").values[[0, 1, -2, -1]].sum()
    assert outside > 2 * share["samples"].values[[0, 1, -2, -1]].sum()


def test_words_numbers_and_pictures():
    result = analyse(record(a=1e-4 * np.sin(2 * np.pi * 62 * TIME)))
    text = result.explain()
    assert repr(result).split() == text.replace(": ", " ").split()
    for part in ("Where the error is", "a: ", "spin harmonic at 62 Hz", "autocorrelation of b"):
        assert part in text
    numbers = json.loads(json.dumps(result.to_dict()))
    assert numbers["autocorrelation"]["a"]["flagged_share"] > 0.02
    # windows, bands, one autocorrelation, one input twice, three places with colour bars
    assert len([ax for ax in result.plot_panels().axes if ax.get_title()]) == 6


def test_predictions_begin_later():
    result = residual_analysis(compare(model(), record(), horizon=0.05))
    assert result.residual.sizes["time"] == SAMPLES - 100


def test_a_rig_without_states():
    rig = MechanicalModel(
        [Dof("x", 0.0)],
        [Spring(("x", "ground"), 50.0)],
        inputs=[Input("x", ("x", "ground"), "displacement")],
        outputs=[Output("f", ("x", "ground"), "force")],
    )
    x = np.sin(20 * TIME)
    f = 50 * x + 20 * np.sign(np.cos(20 * TIME)) + 0.1 * RANDOM.standard_normal(SAMPLES)
    data = xr.Dataset({"x": ("time", x), "f": ("time", f)}, {"time": TIME})
    surface = residual_analysis(compare(rig, data)).places["x"].surface["force"]
    right = surface.sel(displacement=0, method="nearest")
    assert float(right.isel(velocity=-1)) == pytest.approx(-20, rel=0.1)
    assert float(right.isel(velocity=0)) == pytest.approx(20, rel=0.1)


def test_refused():
    data = record()
    with pytest.raises(InvalidInputError, match="contact"):
        analyse(data, contact="gate")
    with pytest.raises(InvalidInputError, match="contact"):
        analyse(data, contact=np.zeros(3, bool))
    with pytest.raises(InvalidInputError, match="64"):
        analyse(data.isel(time=slice(0, 40)))
    wild = model(dampers=[Damper(("a", "ground"), -5e3), Damper(("b", "ground"), -5e3)])
    with pytest.raises(InvalidInputError, match="diverge"):
        residual_analysis(compare(wild, data))
