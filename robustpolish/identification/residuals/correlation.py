"""The field's tests of residuals, each with its 99 % band."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.signal import coherence as welch_coherence
from scipy.signal.windows import parzen
from scipy.stats import norm

from robustpolish.arrays import Array
from robustpolish.validation import described, invalid

CONFIDENCE = 0.99


@dataclass(frozen=True, eq=False)
class Correlation:
    """A correlation function with the band that chance stays in.

    Attributes
    ----------
    value : xarray.DataArray, shape (lag,)
        Correlation coefficient over ``lag`` in s; a lag above 0 means that the residual comes
        after the other signal.
    band : xarray.DataArray, shape (lag,)
        Half width of the 99 % band.
    """

    value: xr.DataArray
    band: xr.DataArray

    @property
    def flagged(self) -> xr.DataArray:
        """Whether each lag is outside the band."""
        return abs(self.value) > self.band

    @property
    def flagged_share(self) -> float:
        """Share of the lags outside the band: 1 % for chance alone."""
        return float(self.flagged.mean())

    @property
    def largest(self) -> float:
        """Largest coefficient by size, at any lag."""
        return float(self.value[int(np.argmax(np.abs(self.value.values)))])


@dataclass(frozen=True, eq=False)
class Coherence:
    """The share of the residual's power that depends linearly on an input, by frequency.

    Attributes
    ----------
    value : xarray.DataArray, shape (frequency,)
        Between 0 and 1, over ``frequency`` in Hz.
    threshold : float
        What chance exceeds at 1 % of the frequencies.
    """

    value: xr.DataArray
    threshold: float

    @property
    def flagged_share(self) -> float:
        """Share of the frequencies above the threshold."""
        return float((self.value > self.threshold).mean())


def autocorrelation(signal: ArrayLike, step: float = 1.0, lags: int | None = None) -> Correlation:
    """Return the autocorrelation of a residual with the band of white noise.

    Parameters
    ----------
    signal : array_like, shape (samples,)
    step : float, optional
        Sampling time in s.
    lags : int, optional
        Number of lags, from one sample on; half the record by default.

    Returns
    -------
    Correlation

    Raises
    ------
    InvalidInputError
        If there are fewer than 8 samples or more lags than samples.

    Notes
    -----
    For white noise of n samples the coefficient at lag k has mean -(n - k)/(n (n - 1)) and
    variance (n - k)/(n (n + 2)) (Ljung and Box, Biometrika 65, 1978, 297-303; the mean because
    the sample mean is taken out).

    Examples
    --------
    >>> import numpy as np
    >>> noise = np.random.default_rng(1).standard_normal(20000)
    >>> bool(0.005 < autocorrelation(noise).flagged_share < 0.015)
    True
    """
    e = _samples("signal", signal)
    n = e.size
    count = _lags(lags, n)
    covariance = _correlate(e, e)[n - 1 : n + count]
    size = covariance[0] if covariance[0] > 0 else 1.0
    k = np.arange(1, count + 1)
    value = covariance[1:] / size + (n - k) / (n * (n - 1.0))
    band = norm.ppf((1 + CONFIDENCE) / 2) * np.sqrt((n - k) / (n * (n + 2.0)))
    return _correlation(value, band, k * step)


def cross_correlation(
    source: ArrayLike, residual: ArrayLike, step: float = 1.0, lags: int | None = None
) -> Correlation:
    """Return the correlation of a residual with an input, with the band of independence.

    Parameters
    ----------
    source, residual : array_like, shape (samples,)
    step : float, optional
        Sampling time in s.
    lags : int, optional
        Largest lag in samples, to both sides; a quarter of the record by default.

    Returns
    -------
    Correlation

    Notes
    -----
    Two coloured signals correlate by chance far more than white ones. For independent signals the
    variance of the coefficient is the sum over all lags of the product of both autocorrelations,
    divided by the number of samples (M.S. Bartlett 1935; Box, Jenkins and Reinsel, Time Series
    Analysis, section 12.1.3). The sum is taken under a Parzen window, which keeps it positive.

    Examples
    --------
    >>> import numpy as np
    >>> random = np.random.default_rng(2)
    >>> slow = np.convolve(random.standard_normal((2, 20000))[0], np.ones(50), "same")
    >>> other = np.convolve(random.standard_normal(20000), np.ones(50), "same")
    >>> bool(cross_correlation(slow, other).flagged_share < 0.05)
    True
    """
    u, e = _samples("source", source), _samples("residual", residual)
    if u.size != e.size:
        shown = described(f"{u.size} and {e.size} samples")
        raise invalid("source", shown, "signals of one length", "Cut them alike.")
    n = u.size
    count = _lags(lags if lags is not None else n // 4, n)
    size = float(np.sqrt((u @ u) * (e @ e))) or 1.0
    value = _correlate(e, u)[n - 1 - count : n + count] / size
    k = np.arange(-count, count + 1)
    variance = _bartlett_sum(u, e) / n * (n - np.abs(k)) / n
    return _correlation(value, norm.ppf((1 + CONFIDENCE) / 2) * np.sqrt(variance), k * step)


def coherence(source: ArrayLike, residual: ArrayLike, step: float = 1.0) -> Coherence:
    """Return the coherence of a residual with an input: what a linear model could still take.

    Parameters
    ----------
    source, residual : array_like, shape (samples,)
    step : float, optional
        Sampling time in s.

    Returns
    -------
    Coherence

    Notes
    -----
    Welch's estimate from Hann windows that overlap by half; chance exceeds
    1 - 0.01^(1/(m - 1)) at 1 % of the frequencies, m being the number of independent segments
    (Carter, Knapp and Nuttall, IEEE Trans. Audio 21, 1973, 337-344).
    """
    u, e = _samples("source", source), _samples("residual", residual)
    length = max(8, min(u.size // 8, 4096))
    segments = max((u.size - length // 2) // (length - length // 2), 2)
    if not (u @ u > 0 and e @ e > 0):
        frequency = np.fft.rfftfreq(length, step)
        value = np.zeros(frequency.size)
    else:
        with np.errstate(invalid="ignore", divide="ignore"):
            frequency, value = welch_coherence(u, e, 1 / step, nperseg=length)
    # Half overlap of Hann windows makes neighbours alike: correlation 1/6, power 1/36.
    independent = segments / (1 + 2 / 36 * (segments - 1) / segments)
    threshold = 1 - (1 - CONFIDENCE) ** (1 / max(independent - 1, 1e-9))
    array = xr.DataArray(
        np.nan_to_num(value[1:]),
        coords={"frequency": ("frequency", frequency[1:], {"units": "Hz"})},
        dims="frequency",
    )
    return Coherence(array, float(threshold))


def _samples(argument: str, signal: ArrayLike) -> Array:
    values = np.asarray(signal, dtype=float).ravel()
    if values.size < 8 or not np.isfinite(values).all():
        shown = described(f"{values.size} samples, {np.count_nonzero(~np.isfinite(values))} bad")
        raise invalid(argument, shown, "8 finite samples or more", "Compare a longer record.")
    return values - values.mean()


def _lags(lags: int | None, samples: int) -> int:
    count = samples // 2 if lags is None else int(lags)
    if not 1 <= count < samples:
        raise invalid("lags", lags, f"1 to {samples - 1}", "Ask for fewer lags.")
    return count


def _correlate(first: Array, second: Array) -> Array:
    """Return the sums of first[t + lag] * second[t] for the lags -(n-1) to n-1."""
    n = first.size
    length = 1 << (2 * n - 1).bit_length()
    product = np.fft.rfft(first, length) * np.conj(np.fft.rfft(second, length))
    full = np.fft.irfft(product, length)
    return np.concatenate([full[-(n - 1) :], full[:n]])


def _bartlett_sum(u: Array, e: Array) -> float:
    n = u.size
    window = parzen(2 * n // 3 * 2 + 1)
    half = window.size // 2
    middle = slice(n - 1 - half, n + half)
    ru, re = (_correlate(x, x)[middle] / max(float(x @ x), 1e-300) for x in (u, e))
    return max(float(np.sum(window * ru * re)), 1 / n)


def _correlation(value: Array, band: Array, lag: NDArray[np.floating]) -> Correlation:
    coords = {"lag": ("lag", lag, {"units": "s"})}
    return Correlation(
        xr.DataArray(value, coords=coords, dims="lag"),
        xr.DataArray(np.broadcast_to(band, value.shape).copy(), coords=coords, dims="lag"),
    )
