"""Frequency responses: comparison, fit, resonances, dependence on the amplitude."""

import json

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.identification.frequency.lines import (
    likeness,
    measured_resonances,
    measured_response,
    model_resonances,
)
from robustpolish.linear.response import linear_response

# Chains of masses, and their frequency responses with noise.

LINES = np.arange(5.0, 120.0, 0.25)


def two_masses(quantity="displacement", stiffness=(2e5, 1e5), damping=4.0, masses=(2.0, 1.0)):
    """Two masses on ground, driven at the first, both measured."""
    pairs = [("a", "ground"), ("a", "b")]
    return rp.MechanicalModel(
        [rp.Dof("a", masses[0]), rp.Dof("b", masses[1])],
        [rp.Spring(pair, k) for pair, k in zip(pairs, stiffness, strict=True)],
        [rp.Damper(pair, damping) for pair in pairs],
        [rp.Input("F", pairs[0])],
        [rp.Output(name, (name, "ground"), quantity) for name in ("a", "b")],
    )


def measured(model, noise=0.02, seed=0, lines=LINES, told=False):
    """Return the model's response with noise, a share of each pair's mean size.

    Returns
    -------
    xarray.DataArray
        With the variance beside it if it is `told`.
    """
    true = model.frequency_response(lines)
    level = noise * np.abs(true.values).mean(axis=0)
    rng = np.random.default_rng(seed)
    both = rng.standard_normal((2, *true.shape)) / np.sqrt(2)
    beside = {"variance": np.broadcast_to(level**2, true.shape)} if told else {}
    return rp.signals.labelled_response(
        lines,
        true.values + level * (both[0] + 1j * both[1]),
        model.output_names,
        model.input_names,
        true["units"].values,
        beside=beside,
    )


# Comparisons.


def test_the_true_model_is_at_the_noise():
    model = two_masses()
    comparison = rp.compare(model, measured(model, told=True))
    for error in comparison.pairs.values():
        assert error.over_noise == pytest.approx(1.0, abs=0.1)
        assert error.relative == pytest.approx(error.noise, rel=0.15)
        assert error.likeness > 0.999


def test_a_wrong_spring_shows_in_error_and_modes():
    comparison = rp.compare(two_masses(stiffness=(2.6e5, 1e5)), measured(two_masses()))
    assert comparison.relative > 0.5
    first, second = comparison.modes
    assert first.model_frequency > 1.05 * first.frequency
    assert second.likeness > 0.9
    assert " 35.588" in repr(comparison)
    assert "<table>" in comparison._repr_html_()


def test_a_mode_that_the_model_lacks_is_listed():
    one = rp.MechanicalModel(
        [rp.Dof("a", 3.0)], [rp.Spring(("a", "ground"), 2e5)], [rp.Damper(("a", "ground"), 4.0)],
        [rp.Input("F", ("a", "ground"))], [rp.Output("a", ("a", "ground"))],
    )  # fmt: skip
    modes = rp.compare(one, measured(two_masses())).modes
    assert [mode.model_frequency is None for mode in modes] == [False, True]


def test_effects_count_with_their_linear_part():
    place = ("a", "b")
    loaded = two_masses(stiffness=(2e5, 8e4)).with_effect(
        "attached_resonator", "b", {"mass": 0.1, "stiffness": 1e4, "damping": 1.0}
    )
    friction = two_masses().with_effect("coulomb_friction", place, {"force": 1.0})
    assert rp.compare(loaded, measured(loaded)).relative < 0.1
    comparison = rp.compare(friction, measured(two_masses()))
    assert any("jumps at rest" in note for note in comparison.notes)


def test_files_and_estimates_are_recognised(tmp_path):
    model = two_masses()
    data = measured(model)
    table = {"frequency [Hz]": LINES}
    for name in ("a", "b"):
        curve = data.sel(output=name, input="F").values
        table |= {f"{name}/F real [m/N]": curve.real, f"{name}/F imag [m/N]": curve.imag}
    path = tmp_path / "frf.csv"
    np.savetxt(path, np.column_stack(list(table.values())), delimiter=",",
               header=",".join(table), comments="")  # fmt: skip
    by_file, by_array = rp.compare(model, path), rp.compare(model, data)
    assert by_file.relative == pytest.approx(by_array.relative, rel=1e-6)
    with pytest.raises(rp.InvalidInputError, match="a record over time"):
        rp.compare(model, path, window=1.0)


