"""Residual analyses: shares of the error, tests of whiteness, places, noise floors."""

import json

import numpy as np
import pytest
import xarray as xr
from scipy import signal
from scipy.signal import lfilter

import robustpolish as rp
from robustpolish.identification.residual_tests import noise_floor, place_shares
from tests.identification.oscillators import PLACE, oscillator
from tests.identification.oscillators import record as short_record

# A chain of two masses driven at the outer one, and records with added errors.

RATE, SAMPLES = 2000.0, 8000
TIME = np.arange(SAMPLES) / RATE
RANDOM = np.random.default_rng(5)


def model(**changes):
    parts = {
        "dofs": [rp.Dof("a", 1.0), rp.Dof("b", 0.5)],
        "springs": [rp.Spring(("a", "ground"), 4e4), rp.Spring(("a", "b"), 6e4)],
        "dampers": [rp.Damper(("a", "ground"), 8.0), rp.Damper(("a", "b"), 4.0)],
        "inputs": [rp.Input("F", ("b", "ground"))],
        "outputs": [rp.Output("a", ("a", "ground")), rp.Output("b", ("b", "ground"))],
        "spin_frequency": 31.0,
    }
    return rp.MechanicalModel(**{**parts, **changes})


def record(truth=None, **extra):
    data = xr.Dataset(
        {"F": ("time", 10 * RANDOM.standard_normal(SAMPLES), {"units": "N"})}, {"time": TIME}
    )
    outputs = rp.simulation.simulate_model(truth or model(), data).outputs
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
    return rp.residual_analysis(rp.compare(model(), data), **options)


# Shares of an error whose place is known.


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
        record(model(dampers=[rp.Damper(("a", "ground"), 8.0), rp.Damper(("a", "b"), 30.0)]))
    )
    assert float(result.overall(result.modes).max()) > 0.3


def test_a_mode_of_two_equal_axes_is_named_once():
    """Two uncoupled oscillators of 10 Hz, whose measured damping is less than the model's."""

    def twins(damping):
        at = [(name, "ground") for name in "ab"]
        return rp.MechanicalModel(
            [rp.Dof(name, 1.0) for name in "ab"],
            [rp.Spring(place, (20 * np.pi) ** 2) for place in at],
            [rp.Damper(place, damping) for place in at],
            [rp.Input("F", at[0]), rp.Input("G", at[1])],
            [rp.Output(name, place) for name, place in zip("ab", at, strict=True)],
        )

    force = RANDOM.standard_normal((2, SAMPLES))
    data = xr.Dataset({n: ("time", f) for n, f in zip("FG", force, strict=True)}, {"time": TIME})
    outputs = rp.simulation.simulate_model(twins(2.0), data).outputs
    data = data.assign({n: ("time", outputs[:, i]) for i, n in enumerate("ab")})
    result = rp.residual_analysis(rp.compare(twins(4.0), data))
    lines = [line for line in result.explain().splitlines() if "the mode at 9.995 Hz" in line]
    assert [line.split()[0] for line in lines] == ["frequency:", "near"]
    assert lines[0].count("the mode at") == 1


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


def test_predictions_begin_later():
    result = rp.residual_analysis(rp.compare(model(), record(), horizon=0.05))
    assert result.residual.sizes["time"] == SAMPLES - 100


def test_refused():
    data = record()
    with pytest.raises(rp.InvalidInputError, match="contact"):
        analyse(data, contact="gate")
    with pytest.raises(rp.InvalidInputError, match="contact"):
        analyse(data, contact=np.zeros(3, bool))
    with pytest.raises(rp.InvalidInputError, match="64"):
        analyse(data.isel(time=slice(0, 40)))
    wild = model(dampers=[rp.Damper(("a", "ground"), -5e3), rp.Damper(("b", "ground"), -5e3)])
    with pytest.raises(rp.InvalidInputError, match="diverge"):
        rp.residual_analysis(rp.compare(wild, data))


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


def test_the_place_whose_motion_foretells_the_force_is_drawn():
    truth = model().with_effect("cubic_stiffness", ("a", "b"), {"stiffness": 1e11})
    result = analyse(record(truth))
    assert result.places["a - b"].follows > 0.3
    assert result.plot_surface().get_title() == "missing force at a - b"
    assert result.plot_surface(place="a").get_title() == "missing force at a"


def test_a_rig_without_states():
    rig = rp.MechanicalModel(
        [rp.Dof("x", 0.0)],
        [rp.Spring(("x", "ground"), 50.0)],
        inputs=[rp.Input("x", ("x", "ground"), "displacement")],
        outputs=[rp.Output("f", ("x", "ground"), "force")],
    )
    x = np.sin(20 * TIME)
    f = 50 * x + 20 * np.sign(np.cos(20 * TIME)) + 0.1 * RANDOM.standard_normal(SAMPLES)
    data = xr.Dataset({"x": ("time", x), "f": ("time", f)}, {"time": TIME})
    surface = rp.residual_analysis(rp.compare(rig, data)).places["x"].surface["force"]
    right = surface.sel(displacement=0, method="nearest")
    assert float(right.isel(velocity=-1)) == pytest.approx(-20, rel=0.1)
    assert float(right.isel(velocity=0)) == pytest.approx(20, rel=0.1)


def test_a_place_is_a_coordinate_or_what_something_joins():
    result = analyse(record())
    assert list(result.places) == ["a", "b", "a - b"]
    between = result.places["a - b"]
    assert between.at == ("a", "b")
    for place in result.places.values():
        assert place.displacement.sizes["displacement"] == 12
        assert place.surface["force"].attrs["units"] == "N"
        assert place.surface["velocity"].attrs["units"] == "m/s"


