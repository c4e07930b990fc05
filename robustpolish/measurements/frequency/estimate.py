"""Frequency responses estimated from time records."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import xarray as xr
from scipy.signal import csd, get_window

from robustpolish.measurements.frequency.response import labelled_response, ratio_unit
from robustpolish.measurements.sampling import sampling_time
from robustpolish.validation import described, invalid, one_of, positive

_SEGMENTS = 8


def estimate_frequency_response(
    data: xr.Dataset,
    inputs: Sequence[str] | str,
    outputs: Sequence[str] | str,
    *,
    method: Literal["H1", "H2", "Hv"] = "H1",
    segment: float | None = None,
    window: str = "hann",
    overlap: float = 0.5,
) -> xr.DataArray:
    """Estimate frequency responses from a record over time, by averages over segments.

    Parameters
    ----------
    data : xarray.Dataset
        Signals over uniform ``time``, as :func:`read_measurement` gives them.
    inputs, outputs : sequence of str
        Columns of `data`. With several inputs their common part is taken apart, which asks for
        inputs that are not proportional to each other.
    method : {"H1", "H2", "Hv"}, optional
        Where the noise is: on the outputs (least error elsewhere), on the input (right at
        resonances, where the force drops), on both. The latter two take one input.
    segment : float, optional
        Length of a segment in s; an eighth of the record by default. Its inverse is the distance
        of the lines: a lightly damped mode needs several periods of its decay. For a periodic
        input take whole periods, window "boxcar" and no overlap: then nothing leaks.
    window : str, optional
        Name of a window of ``scipy.signal.get_window``.
    overlap : float, optional
        Share by which segments overlap, from 0 to 0.9.

    Returns
    -------
    xarray.DataArray
        As from :func:`read_frequency_response`, with coherence (the multiple one with several
        inputs) and the variance of the estimate. ``attrs["averages"]`` is the number of
        independent segments, ``attrs["sampling_time"]`` in s.

    Raises
    ------
    InvalidInputError
        If a column is missing, an input does not move, or there are too few segments.

    References
    ----------
    J. S. Bendat, A. G. Piersol, Random Data, 4th ed. (2010), sections 7.3 and 9.2; P. D. Welch,
    IEEE Trans. Audio Electroacoustics 15 (1967) 70-73, for segments that overlap; Hv: G. T.
    Rocklin, J. Crowley, H. Vold, Proc. 3rd Int. Modal Analysis Conf. (1985) 272-278.

    Examples
    --------
    >>> import numpy as np, xarray as xr
    >>> import robustpolish as rp
    >>> time = np.arange(20000) * 1e-3
    >>> force = np.random.default_rng(0).standard_normal(time.size)
    >>> data = xr.Dataset({"F": ("time", force, {"units": "N"}),
    ...                    "x": ("time", 0.5 * force, {"units": "m"})}, {"time": time})
    >>> response = rp.estimate_frequency_response(data, "F", "x")
    >>> bool(abs(response - 0.5).max() < 1e-12), response["units"].item()
    (True, 'm/N')
    """
    one_of("method", method, ("H1", "H2", "Hv"))
    names = [[n] if isinstance(n, str) else list(n) for n in (inputs, outputs)]
    u, y = (_columns(data, each) for each in names)
    if method != "H1" and len(u) > 1:
        shown = described(f"{len(u)} inputs for {method}")
        raise invalid("method", shown, "one input, or H1", "Choose H1.")
    dt = sampling_time(data)
    length = _length(data.sizes["time"], dt, segment)
    share = positive("overlap", overlap, zero=True)
    if share > 0.9:
        raise invalid("overlap", overlap, "a share of at most 0.9", "Choose 0.5.")
    step = length - round(share * length)
    averages = _independent(data.sizes["time"], length, step, window)
    least = len(u) + 2
    if averages < least:
        raise invalid(
            "segment",
            described(f"{length * dt:.4g} s, {averages:.1f} independent segments"),
            f"{least} or more of them",
            "Shorten the segments, or record for longer.",
        )

    welch = {
        "fs": 1 / dt, "window": window, "nperseg": length, "noverlap": length - step,
        "detrend": "constant",
    }  # fmt: skip

    def spectra(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return cross spectra without the mean's line, shape (lines, first, second)."""
        _, found = csd(second[None], first[:, None], **welch)
        return np.moveaxis(found, -1, 0)[1:]

    frequency = np.fft.rfftfreq(length, dt)[1:]
    Suu, Syu = spectra(u, u), spectra(y, u)
    Syy = np.real(csd(y, y, **welch)[1]).T[1:]
    H1 = np.linalg.solve(np.swapaxes(Suu, 1, 2), np.swapaxes(Syu, 1, 2)).swapaxes(1, 2)
    explained = np.real(np.sum(H1 * Syu.conj(), axis=2))
    coherence = np.clip(explained / Syy, 1e-12, 1.0)
    if method == "H2":
        H = H1 / coherence[..., None]
    elif method == "Hv":
        H = H1 / np.sqrt(coherence[..., None])
    else:
        H = H1
    # what is left of each output, over what each input has of its own
    left = Syy * (1 - coherence) / (averages - len(u))
    own = np.real(np.diagonal(np.linalg.inv(Suu), axis1=1, axis2=2))
    grown = np.abs(H / np.where(H1 == 0, 1.0, H1)) ** 2
    variance = left[..., None] * own[:, None] * grown
    units = [
        [
            ratio_unit(data[o].attrs.get("units", ""), data[i].attrs.get("units", ""))
            for i in names[0]
        ]
        for o in names[1]
    ]
    beside = {
        "coherence": np.broadcast_to(coherence[..., None], H.shape),
        "variance": variance,
    }
    notes = [
        f"{method} over {length * dt:.4g} s with a {window} window, {averages:.1f} averages",
        *data.attrs.get("notes", ()),
    ]
    return labelled_response(
        frequency, H, names[1], names[0], units, beside=beside, notes=notes,
        attributes={"averages": averages, "sampling_time": dt},
    )  # fmt: skip


