"""The tests of residuals keep their promise: 1 % by chance, more if there is something."""

import numpy as np
import pytest
from scipy import signal

from robustpolish.errors import InvalidInputError
from robustpolish.identification.residuals.tests import (
    autocorrelation,
    coherence,
    cross_correlation,
)

RANDOM = np.random.default_rng(11)


def coloured(samples, frequency=20.0, damping=0.05):
    w = 2 * np.pi * frequency
    b, a = signal.bilinear([w**2], [1, 2 * damping * w, w**2], 1000)
    return signal.lfilter(b, a, RANDOM.standard_normal(samples))


@pytest.mark.parametrize("samples", [500, 4000, 30000])
@pytest.mark.parametrize("lags", [25, None])
def test_white_noise_is_flagged_at_one_per_cent_of_the_lags(samples, lags):
    runs = 400 if lags else 60
    shares = [
        autocorrelation(RANDOM.standard_normal(samples), lags=lags).flagged_share
        for _ in range(runs)
    ]
    assert 0.005 < np.mean(shares) < 0.015


@pytest.mark.parametrize("kind", ["uniform", "laplace"])
def test_the_band_does_not_need_normal_noise(kind):
    shares = [autocorrelation(getattr(RANDOM, kind)(size=5000)).flagged_share for _ in range(40)]
    assert 0.005 < np.mean(shares) < 0.015


def test_coloured_noise_is_seen():
    assert autocorrelation(coloured(5000)).flagged_share > 0.05


def test_the_coefficients_are_those_of_the_definition():
    e = RANDOM.standard_normal(300)
    found = autocorrelation(e, step=0.1, lags=3)
    c = e - e.mean()
    for k in (1, 2, 3):
        # The small constant is the mean that taking out the sample mean brings.
        expected = (c[k:] @ c[:-k]) / (c @ c) + (300 - k) / (300 * 299)
        assert float(found.value[k - 1]) == pytest.approx(expected)
    np.testing.assert_allclose(found.value["lag"], [0.1, 0.2, 0.3])


def test_cross_correlation_finds_a_delay_and_its_sign():
    u = RANDOM.standard_normal(5000)
    e = 0.3 * np.roll(u, 7) + RANDOM.standard_normal(5000)
    found = cross_correlation(u, e, step=0.01)
    assert float(found.value["lag"][int(np.argmax(found.value.values))]) == pytest.approx(0.07)
    assert bool(found.flagged.sel(lag=0.07, method="nearest"))


@pytest.mark.parametrize(
    ("source", "residual"), [("white", "white"), ("coloured", "white"), ("coloured", "coloured")]
)
def test_independent_signals_stay_in_the_band_whatever_their_colour(source, residual):
    make = {"white": RANDOM.standard_normal, "coloured": coloured}
    shares = [
        cross_correlation(make[source](8000), make[residual](8000)).flagged_share for _ in range(60)
    ]
    assert 0.004 < np.mean(shares) < 0.015


def test_the_white_band_would_be_wrong_for_coloured_signals():
    u, e = coloured(8000), coloured(8000)
    assert float(cross_correlation(u, e).band.max()) > 2 * 2.576 / np.sqrt(8000)


def test_coherence_by_chance_and_by_cause():
    shares = [coherence(coloured(8000), coloured(8000)).flagged_share for _ in range(60)]
    assert 0.004 < np.mean(shares) < 0.016
    u = RANDOM.standard_normal(8000)
    caused = coherence(u, np.convolve(u, [1, 0.5, 0.2], "same") + RANDOM.standard_normal(8000))
    assert caused.flagged_share > 0.5


def test_silence_has_no_coherence():
    assert coherence(np.zeros(100), RANDOM.standard_normal(100)).flagged_share == 0


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_no_unit_is_special(scale):
    u, e = coloured(2000), coloured(2000)
    first, second = cross_correlation(u, e), cross_correlation(scale * u, e / scale)
    np.testing.assert_allclose(first.value, second.value, atol=1e-12)
    np.testing.assert_allclose(first.band, second.band, rtol=1e-9)


def test_refused():
    with pytest.raises(InvalidInputError, match="signal"):
        autocorrelation([1.0, 2.0])
    with pytest.raises(InvalidInputError, match="signal"):
        autocorrelation([np.nan] * 100)
    with pytest.raises(InvalidInputError, match="lags"):
        autocorrelation(RANDOM.standard_normal(100), lags=100)
    with pytest.raises(InvalidInputError, match="one length"):
        cross_correlation(RANDOM.standard_normal(100), RANDOM.standard_normal(99))