def test_turning_coordinates_have_moments():
    arm = oscillator(dofs=[rp.Dof("x", 1.0, rotational=True)])
    data = short_record(noise=0.01)
    data = data.assign(F=data["F"].assign_attrs(units="N m"), x=data["x"].assign_attrs(units="rad"))
    comparison = rp.compare(arm, data)
    surface = place_shares(comparison, comparison.residual, 5)["x"].surface
    assert surface["force"].attrs["units"] == "N m"
    assert surface["displacement"].attrs["units"] == "rad"
    assert surface["force"].shape == (5, 5)


def test_a_short_record_shows_the_simulated_motion_and_no_force():
    data = short_record().isel(time=slice(0, 59))
    comparison = rp.compare(oscillator(), data)
    place = place_shares(comparison, comparison.residual, 4)["x"]
    assert place.at == PLACE
    assert not place.observed
    assert np.isnan(place.surface["force"]).all()
    x = data["x"].values
    edges = np.linspace(x.min(), x.max(), 5)
    found = place.displacement["displacement"].values
    np.testing.assert_allclose(found, (edges[:-1] + edges[1:]) / 2, rtol=1e-3)


def test_a_channel_is_no_place():
    data = record(model().with_effect("cubic_stiffness", ("a", "ground"), {"stiffness": 1e11}))
    data = data.assign(u=("time", np.cos(TIME), {"units": "V"}))
    found = rp.residual_analysis(rp.compare(model().with_channel("u", "V"), data))
    assert "u" not in found.places
    assert "a" in found.places


# False alarm rate and power of the correlation and coherence tests.

NOISE = np.random.default_rng(11)


def coloured(samples, frequency=20.0, damping=0.05):
    w = 2 * np.pi * frequency
    b, a = signal.bilinear([w**2], [1, 2 * damping * w, w**2], 1000)
    return signal.lfilter(b, a, NOISE.standard_normal(samples))


@pytest.mark.parametrize("samples", [500, 4000, 30000])
@pytest.mark.parametrize("lags", [25, None])
def test_white_noise_is_flagged_at_one_per_cent_of_the_lags(samples, lags):
    runs = 400 if lags else 60
    shares = [
        rp.identification.autocorrelation(NOISE.standard_normal(samples), lags=lags).flagged_share
        for _ in range(runs)
    ]
    assert 0.005 < np.mean(shares) < 0.015


def test_the_coefficients_are_those_of_the_definition():
    e = NOISE.standard_normal(300)
    found = rp.identification.autocorrelation(e, step=0.1, lags=3)
    c = e - e.mean()
    for k in (1, 2, 3):
        # The small constant is the mean that taking out the sample mean brings.
        expected = (c[k:] @ c[:-k]) / (c @ c) + (300 - k) / (300 * 299)
        assert float(found.value[k - 1]) == pytest.approx(expected)
    np.testing.assert_allclose(found.value["lag"], [0.1, 0.2, 0.3])


def test_cross_correlation_finds_a_delay_and_its_sign():
    u = NOISE.standard_normal(5000)
    e = 0.3 * np.roll(u, 7) + NOISE.standard_normal(5000)
    found = rp.identification.cross_correlation(u, e, step=0.01)
    assert float(found.value["lag"][int(np.argmax(found.value.values))]) == pytest.approx(0.07)
    assert bool(found.flagged.sel(lag=0.07, method="nearest"))


@pytest.mark.parametrize(
    ("source", "residual"), [("white", "white"), ("coloured", "white"), ("coloured", "coloured")]
)
def test_independent_signals_stay_in_the_band_whatever_their_colour(source, residual):
    make = {"white": NOISE.standard_normal, "coloured": coloured}
    shares = [
        rp.identification.cross_correlation(make[source](8000), make[residual](8000)).flagged_share
        for _ in range(60)
    ]
    assert 0.004 < np.mean(shares) < 0.015


def test_coherence_by_chance_and_by_cause():
    shares = [
        rp.identification.coherence(coloured(8000), coloured(8000)).flagged_share for _ in range(60)
    ]
    assert 0.004 < np.mean(shares) < 0.016
    u = NOISE.standard_normal(8000)
    caused = rp.identification.coherence(
        u, np.convolve(u, [1, 0.5, 0.2], "same") + NOISE.standard_normal(8000)
    )
    assert caused.flagged_share > 0.5


MOTION = short_record(4000)["x"].values
NONE = np.zeros(1)


def noise(pole, decibel, seed=0):
    """Noise of first order so many decibels below the motion of an oscillator."""
    white = np.random.default_rng(seed).standard_normal(MOTION.size + 300)
    coloured = lfilter([1.0], [1.0, -pole], white)[300:]
    return coloured * np.std(MOTION) * 10 ** (-decibel / 20) * np.sqrt(1 - pole**2)


@pytest.mark.parametrize("pole", [0.0, 0.6, 0.9])
@pytest.mark.parametrize("decibel", [20, 30, 40])
def test_noise_of_first_order_is_told_apart_from_what_a_model_does_wrong(pole, decibel):
    """A stiffness that is wrong by a part adds a share of the motion to the errors."""
    e = noise(pole, decibel)
    true = np.std(MOTION) * 10 ** (-decibel / 20)
    for wrong in (0.0, 0.3):
        (found,) = noise_floor((e + wrong * MOTION)[:, None], MOTION[:, None], NONE)
        assert true / 1.5 < found < 1.5 * true