def test_pictures_and_figures():
    comparison = rp.compare(two_masses(stiffness=(2.6e5, 1e5)), measured(two_masses(), told=True))
    assert comparison.plot(output="b").get_ylabel() == "magnitude of b/F"
    assert comparison.plot(kind="nyquist", output="a").get_ylabel().startswith("imaginary part")
    assert len(comparison.plot_panels().axes) == 4
    _, ax = plt.subplots()
    assert comparison.plot(ax) is ax
    with pytest.raises(rp.InvalidInputError, match="one of 'a', 'b'"):
        comparison.plot(output="c")
    assert json.loads(json.dumps(comparison.to_dict()))["overall"]["relative"] > 0.5
    assert comparison.residual.dims == ("frequency", "output", "input")
    plt.close("all")


# Fits.

STARTS = [(0.7, 0.7), (1.3, 0.7), (1.3, 1.3)]


def started(model, shares, damping=0.3):
    values = model.parameters
    changes = {f"spring[{i}].stiffness": values[f"spring[{i}].stiffness"] * share
               for i, share in enumerate(shares)}  # fmt: skip
    changes |= {key: damping * value for key, value in values.items() if "damping" in key}
    return model.with_parameters(changes)


@pytest.mark.parametrize(
    ("quantity", "shares"),
    [
        ("acceleration", (0.7, 1.3)),
        *(
            (quantity, shares)
            for quantity in ("displacement", "acceleration") for shares in STARTS
        ),
    ],
)  # fmt: skip
def test_springs_that_are_30_percent_off_come_out(quantity, shares):
    model = two_masses(quantity)
    fitted = rp.refit(started(model, shares), measured(model))
    for key, error in fitted.stderr.items():
        assert abs(fitted.model.parameters[key] - model.parameters[key]) < 4 * error
        assert error < 0.01 * model.parameters[key]
    assert fitted.undetermined == ()


@pytest.mark.long
def test_intervals_cover_the_truth():
    model = two_masses()
    inside = []
    for seed in range(12):
        fitted = rp.refit(model, measured(model, 0.05, seed, told=bool(seed % 2)))
        for key, error in fitted.stderr.items():
            inside.append(abs(fitted.model.parameters[key] - model.parameters[key]) < 1.96 * error)
    assert 0.85 <= np.mean(inside) <= 1.0


@pytest.mark.long
def test_a_fit_never_ends_above_its_start():
    lacking = two_masses().with_effect(
        "attached_resonator", "b", {"mass": 0.2, "stiffness": 3e4, "damping": 1.0}
    )
    data = measured(lacking)
    rng = np.random.default_rng(1)
    for _ in range(4):
        values = two_masses().parameters
        shares = np.exp(0.3 * rng.standard_normal(len(values)))
        keys = [key for key in values if "gain" not in key]
        start = two_masses().with_parameters({
            key: values[key] * share for key, share in zip(keys, shares, strict=False)
        })  # fmt: skip
        fitted = rp.refit(start, data)
        before, after = (rp.compare(m, data).relative for m in (start, fitted.model))
        assert after <= before
        again = rp.compare(rp.refit(fitted.model, data).model, data).relative
        assert again <= after


def test_linear_effects_are_fitted_and_others_left_open():
    true = (
        two_masses()
        .with_effect("input_delay", "F", {"delay": 1e-3})
        .with_effect("cubic_stiffness", ("a", "ground"), {"stiffness": 1e9})
    )
    start = true.with_parameters({"effect[0].delay": 2e-4, "spring[0].stiffness": 1.6e5})
    fitted = rp.refit(start, measured(true))
    assert fitted.model.parameters["effect[0].delay"] == pytest.approx(1e-3, rel=0.01)
    assert fitted.undetermined == ("effect[1].stiffness",)
    assert fitted.model.parameters["effect[1].stiffness"] == 1e9


def test_a_record_over_time_is_fitted_by_its_response():
    model = two_masses(damping=40.0)
    time = np.arange(60000) * 1e-3
    rng = np.random.default_rng(0)
    force = rng.standard_normal(time.size)
    motion = linear_response(model.state_space(), time, force[:, None]).outputs
    motion = motion + 0.02 * motion.std(axis=0) * rng.standard_normal(motion.shape)
    data = xr.Dataset(
        {"F": ("time", force, {"units": "N"}), "a": ("time", motion[:, 0], {"units": "m"}),
         "b": ("time", motion[:, 1], {"units": "m"})}, {"time": time},
    )  # fmt: skip
    response = rp.estimate_frequency_response(data, "F", ["a", "b"], segment=4.0)
    fitted = rp.refit(started(model, (0.7, 1.3)), response.sel(frequency=slice(5, 120)))
    for key in fitted.stderr:
        if "damping" not in key:
            assert fitted.model.parameters[key] == pytest.approx(model.parameters[key], rel=0.02)