def _columns(data: xr.Dataset, names: Sequence[str]) -> np.ndarray:
    """Return the columns as rows of an array."""
    rows = []
    for name in names:
        if name not in data:
            listed = ", ".join(map(str, data.data_vars)) or "none"
            raise invalid("data", described(f"no column {name!r}"), listed, "Check the names.")
        rows.append(np.asarray(data[name].values, dtype=float))
        if not np.isfinite(rows[-1]).all() or np.ptp(rows[-1]) == 0:
            shown = described("a constant, or no numbers")
            raise invalid(name, shown, "a signal that moves", "Read it with read_measurement.")
    return np.array(rows)


def _length(samples: int, dt: float, segment: float | None) -> int:
    """Return the samples of a segment."""
    if segment is None:
        return max(samples // _SEGMENTS, 8)
    length = round(positive("segment", segment, "s") / dt)
    if not 8 <= length <= samples:
        raise invalid(
            "segment",
            described(f"{segment:g} s, {length} samples"),
            f"8 to {samples} samples of {dt:.6g} s",
            "Choose an eighth of the record.",
        )
    return length


def _independent(samples: int, length: int, step: int, window: str) -> float:
    """Return the number of segments, those that overlap counted as fewer (Welch)."""
    segments = (samples - length) // step + 1
    shape = np.asarray(get_window(window, length), dtype=float)
    shares = [
        float(shape[k * step :] @ shape[: length - k * step]) ** 2
        for k in range(1, min(segments, -(-length // step)))
    ]
    weights = [1 - k / segments for k in range(1, len(shares) + 1)]
    power = float(shape @ shape) ** 2
    return segments / (1 + 2 * sum(w * s for w, s in zip(weights, shares, strict=True)) / power)
