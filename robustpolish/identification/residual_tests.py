"""Tests of residuals, noise floors, shares of the error, restoring-force surfaces."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.signal import coherence as welch_coherence
from scipy.signal import correlate, welch
from scipy.signal.windows import parzen
from scipy.stats import norm

from robustpolish.base.arrays import Array
from robustpolish.base.checks import described, invalid
from robustpolish.identification.compare import Comparison
from robustpolish.identification.findings import ForceMap
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.observer.kalman import force_sites
from robustpolish.identification.observer.runs import StartedPiece, free_run, rest
from robustpolish.identification.observer.starts import SmoothedMotion, motion_of, smoothed_motion
from robustpolish.identification.record import record_of
from robustpolish.machines.mechanical.data import port_row
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import UNITS

# Correlation and coherence tests of residuals, each with its 99 % band.

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
    covariance = correlate(e, e, method="fft")[n - 1 : n + count]
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
    value = correlate(e, u, method="fft")[n - 1 - count : n + count] / size
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
    with np.errstate(invalid="ignore", divide="ignore"):  # of signals that stand still
        frequency, value = welch_coherence(u, e, 1 / step, nperseg=length)
    # Half overlap of Hann windows makes neighbours alike: correlation 1/6, power 1/36.
    independent = segments / (1 + 2 / 36 * (segments - 1) / segments)
    threshold = 1 - (1 - CONFIDENCE) ** (1 / max(independent - 1, 1e-9))
    axis = {"frequency": ("frequency", frequency[1:], {"units": "Hz"})}
    return Coherence(xr.DataArray(np.nan_to_num(value[1:]), axis, "frequency"), float(threshold))


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


def _bartlett_sum(u: Array, e: Array) -> float:
    n = u.size
    window = parzen(2 * n // 3 * 2 + 1)
    half = window.size // 2
    middle = slice(n - 1 - half, n + half)
    ru, re = (correlate(x, x, method="fft")[middle] / max(float(x @ x), 1e-300) for x in (u, e))
    return max(float(np.sum(window * ru * re)), 1 / n)


def _correlation(value: Array, band: Array, lag: NDArray[np.floating]) -> Correlation:
    coords = {"lag": ("lag", lag, {"units": "s"})}
    return Correlation(xr.DataArray(value, coords, "lag"), xr.DataArray(band, coords, "lag"))


# Noise floor: sensor noise separated from model error.
#
# What a model does wrong is a part of the motion: where the spectrum of the errors exceeds that of
# the motion itself, they are noise. The colour of that noise, of first order, tells how much of it
# lies under the motion (P. Whittle 1953, Arkiv foer Matematik 2, 423-434, on fits to spectra). Far
# above its corner all colours look alike, though they differ by ten below: of those that the seen
# part allows, the floor is the loudest that the errors under the motion leave room for.
# Records that repeat each other need none of that, see :mod:`robustpolish.identification.record`.

_POLES = np.concatenate([np.linspace(0.0, 0.9, 37), 1 - np.geomspace(0.1, 0.05, 12)[1:]])
_STEEPEST = 0.9
"""Where no colour up to that is plausible, the errors are harmonics of what the model lacks."""
_CONFUSABLE = 3e-3
"""Mean of the log-likelihood by which colours may differ: no sensor is quite of first order."""
_ROOM = 0.7
"""Errors over noise, both smoothed over frequencies, below which a colour has no room."""
_SURE = 3.0
"""Standard errors that an estimated density may lie below the true one by chance."""
_FEWEST, _SMOOTHED, _DETRENDED = 8, 5, 3
_ALIKE = 1.9
"""Neighbours in a spectrum over windows of Hann's shape that say as much as one alone."""
_STRETCHES, _SCATTER = 8, 1.2
"""Of an eighth of a record, and what the sizes of coloured noise in them differ by."""


