"""Noise from records that repeat each other, and what is no repeat."""

import numpy as np
import pytest
import xarray as xr
from scipy.signal import lfilter

from robustpolish.identification.record import record_of, repeats
from tests.identification.oscillators import oscillator, record


def noisy(size, pole, seed, data=None):
    """The record with noise of first order, so many times the motion."""
    data = record(2000) if data is None else data
    random = np.random.default_rng(seed)
    noise = lfilter([np.sqrt(1 - pole**2)], [1.0, -pole], random.standard_normal(2300))[300:]
    x = data["x"].values
    return data.assign(x=("time", x + size * np.std(record(2000)["x"].values) * noise))


def found(*data, model=None):
    model = model or oscillator()
    return repeats(model, record_of(model, list(data)))


@pytest.mark.parametrize("pole", [0.0, 0.6, 0.9])
@pytest.mark.parametrize("size", [0.1, 0.01, 1e-4])
def test_the_noise_is_that_of_the_difference(size, pole):
    """Of whatever colour and size; the longer record is looked at as far as both go."""
    data = [noisy(size, pole, seed) for seed in (1, 2, 3)]
    true = size * np.std(record(2000)["x"].values)
    both = found(data[0], data[1].isel(time=slice(0, 1500)))
    assert true / 1.5 < both.noise[0] < 1.5 * true
    assert both.pairs == (("record 1", "record 2"),)
    three = found(*data)
    assert three.noise[0] == pytest.approx(true, rel=0.25)
    assert three.names == "record 1, record 2 and record 3"


def test_noise_on_measured_inputs_is_none_of_another_input():
    one, two = (noisy(0.01, 0.0, seed) for seed in (1, 2))
    random = np.random.default_rng(0)
    force = one["F"] + 0.005 * float(one["F"].std()) * random.standard_normal(2000)
    assert found(one.assign(F=force), two) is not None


def test_a_free_decay_may_repeat_itself():
    time = np.arange(2000) / 500
    decay = np.exp(-0.5 * time) * np.cos(20 * time)
    data = xr.Dataset({"x": ("time", decay)}, {"time": time})
    one, two = (noisy(0.001, 0.6, seed, data) for seed in (1, 2))
    true = 0.001 * np.std(record(2000)["x"].values)
    model = oscillator(inputs=[])
    assert found(one, two, model=model).noise[0] == pytest.approx(true, rel=0.2)
    larger = two.assign(x=two["x"] + 0.01 * decay)
    assert found(one, larger, model=model) is None


OTHERS = {
    "another input": (0.01, lambda one: noisy(0.01, 0.0, 2, record(2000, seed=1))),
    "another start": (0.001, lambda one: noisy(0.001, 0.0, 2, record(2000, (0.001, 0.02)))),
    "another stiffness": (0.001, lambda one: noisy(0.001, 0.0, 2, record(2000, stiffness=402.0))),
    "another amplitude": (0.01, lambda one: noisy(0.01, 0.0, 2).map(lambda v: 1.05 * v)),
    "a later trigger": (0.01, lambda one: noisy(0.01, 0.0, 2).roll(time=1, roll_coords=False)),
    "too short": (0.01, lambda one: noisy(0.01, 0.0, 2).isel(time=slice(0, 150))),
    "a copy": (0.01, lambda one: one),
}


@pytest.mark.parametrize("what", OTHERS)
def test_what_is_no_repeat(what):
    size, other = OTHERS[what]
    one = noisy(size, 0.0, 1)
    assert found(one, other(one)) is None


def test_one_record_has_no_repeat():
    assert found(noisy(0.01, 0.0, 1)) is None
