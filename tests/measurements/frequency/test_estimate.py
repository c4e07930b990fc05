"""Frequency responses from time records, against systems that are known."""

import numpy as np
import pytest
import xarray as xr
from scipy.signal import freqz, lfilter

from robustpolish import InvalidInputError, estimate_frequency_response

DT = 1e-2
B, A = [0.0, 0.5, 0.3], [1.0, -0.6, 0.3]  # well damped: nothing leaks


def filtered(signal):
    return lfilter(B, A, signal)


def record(seed=0, noise=0.3, input_noise=0.0, samples=40000):
    rng = np.random.default_rng(seed)
    force = rng.standard_normal(samples)
    x = filtered(force) + noise * rng.standard_normal(samples)
    force = force + input_noise * rng.standard_normal(samples)
    return dataset(F=(force, "N"), x=(x, "m"))


def dataset(**columns):
    size = len(next(iter(columns.values()))[0])
    return xr.Dataset(
        {name: ("time", values, {"units": unit}) for name, (values, unit) in columns.items()},
        {"time": np.arange(size) * DT},
    )


def truth(response):
    return freqz(B, A, 2 * np.pi * response["frequency"].values * DT)[1]


def test_the_stated_variance_is_that_of_the_estimate():
    inside = []
    for seed in range(6):
        response = estimate_frequency_response(record(seed), "F", "x", segment=2.0)
        error = np.abs(response.values[:, 0, 0] - truth(response)) ** 2
        inside.append(np.mean(error / response["variance"].values[:, 0, 0]))
    assert 0.8 < np.mean(inside) < 1.25
    assert response["units"].item() == "m/N"


@pytest.mark.parametrize("overlap", [0.0, 0.5, 0.75])
def test_segments_that_overlap_count_as_fewer(overlap):
    response = estimate_frequency_response(record(), "F", "x", segment=2.0, overlap=overlap)
    assert 190 < response.attrs["averages"] < 430  # Hann, 75 %: 2.1 times as many


def test_noise_on_the_input_biases_h1_only():
    data = record(noise=0.0, input_noise=0.5, samples=200000)
    sizes = {}
    for method in ("H1", "H2", "Hv"):
        response = estimate_frequency_response(data, ["F"], ["x"], method=method, segment=2.0)
        sizes[method] = np.mean(np.abs(response.values[:, 0, 0]) / np.abs(truth(response)))
    assert sizes["H1"] == pytest.approx(0.8, abs=0.01)  # 1 / (1 + 0.5^2)
    assert sizes["H2"] == pytest.approx(1.0, abs=0.01)
    assert sizes["Hv"] == pytest.approx(np.sqrt(0.8), abs=0.01)


def test_two_inputs_are_taken_apart():
    rng = np.random.default_rng(0)
    first = rng.standard_normal(100000)
    second = rng.standard_normal(100000) + 0.7 * first
    noise = 0.1 * rng.standard_normal(100000)
    data = dataset(F=(first, "N"), G=(second, "N"), x=(filtered(first) - 2 * second + noise, "m"))
    response = estimate_frequency_response(data, ["F", "G"], "x", segment=2.0)
    error = response.values[:, 0, 0] - truth(response), response.values[:, 0, 1] + 2
    spread = np.sqrt(response["variance"].values[:, 0])
    assert np.sqrt(np.mean(np.abs(error[0]) ** 2)) < 1.5 * spread[:, 0].mean()
    assert np.sqrt(np.mean(np.abs(error[1]) ** 2)) < 1.5 * spread[:, 1].mean()
    with pytest.raises(InvalidInputError, match="one input, or H1"):
        estimate_frequency_response(data, ["F", "G"], "x", method="H2")


def test_whole_periods_leak_nothing():
    period = np.random.default_rng(0).standard_normal(400)
    data = dataset(F=(np.tile(period, 10), "N"), x=(filtered(np.tile(period, 20))[4000:], "m"))
    response = estimate_frequency_response(
        data, "F", "x", segment=4.0, window="boxcar", overlap=0.0
    )
    np.testing.assert_allclose(response.values[:, 0, 0], truth(response), atol=1e-9)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"inputs": "G"}, "no column 'G'"),
        ({"segment": 300.0}, "independent segments"),
        ({"segment": 1e3}, "samples of"),
        ({"overlap": 0.95}, "at most 0.9"),
        ({"method": "H3"}, "one of 'H1'"),
    ],
)
def test_what_is_refused(asked, message):
    with pytest.raises(InvalidInputError, match=message):
        estimate_frequency_response(record(), **{"inputs": "F", "outputs": "x", **asked})