def residual_noise_floor(
    model: MechanicalModel, prepared: PreparedRecord, predictable: bool
) -> Array:
    """Return the noise of each output that the errors of a fitted model show, shape (ny,).

    Parameters
    ----------
    model : MechanicalModel
    prepared : PreparedRecord
    predictable : bool
        Whether free runs over the whole record judge; windows do otherwise.
    """
    pieces = prepared.everything if predictable else prepared.windows
    run, started = prepared.run_with_fitted_starts(model, pieces)
    motion, known = run.over_all(started).outputs, prepared.repeats is not None
    record, scales = prepared.record, prepared.scales
    errors = record.Y - motion
    return noise_floor(errors, motion, scales.noise, known, record.honest, scales.rounded)


def noise_floor(
    errors: Array,
    motion: Array,
    least: Array,
    known: bool = False,
    honest: float = 1.0,
    steps: Array | float = 0.0,
) -> Array:
    """Return the standard deviation of the noise of each output.

    Parameters
    ----------
    errors, motion : ndarray, shape (samples, ny)
        Of a model's runs, and its outputs there.
    least : ndarray, shape (ny,)
        Noise that is seen in the quietest band of the record, if the motion hides all other.
    known : bool, optional
        Whether `least` is the noise itself, as records show it that repeat each other.
    honest : float, optional
        Share of half the sampling rate in which noise is looked for, see :class:`Record`.
    steps : ndarray, shape (ny,), optional
        What sensors round away that count in steps: where nothing moves it does not show.

    Returns
    -------
    ndarray, shape (ny,)
        At most the error.
    """
    found = least
    if not known:
        each = zip(errors.T, motion.T, least, strict=True)
        found = [_floor(e, y, low, honest) for e, y, low in each]
    # Noise never falls: where a motion dies away, or a blow is yet to come, a model does nothing
    # wrong, and what is left in the quietest stretch bounds it.
    parts = [np.sqrt(np.mean(part**2, axis=0)) for part in np.array_split(errors, _STRETCHES)]
    quietest, whole = _SCATTER * np.min(parts, axis=0), np.sqrt(np.mean(errors**2, axis=0))
    return np.minimum(np.maximum(np.minimum(found, quietest), steps), whole)


