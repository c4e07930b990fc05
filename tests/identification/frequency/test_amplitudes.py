"""Responses at several amplitudes, of machines whose effects are known."""

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.machines.simulation.run import simulate_model as simulate
from robustpolish.signals.frequency_response import labelled_response
from tests.identification.frequency.chains import measured, two_masses

PLACE = ("x", "ground")
LINES = np.linspace(2.2, 4.2, 41)  # of an oscillator of 20 rad/s
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
    for line in LINES:
        time = np.arange(PERIODS * SAMPLES) / (SAMPLES * line)
        force = amplitude * np.sin(2 * np.pi * line * time)
        data = xr.Dataset({"F": ("time", force)}, {"time": time})
        run = simulate(model, data, state, internal)
        state, internal = run.states[-1], run.internal[-1]
        last = slice(time.size // 2, None)
        turned = np.exp(-2j * np.pi * line * time[last])
        values.append((run.outputs[last, 0] @ turned) / (force[last] @ turned))
    values = np.array(values)
    level = noise * np.abs(values).mean() / np.sqrt(2)
    values = values + level * (
        rng.standard_normal(LINES.size) + 1j * rng.standard_normal(LINES.size)
    )
    return labelled_response(LINES, values[:, None, None], ["x"], ["F"], "m/N")


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


def test_pictures_and_figures():
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