@pytest.mark.long
def test_one_pair_and_missing_lines_are_enough():
    model = two_masses()
    data = measured(model).sel(output=["b"])
    data = data.where((data["frequency"] < 60) | (data["frequency"] > 65))
    fitted = rp.refit(started(model, (1.3, 1.3)), data)
    assert fitted.model.parameters["spring[0].stiffness"] == pytest.approx(2e5, rel=0.1)
    assert list(fitted.nrmse) == ["b/F"]
    assert LINES.size == data.sizes["frequency"]


# Dependence on the amplitude, of machines whose effects are known.

PLACE = ("x", "ground")
SINES = np.linspace(2.2, 4.2, 41)  # of an oscillator of 20 rad/s
PERIODS, SAMPLES = 60, 40  # per line, the second half is used; and per period


def oscillator(kind=None, values=None, at=PLACE):
    model = rp.MechanicalModel(
        [rp.Dof("x", 1.0)], [rp.Spring(PLACE, 400.0)], [rp.Damper(PLACE, 1.2)],
        [rp.Input("F", PLACE)], [rp.Output("x", PLACE)],
    )  # fmt: skip
    return model.with_effect(kind, at, values) if kind else model


def stepped_sine(model, amplitude, noise=2e-3, seed=0):
    """Return the response to a sine of constant force at one line after the other."""
    rng = np.random.default_rng(seed)
    values, state, internal = [], None, None
    for line in SINES:
        time = np.arange(PERIODS * SAMPLES) / (SAMPLES * line)
        force = amplitude * np.sin(2 * np.pi * line * time)
        data = xr.Dataset({"F": ("time", force)}, {"time": time})
        run = rp.simulation.simulate_model(model, data, state, internal)
        state, internal = run.states[-1], run.internal[-1]
        last = slice(time.size // 2, None)
        turned = np.exp(-2j * np.pi * line * time[last])
        values.append((run.outputs[last, 0] @ turned) / (force[last] @ turned))
    values = np.array(values)
    level = noise * np.abs(values).mean() / np.sqrt(2)
    values = values + level * (
        rng.standard_normal(SINES.size) + 1j * rng.standard_normal(SINES.size)
    )
    return rp.signals.labelled_response(SINES, values[:, None, None], ["x"], ["F"], "m/N")


def at_amplitudes(model, *amplitudes):
    return {a: stepped_sine(model, a, seed=k) for k, a in enumerate(amplitudes)}


@pytest.mark.parametrize(
    ("kind", "values", "amplitudes", "trends"),
    [
        ("cubic_stiffness", {"stiffness": 4e3}, (0.2, 0.8, 1.6), ("rises", None)),
        ("cubic_stiffness", {"stiffness": -4e3}, (0.2, 0.8, 1.6), ("falls", None)),
        ("coulomb_friction", {"force": 0.3, "width": 1e-3}, (1.0, 2.0, 4.0), ("stays", "falls")),
        ("quadratic_damping", {"coefficient": 2.0}, (0.3, 1.0, 3.0), ("stays", "rises")),
        ("elastic_coulomb_friction", {"force": 1.0, "stiffness": 100.0}, (0.3, 1.0, 2.0),
         ("falls", "rises")),
    ],
)  # fmt: skip
def test_what_depends_on_the_amplitude_tells_the_effect(kind, values, amplitudes, trends):
    found = rp.identification.amplitude_dependence(
        at_amplitudes(oscillator(kind, values), *amplitudes), oscillator()
    )
    (mode,) = found.modes
    assert not found.linear
    assert mode.frequency_trend == trends[0]
    assert trends[1] in (None, mode.damping_trend)
    assert kind in mode.effects
    assert kind in found.explain()
    assert found.places[0][0] == PLACE


def test_a_linear_machine_is_called_linear():
    found = rp.identification.amplitude_dependence(at_amplitudes(oscillator(), 0.1, 1.0, 10.0))
    assert found.linear
    assert "Linear within the scatter" in found.explain()
    assert found.places == ()
    for seed in range(10):
        model = two_masses()
        responses = {1.0 + k: measured(model, 0.03, 10 * seed + k) for k in range(3)}
        assert rp.identification.amplitude_dependence(responses, model).linear


def test_the_place_is_where_the_modes_that_change_move():
    # a joint between the masses: the second mode feels it more, the first less
    stiff, soft = two_masses(), two_masses(stiffness=(2e5, 0.97e5))
    found = rp.identification.amplitude_dependence(
        {0.1: measured(stiff), 1.0: measured(soft, seed=1)}, stiff
    )
    assert [mode.frequency_trend for mode in found.modes] == ["falls", "falls"]
    largest = found.modes[1].places[0][0]
    assert set(largest) == {"a", "b"}
    assert "softens" in repr(found)
    assert "<table>" in found._repr_html_()


def test_pictures_and_figures_over_the_amplitude():
    found = rp.identification.amplitude_dependence(
        {0.1: measured(two_masses()), 1.0: measured(two_masses(), seed=1)}
    )
    assert found.plot().get_ylabel() == "change of frequency [%]"
    assert found.plot(of="damping").get_xlabel() == "amplitude"
    assert len(found.to_dict()["modes"]) == 2


def test_what_is_refused():
    data = measured(two_masses())
    with pytest.raises(rp.InvalidInputError, match="two or more amplitudes"):
        rp.identification.amplitude_dependence({1.0: data})
    with pytest.raises(rp.InvalidInputError, match="above 0"):
        rp.identification.amplitude_dependence({-1.0: data, 1.0: data})
    with pytest.raises(rp.InvalidInputError, match="the same pairs"):
        rp.identification.amplitude_dependence({2.0: data, 1.0: data.sel(output=["a"])})
    flat = data.copy(data=np.ones(data.shape))
    with pytest.raises(rp.InvalidInputError, match="a resonance"):
        rp.identification.amplitude_dependence({2.0: flat, 1.0: flat})


# Checks and noise of measured responses.


def test_variance_and_coherence_are_believed():
    model = two_masses()
    data = measured(model, told=True)
    by_variance = measured_response(model, data)
    assert by_variance.known
    shape = data["variance"] / np.abs(data) ** 2 * 20
    coherence = (1 / (1 + shape)).drop_vars("variance")
    by_coherence = data.drop_vars("variance").assign_coords(coherence=coherence)
    unscaled = measured_response(model, by_coherence)
    assert not unscaled.known
    by_coherence.attrs["averages"] = 20.0
    scaled = measured_response(model, by_coherence)
    np.testing.assert_allclose(scaled.variance, by_variance.variance, rtol=1e-6)
    ratio = np.median(unscaled.variance / by_variance.variance)
    assert 0.5 < ratio < 2.0


def test_what_does_not_belong_together_is_refused():
    model = two_masses()
    with pytest.raises(rp.InvalidInputError, match="pairs of the model: a/F, b/F"):
        measured_response(model, measured(model).assign_coords(input=["G"]))
    with pytest.raises(rp.InvalidInputError, match="the quantity of the model's output"):
        measured_response(model, measured(two_masses("acceleration")))
    with pytest.raises(rp.InvalidInputError, match="a MechanicalModel"):
        measured_response(model.state_space(), measured(model))


# Resonances, against the poles of known models.


def both(model, **options):
    response = measured_response(model, measured(model, **options))
    return model_resonances(model, response), measured_resonances(response)


def test_a_models_modes_are_its_poles():
    model = two_masses()
    modes, _ = both(model)
    poles = np.linalg.eigvals(model.state_space().A)
    poles = sorted(poles[poles.imag > 0], key=abs)
    for mode, pole in zip(modes, poles, strict=True):
        assert mode.frequency == pytest.approx(abs(pole) / (2 * np.pi))
        assert mode.damping == pytest.approx(-pole.real / abs(pole))
    line = 2j * np.pi * 30.0
    series = sum(
        mode.shape / (line - pole) + mode.shape.conj() / (line - pole.conj())
        for mode, pole in zip(modes, poles, strict=True)
    )
    np.testing.assert_allclose(series, model.frequency_response([30.0]).values[0, :, 0], rtol=1e-6)


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_standard_errors_cover_the_truth(quantity):
    deviations = []
    for seed in range(12):
        true, found = both(two_masses(quantity), noise=0.03, seed=seed)
        assert len(found) == 2
        for one, other in zip(true, found, strict=True):
            deviations.append((other.frequency - one.frequency) / other.frequency_error)
            deviations.append((other.damping - one.damping) / other.damping_error)
            assert likeness(one.shape, other.shape) > 0.99
    assert 0.6 < np.sqrt(np.mean(np.square(deviations))) < 1.7