def _floor(error: Array, motion: Array, least: float, honest: float) -> float:
    if not (np.isfinite(error).all() and np.isfinite(motion).all()):
        return least
    length = min(512, len(error) // 4)
    frequency, noise = welch(error, nperseg=length, detrend="linear")
    _, moving = welch(motion, nperseg=length, detrend="linear")
    inner = (frequency > 0) & (frequency < 0.5 * honest)
    seen = inner & (noise > moving)
    if np.count_nonzero(seen) < _FEWEST:
        return least
    density, turn = noise / 2, np.cos(2 * np.pi * frequency)
    shapes = 1 / (1 + _POLES[:, None] ** 2 - 2 * _POLES[:, None] * turn)
    strength = np.mean(density[seen] / shapes[:, seen], axis=1)
    if not np.min(strength) > 0:
        return least
    misfit = np.log(strength) + np.mean(np.log(shapes[:, seen]), axis=1)
    averaged = 1.5 * len(error) / length  # of segments that overlap by half
    confusable = max(_CONFUSABLE, 3 / (averaged * np.count_nonzero(seen)))
    plausible = misfit < np.min(misfit) + confusable
    if np.min(_POLES[plausible]) > _STEEPEST:
        return max(float(np.sqrt(np.percentile(density[seen], 25))), least)
    sizes = np.sqrt(strength / (1 - _POLES**2))
    hidden = inner & ~seen & (np.arange(frequency.size) >= _DETRENDED)
    spread = np.ones(_SMOOTHED) / _SMOOTHED
    there = np.convolve(density, spread, "same")
    wanted = np.array([np.convolve(row, spread, "same") for row in strength[:, None] * shapes])
    chance = _SURE / np.sqrt(_SMOOTHED * averaged / _ALIKE)
    least_room = min(_ROOM, 1 - chance)
    room = np.min((there / wanted)[:, hidden], axis=1, initial=np.inf) > least_room
    if not np.any(plausible & room):
        return max(float(np.min(sizes[plausible])), least)
    return max(float(np.max(sizes[plausible & room])), least)


# Where the error is: its share by time, frequency, motion, spin phase and contact.


_AXES = ("displacement", "velocity")


def window_shares(residual: xr.Dataset, windows: int) -> xr.DataArray:
    """Return the share of each output's squared error in each time window.

    Parameters
    ----------
    residual : xarray.Dataset
        Over uniform ``time``.
    windows : int

    Returns
    -------
    xarray.DataArray, shape (output, window)
        Rows add up to 1; the coordinates ``begin`` and ``end`` are in s.
    """
    time = residual["time"].values
    edges = np.linspace(0, time.size, windows + 1).astype(int)
    rows = [np.add.reduceat(e**2, edges[:-1]) for e in _rows(residual)]
    coords = {"begin": ("window", time[edges[:-1]]), "end": ("window", time[edges[1:] - 1])}
    return _normalised(rows, residual, "window", coords)


def band_shares(residual: xr.Dataset, edges: ArrayLike) -> xr.DataArray:
    """Return the share of each output's squared error in each frequency band.

    Parameters
    ----------
    residual : xarray.Dataset
        Over uniform ``time``.
    edges : array_like
        Rising frequencies in Hz; the first band begins at 0, whatever the first edge says.

    Returns
    -------
    xarray.DataArray, shape (output, band)
        The coordinates ``low`` and ``high`` are in Hz.
    """
    limits = np.asarray(edges, dtype=float)
    rows = []
    for frequency, power in (error_spectrum(residual, name) for name in residual.data_vars):
        band = np.clip(np.searchsorted(limits, frequency, side="right") - 1, 0, limits.size - 2)
        rows.append(np.bincount(band, power, limits.size - 1))
    coords = {"low": ("band", limits[:-1]), "high": ("band", limits[1:])}
    return _normalised(rows, residual, "band", coords)


def line_shares(residual: xr.Dataset, frequencies: Sequence[float], dim: str) -> xr.DataArray:
    """Return the share of each output's squared error near some frequencies.

    Near is within 5 % or two lines of the spectrum, whichever is more. Frequencies that are equal
    as they are told, such as those of equal axes, are one.

    Parameters
    ----------
    residual : xarray.Dataset
    frequencies : sequence of float
        In Hz, such as those of modes, or of spin harmonics.
    dim : str
        Name of the dimension, such as ``"mode"``.

    Returns
    -------
    xarray.DataArray, shape (output, `dim`)
        The coordinate ``frequency`` is in Hz. Rows do not add up to 1.
    """
    frequencies, rows = [*{f"{f:.4g}": f for f in frequencies}.values()], []
    for name in residual.data_vars:
        frequency, power = error_spectrum(residual, name)
        width = 2.5 * (frequency[1] - frequency[0])
        near = [np.abs(frequency - f) <= max(0.05 * f, width) for f in frequencies]
        rows.append([float(power[mask].sum()) for mask in near])
    coords = {"output": list(residual.data_vars), "frequency": (dim, frequencies)}
    return xr.DataArray(np.array(rows).reshape(len(rows), -1), coords, ("output", dim))


def error_spectrum(residual: xr.Dataset, name: object) -> tuple[Array, Array]:
    """Return frequencies in Hz and the share of one output's squared error at each of them."""
    e = np.asarray(residual[name].values, dtype=float)
    time = residual["time"].values
    rate = (time.size - 1) / float(time[-1] - time[0])
    length = min(e.size, max(256, e.size // 8))
    # The mean is an error too; the stubs of SciPy know no detrend=False.
    frequency, power = welch(e, rate, nperseg=length, detrend=False)  # pyright: ignore[reportArgumentType]
    total = float(power.sum())
    return frequency, power / total if total > 0 else power


def value_shares(residual: xr.Dataset, values: Array, bins: int, dim: str) -> xr.DataArray:
    """Return the share of each output's squared error by the value of a signal.

    Parameters
    ----------
    residual : xarray.Dataset
    values : ndarray, shape (samples,)
        Such as a displacement or a velocity.
    bins : int
        Of equal width.
    dim : str
        Name of the dimension; its coordinate holds the middle of each bin.

    Returns
    -------
    xarray.DataArray, shape (output, `dim`)
        The coordinate ``samples`` is the share of the samples in each bin: where the error's share
        is larger, there the model is worse than elsewhere.
    """
    edges = np.linspace(values.min(), values.max(), bins + 1)
    middle = (edges[:-1] + edges[1:]) / 2
    return _binned(residual, _cells(values, bins), dim, middle)


def phase_shares(residual: xr.Dataset, spin_frequency: float, bins: int) -> xr.DataArray:
    """Return the share of each output's squared error by the phase of the spin.

    Parameters
    ----------
    residual : xarray.Dataset
    spin_frequency : float
        In Hz; the phase is 0 at time 0, of each of several records on its own clock.
    bins : int

    Returns
    -------
    xarray.DataArray, shape (output, phase)
        Over ``phase`` in rad; the coordinate ``mean`` (output, phase) is the error averaged in
        phase with the spin, in the unit of the output.
    """
    time = residual["own_time" if "own_time" in residual.coords else "time"].values
    turns = np.mod(time * spin_frequency, 1.0)
    index = np.minimum((turns * bins).astype(int), bins - 1)
    count = np.bincount(index, minlength=bins)
    means = [np.bincount(index, e, bins) / np.maximum(count, 1) for e in _rows(residual)]
    found = _binned(residual, index, "phase", (np.arange(bins) + 0.5) * 2 * np.pi / bins)
    return found.assign_coords(mean=(("output", "phase"), np.array(means)))


def contact_shares(residual: xr.Dataset, contact: NDArray[np.bool_]) -> xr.DataArray:
    """Return the share of each output's squared error in contact and in free flight.

    Parameters
    ----------
    residual : xarray.Dataset
    contact : ndarray of bool, shape (samples,)

    Returns
    -------
    xarray.DataArray, shape (output, state)
        ``state`` is ``"contact"`` or ``"flight"``; the coordinate ``samples`` as elsewhere.
    """
    index = np.where(contact, 0, 1)
    return _binned(residual, index, "state", ["contact", "flight"])


def surface(q: Array, v: Array, force: Array, bins: int) -> xr.Dataset:
    """Return the mean force over displacement and velocity: the restoring-force surface.

    Parameters
    ----------
    q, v, force : ndarray, shape (samples,)
        Relative displacement and velocity at a place, and the force there.
    bins : int
        In each direction.

    Returns
    -------
    xarray.Dataset
        ``force``, NaN where nothing was measured, and ``samples`` (share), over
        (``displacement``, ``velocity``).
    """
    axes = [np.linspace(x.min(), x.max(), bins + 1) for x in (q, v)]
    count, _, _ = np.histogram2d(q, v, bins=axes)
    total, _, _ = np.histogram2d(q, v, bins=axes, weights=force)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = total / count
    return xr.Dataset(
        {"force": (_AXES, mean), "samples": (_AXES, count / q.size)},
        {dim: (edges[:-1] + edges[1:]) / 2 for dim, edges in zip(_AXES, axes, strict=True)},
    )


def _binned(residual: xr.Dataset, index: Array, dim: str, labels: Any) -> xr.DataArray:
    """Return the shares of each output's squared error by the bin of each sample."""
    bins = len(labels)
    rows = [np.bincount(index, e**2, bins) for e in _rows(residual)]
    samples = np.bincount(index, minlength=bins) / index.size
    return _normalised(rows, residual, dim, {dim: (dim, labels), "samples": (dim, samples)})


def _rows(residual: xr.Dataset) -> list[Array]:
    return [np.asarray(residual[name].values, dtype=float) for name in residual.data_vars]


def _normalised(
    rows: Sequence[NDArray[Any]], residual: xr.Dataset, dim: str, coords: dict
) -> xr.DataArray:
    table = np.array(rows, dtype=float)
    total = table.sum(axis=1, keepdims=True)
    return xr.DataArray(
        np.divide(table, total, out=np.zeros_like(table), where=total > 0),
        dims=("output", dim),
        coords={"output": list(residual.data_vars), **coords},
    )


# The error by displacement and velocity at each place, and the missing force over both.
#
# With it how much of a force follows from the motion at one place.

MAP_BINS = 12
"""Cells of a map in each direction: a dozen show a dead zone and a step at standstill, and 3000
samples still fill them."""
_BLOCKS = 20
"""Stretches of the record that belong to one half and to the other in turn: many, so that a decay
has its large and its small swings in both."""


@dataclass(frozen=True, eq=False)
class PlaceShares:
    """The error by the motion at one place.

    Attributes
    ----------
    at : (str, str)
        Two coordinates, or one and ``"ground"``.
    displacement, velocity : xarray.DataArray, shapes (output, displacement), (output, velocity)
        Share of each output's squared error by relative displacement and velocity.
    surface : xarray.Dataset
        Restoring-force surface: mean missing force on the first coordinate over displacement and
        velocity.
    observed : bool
        Whether motion and force were estimated from the measured outputs (by a smoother). If
        that could not be done the motion is the simulated one and the force unknown (NaN).
    follows : float
        Share of the missing force's power, from 0 to 1, that displacement and velocity here
        foretell: what the map of one half of the record says of the other.
    """

    at: tuple[str, str]
    displacement: xr.DataArray
    velocity: xr.DataArray
    surface: xr.Dataset
    observed: bool
    follows: float = 0.0


def place_shares(comparison: Comparison, residual: xr.Dataset, bins: int) -> dict[str, PlaceShares]:
    """Return the error by the motion at every coordinate and connection of the model.

    Parameters
    ----------
    comparison : Comparison
    residual : xarray.Dataset
        Its residual, which may begin later.
    bins : int

    Returns
    -------
    dict of str to PlaceShares
        By ``"x"`` for a coordinate and ``"x - x_m"`` for a connection.
    """
    q, v, force, observed = _motion(comparison)
    skip = q.shape[1] - residual.sizes["time"]
    found = {}
    q, v, force = (part[:, skip:] for part in (q, v, force))
    for here, dq, dv in maps_at_places(comparison.model, q, v, force, bins):
        q_shares = value_shares(residual, dq, bins, "displacement")
        v_shares = value_shares(residual, dv, bins, "velocity")
        shares = PlaceShares(here.at, q_shares, v_shares, here.surface, observed, here.follows)
        found[here.name] = shares
    return found


def maps_at_places(
    model: MechanicalModel, q: Array, v: Array, force: Array, bins: int
) -> Iterator[tuple[ForceMap, Array, Array]]:
    """Yield the missing force and the motion at every coordinate and connection that moves.

    Parameters
    ----------
    model : MechanicalModel
    q, v : ndarray, shape (coordinates, samples)
    force : ndarray, shape (sites, samples)
        Missing force at each site, see
        :func:`~robustpolish.identification.observer.kalman.force_sites`.
    bins : int
        Of the maps, in each direction.

    Yields
    ------
    map : ForceMap
        With units.
    displacement, velocity : ndarray, shape (samples,)
        Relative ones.
    """
    sizes, sites = model.frame.sizes, force_sites(model)[0]
    for at in _places(model):
        row = port_row(model, at)
        dq, dv, across = row @ q, row @ v, sites * row * sizes**2
        if np.ptp(dq) == 0 or np.ptp(dv) == 0:
            continue
        pull = np.sum(across, axis=1) @ force / float(row**2 @ sizes**2)
        shown = surface(dq, dv, pull, bins)
        for name in ("force", *_AXES):
            shown[name].attrs["units"] = UNITS[model.is_rotational(at)][name]
        size, follows = np.sqrt(np.mean(pull**2)), predictable_share(dq, dv, pull, bins)
        yield ForceMap(at, shown, float(size), follows), dq, dv


def _motion(comparison: Comparison) -> tuple[Array, Array, Array, bool]:
    """Displacements, velocities and missing forces along the record, shape (rows, samples)."""
    model = comparison.model
    record = record_of(model, comparison.data)
    found = smoothed_motion(model, record)
    if found is not None:
        return found.q, found.v, found.force, True
    starts = [rest(model).with_vector(error.starts[0]) for error in comparison.records.values()]
    pieces = [StartedPiece(*piece) for piece in zip(record.parts, starts, strict=True)]
    states = free_run(model, record).over_all(pieces, keep=True).states
    q, v = motion_of(model, np.nan_to_num(states), record.signals(model))
    return q, v, np.full((len(force_sites(model)[0]), record.samples), np.nan), False


def _places(model: MechanicalModel) -> list[tuple[str, str]]:
    """Every coordinate against ground, and every pair that something connects."""
    pairs = [(x, "ground") for x in model.frame.coordinates if x not in model.channels]
    connected = [s.between for s in model.springs] + [d.between for d in model.dampers]
    connected += [e.at for e in model.effects if e.definition.domain == "pair"]
    connected += [(o.of[0], o.of[1]) for o in model.outputs if o.weights is None]
    for ends in connected:
        if "ground" not in ends and not any(set(ends) == set(pair) for pair in pairs):
            pairs.append((ends[0], ends[1]))
    return pairs


def predictable_share(q: Array, v: Array, force: Array, bins: int = MAP_BINS) -> float:
    """Return the share of a force's power that the map of one half of a record says of the other.

    Parameters
    ----------
    q, v, force : ndarray, shape (samples,)
        Displacement, velocity and force; NaN forces follow from nothing.
    bins : int, optional
        Cells of the map in each direction.

    Returns
    -------
    float
        From 0 to 1. Cells that only one half visits count as foretold to be zero.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> time = np.arange(4000) / 100
    >>> q, v = np.sin(time) + 0.3 * np.sin(7.3 * time), np.cos(time) + 2.2 * np.cos(7.3 * time)
    >>> predictable_share(
    ...     q, v, np.sign(v)) > 0.9, predictable_share(q, v, rng.standard_normal(4000)
    ... ) < 0.05
    (True, True)
    """
    total = float(np.sum(force**2))
    if not 0 < total < np.inf:
        return 0.0
    cell = bins * _cells(q, bins) + _cells(v, bins)
    half = (np.arange(force.size) * _BLOCKS // force.size) % 2
    left = 0.0
    for this in (0, 1):
        other = half != this
        count = np.bincount(cell[other], minlength=bins**2)
        mean = np.bincount(cell[other], force[other], bins**2) / np.maximum(count, 1)
        left += float(np.sum((force[~other] - mean[cell[~other]]) ** 2))
    return float(np.clip(1 - left / total, 0.0, 1.0))


def _cells(values: Array, bins: int) -> np.ndarray:
    edges = np.linspace(values.min(), values.max(), bins + 1)
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, bins - 1)


# Restoring-force maps at every place, the most predictable first.


_LEAST = 0.05
"""Share of the largest missing force of the same unit below which a place is left out: what is next
to nothing follows from anything."""
_MOST = 4
"""Maps that are kept."""
MAPS_SHOWN = 2
"""Maps that are drawn in a report: where two masses are joined, a force between them shows at both
and at their connection."""
MAP_TELLS = 0.1
"""Share of the force that has to follow from the motion for a map to say anything."""


def force_maps(model: MechanicalModel, motion: SmoothedMotion) -> tuple[ForceMap, ...]:
    """Return the missing force over displacement and velocity, by how far these foretell it.

    Parameters
    ----------
    model : MechanicalModel
    motion : SmoothedMotion
        Motion and missing force along a record.

    Returns
    -------
    tuple of ForceMap
        None if the motion could not be followed.
    """
    if not all(np.isfinite(part).all() for part in (motion.q, motion.v, motion.force)):
        return ()
    places = maps_at_places(model, motion.q, motion.v, motion.force, MAP_BINS)
    found = [here for here, _, _ in places]
    largest = {f.unit: f.size for f in sorted(found, key=lambda f: f.size)}
    seen = [f for f in found if f.size > _LEAST * largest[f.unit]]
    return tuple(sorted(seen, key=lambda f: -f.follows)[:_MOST])
