"""Frequency responses in: from files, from objects, and estimated from time records."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import control
import numpy as np
import xarray as xr
from scipy.signal import csd, get_window

from robustpolish.base.checks import invalid, misfit, one_of, positive
from robustpolish.base.input_files import FileSpec, file_size
from robustpolish.base.results import tables
from robustpolish.errors import InvalidInputError
from robustpolish.signals import raw
from robustpolish.signals.read import TEXT, UNIVERSAL, read_frd, read_object
from robustpolish.signals.readers.csv import csv_headers, read_csv
from robustpolish.signals.readers.instruments import read_uff_responses, uff_holds_responses_only

# Frequency responses in tables: what the head of each column says.

_NAMES = tables(__file__)["frequency"]
_LETTER = "f"  # in lower case only: F is a force
_PART = {word: part for part, words in _NAMES["parts"].items() for word in words}
_WORDS = "|".join(sorted(_PART, key=len, reverse=True))
_BEHIND = re.compile(rf"^(?:(?P<pair>.*?)[\s_:]+)?(?P<part>{_WORDS})$", re.IGNORECASE)
_BEFORE = re.compile(rf"^(?P<part>{_WORDS})(?:[\s_:]+|\s*\()(?P<pair>.*?)\)?$", re.IGNORECASE)


def is_frequency(name: str) -> bool:
    """Return whether a column of this name, unit taken off, holds frequencies.

    Examples
    --------
    >>> is_frequency("Freq"), is_frequency("f"), is_frequency("F")
    (True, True, False)
    """
    text = name.strip()
    return text == _LETTER or text.casefold() in _NAMES["hertz"] + _NAMES["angular"]


def responses_of(table: raw.RawTable) -> list[raw.RawResponse]:
    """Sort the columns of a table into responses, coherences and variances.

    Parameters
    ----------
    table : RawTable
        One column of frequencies; of each pair the real and imaginary part, or magnitude and
        phase (in degrees unless the head says rad), or one complex column.

    Returns
    -------
    list of RawResponse

    Raises
    ------
    InvalidInputError
        If a column's head is not understood, or a part of a pair is missing.
    """
    table = _with_pairs(table)
    axis = next((name for name in table.columns if is_frequency(name)), None)
    if axis is None:
        listed = ", ".join(table.columns) or "none"
        shown, want = f"no such column among {listed}", "a column 'frequency [Hz]'"
        raise misfit("frequency", shown, want, "Name it so.")
    unit = table.units.get(axis, "") or ("rad/s" if axis.casefold() in _NAMES["angular"] else "Hz")
    if axis not in table.units and unit == "Hz" and axis.casefold() not in ("hz", "f"):
        table.notes.append(f"{axis} has no unit: read in Hz")
    frequency = raw.numeric(axis, table.columns[axis])
    pairs: dict[str, dict[str, str]] = {}
    for name in table.columns:
        if name != axis:
            pair, part = _meaning(name, np.asarray(table.columns[name]).dtype.kind == "c")
            pairs.setdefault(pair, {})[part] = name
    found = []
    for pair, parts in pairs.items():
        output, _, source = (end.strip() for end in pair.partition("/"))
        ends = (output or "output", source or "input", frequency)
        values, of = _joined(pair, parts, table)
        found.append(raw.RawResponse(*ends, values, of, frequency_unit=unit))
        for kind in ("coherence", "variance"):
            if kind in parts:
                curve = raw.numeric(parts[kind], table.columns[parts[kind]])
                found.append(raw.RawResponse(*ends, curve, kind=kind, frequency_unit=unit))
    return found


def _with_pairs(table: raw.RawTable) -> raw.RawTable:
    """Return the table with strokes as those of pairs: x/V is a response, not x in volts."""
    heads = {name: header for header, name in table.headers.items()}
    whole = raw.RawTable(notes=table.notes)
    for name, values in table.columns.items():
        head, unit = heads.get(name, name), table.units.get(name)
        pair, _ = raw.split_header(head)
        if pair != name and not is_frequency(name) and name.casefold() not in _PART:
            # a line of units may have said more than the stroke
            unit = None if unit == raw.split_header(head, fraction=True)[1] else unit
            whole.add(head, values, unit)
        else:
            whole.add(name, values, unit)
    return whole


def _meaning(name: str, is_complex: bool) -> tuple[str, str]:
    """Return the pair that a column belongs to, and what part of it the column is."""
    text = name.strip()
    if is_complex:
        return text, "complex"
    if bars := re.match(r"^\|(?P<pair>.+)\|$", text):
        return bars["pair"].strip(), "magnitude"
    found = _BEHIND.match(text) or _BEFORE.match(text)
    if not found:
        want = (
            "a head such as 'x/F real [m/N]', 'x/F imag [m/N]', 'x/F magnitude [m/N]', "
            "'x/F phase [deg]' or 'x/F coherence'"
        )
        raise invalid("column", name, want, "Rename the column.")
    return (found["pair"] or "").strip(), _PART[found["part"].casefold()]


def _joined(pair: str, parts: dict[str, str], table: raw.RawTable) -> tuple[np.ndarray, str]:
    """Return the complex values of a pair, and their unit."""
    units = {part: table.units.get(name, "") for part, name in parts.items()}
    if "complex" in parts:
        return np.asarray(table.columns[parts["complex"]], dtype=complex), units["complex"]
    columns = {part: raw.numeric(name, table.columns[name]) for part, name in parts.items()}
    if {"real", "imag"} <= set(parts):
        imag = columns["imag"]
        if units["imag"] and units["imag"] != units["real"]:
            scale = (
                raw.to_si(np.ones(1), units["imag"])[0] / raw.to_si(np.ones(1), units["real"])[0]
            )
            imag = imag * scale
        return columns["real"] + 1j * imag, units["real"]
    if {"magnitude", "phase"} <= set(parts):
        size, unit = columns["magnitude"], units["magnitude"]
        if not unit:
            unit = "dB" if (size < 0).any() else ""  # no ratio is below 0
            table.notes.append(f"{parts['magnitude']} has no unit: read as {unit or 'a ratio'}")
        if decibels := re.match(r"^dB(?:\s+re)?\s*(?:1\s)?\s*(.*)$", unit):
            size, unit = 10 ** (size / 20), decibels[1].strip("() ")
        if not units["phase"]:
            table.notes.append(f"{parts['phase']} has no unit: read in degrees")
        angle, _ = raw.to_si(
            columns["phase"], units["phase"] or "deg", f"unit of {parts['phase']!r}"
        )
        return size * np.exp(1j * angle), unit
    shown, want = ", ".join(parts.values()), "real and imaginary part, or magnitude and phase"
    remedy = "Export the missing one: a magnitude alone does not say enough."
    raise misfit(pair or "frequency response", f"the columns {shown}", want, remedy)


# The currency of frequency responses: one labelled array over frequency, output and input.

DIMENSIONS = ("frequency", "output", "input")
COHERENCE, VARIANCE = "coherence", "variance"


def ratio_unit(output: str, input: str) -> str:
    """Return the unit of a response from the units of its output and input.

    Parameters
    ----------
    output, input : str

    Returns
    -------
    str
        Empty if one of them is not known.

    Examples
    --------
    >>> ratio_unit("m/s^2", "N"), ratio_unit("rad", "N m"), ratio_unit("m", "m")
    ('m/s^2/N', 'rad/(N m)', '1')
    """
    if not output or not input:
        return ""
    if output == input:
        return "1"
    below = f"({input})" if set(input) & set(" */") else input
    return f"{output}/{below}" if output != "1" else f"1/{below}"


def labelled_response(
    frequency: Any,
    values: Any,
    outputs: Sequence[str],
    inputs: Sequence[str],
    units: Any = "",
    *,
    beside: Mapping[str, Any] | None = None,
    notes: Sequence[str] = (),
    attributes: Mapping[str, Any] | None = None,
) -> xr.DataArray:
    """Return a frequency response as the labelled array that the package trades in.

    Parameters
    ----------
    frequency : array_like, shape (lines,)
        In Hz.
    values : array_like, shape (lines, outputs, inputs)
        Complex; NaN where nothing was measured.
    outputs, inputs : sequence of str
    units : str or array_like of str, shape (outputs, inputs), optional
    beside : mapping of str to array_like, optional
        ``"variance"`` and ``"coherence"``, of the shape of `values`.
    notes : sequence of str, optional
    attributes : mapping of str to object, optional
        Further attributes, such as ``sampling_time`` in s.

    Returns
    -------
    xarray.DataArray

    Examples
    --------
    >>> array = labelled_response([1.0, 2.0], [[[3j]], [[4.0]]], ["x"], ["F"], "m/N")
    >>> array.dims, array["units"].item()
    (('frequency', 'output', 'input'), 'm/N')
    """
    units = np.broadcast_to(np.asarray(units, dtype=str), (len(outputs), len(inputs)))
    coords: dict[str, Any] = {
        "frequency": ("frequency", np.asarray(frequency, dtype=float), {"units": "Hz"}),
        "output": list(outputs),
        "input": list(inputs),
        "units": (("output", "input"), units),
    }
    for name, curve in (beside or {}).items():
        coords[name] = (DIMENSIONS, np.asarray(curve, dtype=float))
    attrs = {**(attributes or {}), "notes": list(notes)}
    return xr.DataArray(np.asarray(values, dtype=complex), coords, DIMENSIONS, "response", attrs)


def checked_response(data: xr.DataArray) -> xr.DataArray:
    """Return a labelled array with all that the package expects of a frequency response.

    Parameters
    ----------
    data : xarray.DataArray
        Over ``frequency``; output and input may be dimensions, or labels of a single pair.

    Returns
    -------
    xarray.DataArray
        Over (frequency, output, input), frequencies rising, units ("" if unknown) beside it.

    Raises
    ------
    InvalidInputError
        If a dimension or name is missing, or numbers are not what they have to be.
    """
    shown = f"an array over {', '.join(map(str, data.dims))}"
    for name in ("output", "input"):
        if name not in data.coords:
            want = "the dimensions frequency, output and input, with names"
            remedy = "Read it with read_frequency_response."
            raise misfit("frequency response", f"{shown} without {name!r}", want, remedy)
        if name not in data.dims:
            data = data.expand_dims(name)
    if set(data.dims) != set(DIMENSIONS) or "frequency" not in data.coords:
        shown, want = f"an array over {', '.join(map(str, data.dims))}", ", ".join(DIMENSIONS[:2])
        raise misfit("frequency response", shown, f"{want} and input", "Select one of the others.")
    data = data.transpose(*DIMENSIONS).sortby("frequency")
    # expand_dims leaves what lies beside the array without the new dimension
    beside = {
        name: data.coords[name].broadcast_like(data).transpose(*DIMENSIONS).values
        for name in (COHERENCE, VARIANCE)
        if name in data.coords
    }
    units: Any = ""
    if "units" in data.coords:
        like = data.isel(frequency=0, drop=True)
        units = data.coords["units"].broadcast_like(like).transpose("output", "input").values
    outputs, inputs = (
        [str(name) for name in data[dimension].values] for dimension in DIMENSIONS[1:]
    )
    for dimension, own in zip(DIMENSIONS[1:], (outputs, inputs), strict=True):
        if len(set(own)) < len(own):
            raise misfit(dimension, ", ".join(own), "each name once", "Rename one.")
    result = labelled_response(
        data["frequency"].values,
        data.values,
        outputs,
        inputs,
        units,
        beside=beside,
        notes=data.attrs.get("notes", ()),
        attributes={str(name): value for name, value in data.attrs.items()},
    )
    _check_numbers(result)
    return result


def _check_numbers(data: xr.DataArray) -> None:
    frequency, what = data["frequency"].values, "frequency response"
    twice = np.flatnonzero(np.diff(frequency) == 0)
    if frequency.size < 3:
        raise misfit(what, f"{frequency.size} lines", "three or more", "Measure more frequencies.")
    if not np.isfinite(frequency).all() or frequency[0] < 0:
        raise misfit("frequency", "negative or no numbers", "Hz from 0", "Leave them out.")
    if twice.size:
        shown = f"{frequency[twice[0]]:g} Hz twice"
        remedy = "Read runs at several amplitudes as several responses."
        raise misfit("frequency", shown, "each frequency once", remedy)
    if np.isinf(data.values).any():
        raise misfit(what, "infinite numbers", "finite ones", "Leave them out.")
    empty = np.isfinite(data.values).any(axis=0) & ~np.nan_to_num(data.values).any(axis=0)
    for k, j in np.argwhere(empty):
        pair = f"{data['output'].values[k]}/{data['input'].values[j]}"
        raise misfit(pair, "zero at every frequency", "a response", "Check sensor and channel.")


# Frequency responses estimated from time records.

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
    sources, ends = ([n] if isinstance(n, str) else list(n) for n in (inputs, outputs))
    u, y = (_columns(data, each) for each in (sources, ends))
    if method != "H1" and len(u) > 1:
        raise misfit("method", f"{len(u)} inputs for {method}", "one input, or H1", "Choose H1.")
    samples, dt = data.sizes["time"], raw.sampling_time(data)
    length = max(samples // _SEGMENTS, 8)
    if segment is not None:
        length = round(positive("segment", segment, "s") / dt)
        if not 8 <= length <= samples:
            shown, remedy = f"{segment:g} s, {length} samples", "Choose an eighth of the record."
            raise misfit("segment", shown, f"8 to {samples} samples of {dt:.6g} s", remedy)
    share = positive("overlap", overlap, zero=True)
    if share > 0.9:
        raise invalid("overlap", overlap, "a share of at most 0.9", "Choose 0.5.")
    step = length - round(share * length)
    averages, least = _independent(samples, length, step, window), len(u) + 2
    if averages < least:
        shown = f"{length * dt:.4g} s, {averages:.1f} independent segments"
        remedy = "Shorten the segments, or record for longer."
        raise misfit("segment", shown, f"{least} or more of them", remedy)
    welch: Any = {
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
    kept = {"H1": np.ones_like(coherence), "H2": coherence, "Hv": np.sqrt(coherence)}[method]
    H = H1 / kept[..., None]
    # what is left of each output, over what each input has of its own
    left = Syy * (1 - coherence) / (averages - len(u))
    own = np.real(np.diagonal(np.linalg.inv(Suu), axis1=1, axis2=2))
    grown = np.abs(H / np.where(H1 == 0, 1.0, H1)) ** 2
    unit = {name: data[name].attrs.get("units", "") for name in (*sources, *ends)}
    beside = {
        COHERENCE: np.broadcast_to(coherence[..., None], H.shape),
        VARIANCE: left[..., None] * own[:, None] * grown,
    }
    note = f"{method} over {length * dt:.4g} s with a {window} window, {averages:.1f} averages"
    units = [[ratio_unit(unit[o], unit[i]) for i in sources] for o in ends]
    return labelled_response(
        frequency, H, ends, sources, units, beside=beside,
        notes=[note, *data.attrs.get("notes", ())],
        attributes={"averages": averages, "sampling_time": dt},
    )  # fmt: skip


def _columns(data: xr.Dataset, names: Sequence[str]) -> np.ndarray:
    """Return the columns as rows of an array."""
    rows = []
    for name in names:
        if name not in data:
            listed = ", ".join(map(str, data.data_vars)) or "none"
            raise misfit("data", f"no column {name!r}", listed, "Check the names.")
        rows.append(np.asarray(data[name].values, dtype=float))
        if not np.isfinite(rows[-1]).all() or np.ptp(rows[-1]) == 0:
            shown, remedy = "a constant, or no numbers", "Read it with read_measurement."
            raise misfit(name, shown, "a signal that moves", remedy)
    return np.array(rows)


def _independent(samples: int, length: int, step: int, window: str) -> float:
    """Return the number of segments, those that overlap counted as fewer (Welch)."""
    segments = (samples - length) // step + 1
    shape = np.asarray(get_window(window, length), dtype=float)
    lags = range(1, min(segments, -(-length // step)))
    shared = [float(shape[k * step :] @ shape[: length - k * step]) ** 2 for k in lags]
    total = sum((1 - k / segments) * s for k, s in zip(lags, shared, strict=True))
    return segments / (1 + 2 * total / float(shape @ shape) ** 2)


# Frequency responses from files and objects, checked, in SI units.

_FILE = FileSpec("frequency response", "a file", "Check the path.", raw.RECORD.largest)

Names = Sequence[str] | Mapping[str, str]


def read_frequency_response(
    source: Any,
    *,
    outputs: Names | None = None,
    inputs: Names | None = None,
    units: str | Mapping[str, str] | None = None,
    max_bytes: float | None = None,
) -> xr.DataArray:
    """Read measured frequency responses, check them, and convert them to SI units.

    Parameters
    ----------
    source : path, control.FrequencyResponseData, pandas.DataFrame or xarray.DataArray
        A universal file (data sets 58 with frequency responses and coherences; needs the extra
        ``[io]``), or a table with the head ``frequency [Hz]``, ``x/F real [m/N]``,
        ``x/F imag [m/N]`` (or ``magnitude [m/N]`` and ``phase [deg]``; ``dB`` and ``rad`` are
        understood), if wanted ``x/F coherence`` and ``x/F variance``.
    outputs, inputs : sequence of str or mapping of str to str, optional
        Names as in the model, in the order of the file, or by the names in the file. A universal
        file calls them ``node_3_z`` unless it has names of its own.
    units : str or mapping of str to str, optional
        Unit of all responses, or by pair (``{"x/F": "um/N"}``) where the file has none.
    max_bytes : float, optional
        Largest size of a file in bytes, 1e9 by default.

    Returns
    -------
    xarray.DataArray
        Complex, over ``frequency`` in Hz, ``output`` and ``input``; NaN where nothing was
        measured. Beside it stand ``units`` of each pair, and ``coherence`` and ``variance``
        (E abs(H - E H)^2, in the square of the unit) where they are known.

    Raises
    ------
    InvalidInputError
        If the source is missing, damaged or holds no frequency response; if a name or unit is
        unknown; if curves have different frequencies.
    MissingDependencyError
        If the format needs the extra ``[io]``.

    Notes
    -----
    Whether a response is a receptance, mobility or accelerance follows from its unit; a model
    is held against it by the quantity of its output. Units: D. J. Ewins, Modal Testing (2000),
    section 2.1; data set 58: SDRC, I-DEAS Test Universal File Format.

    Examples
    --------
    >>> import pandas as pd
    >>> import robustpolish as rp
    >>> table = pd.DataFrame({
    ...     "frequency [Hz]": [1.0, 2.0, 3.0],
    ...     "x/F magnitude [um/N]": [2.0, 4.0, 1.0],
    ...     "x/F phase [deg]": [0.0, -90.0, -180.0]})
    >>> response = rp.read_frequency_response(table)
    >>> complex(response.sel(output="x", input="F")[1].round(9)), str(response["units"].item())
    (-4e-06j, 'm/N')
    """
    if isinstance(source, xr.DataArray):
        array = checked_response(source)
        for dimension, names in (("output", outputs), ("input", inputs)):
            known = [str(name) for name in array[dimension].values]
            renames = _renames(f"{dimension}s", known, names)
            array = array.assign_coords({dimension: [renames[name] for name in known]})
        return array
    curves, notes = _curves(source, max_bytes)
    if not any(curve.kind == "response" for curve in curves):
        raise _nothing(source)
    out = _renames("outputs", list(dict.fromkeys(c.output for c in curves)), outputs)
    into = _renames("inputs", list(dict.fromkeys(c.input for c in curves)), inputs)
    curves = [replace(c, output=out[c.output], input=into[c.input]) for c in curves]
    array = _assembled(curves, units)
    array.attrs["notes"] += notes
    if isinstance(source, str | Path):
        array.attrs["source"] = str(source)
    return checked_response(array)


def holds_frequency_response(source: Any) -> bool:
    """Return whether a source is a frequency response rather than a record over time.

    Parameters
    ----------
    source : object
        A path, or what functions that compare or fit are given.

    Returns
    -------
    bool
        False for files with both, whose records say more, and for anything unknown.

    Examples
    --------
    >>> import control
    >>> holds_frequency_response(control.frd([1, 2, 3], [1.0, 2.0, 3.0]))
    True
    """
    if isinstance(source, control.FrequencyResponseData):
        return True
    if isinstance(source, xr.DataArray):
        return "frequency" in source.dims
    if not isinstance(source, str | Path):
        return False
    path = Path(source)
    suffix = path.suffix.casefold()
    try:
        file_size(path, _FILE)
        heads = csv_headers(path) if suffix in TEXT else ()
    except (InvalidInputError, OSError):  # whoever reads it will say what is wrong
        return False
    if suffix in UNIVERSAL:
        return uff_holds_responses_only(path)
    # The head of a text table names frequencies first, and no time.
    names = [raw.split_header(head, fraction=True)[0] for head in heads]
    named = [name for name in names if not raw.is_count(name)]
    return len(named) > 1 and is_frequency(named[0]) and not any(map(raw.is_time, named))


def _curves(source: Any, max_bytes: float | None) -> tuple[list[raw.RawResponse], list[str]]:
    if (found := read_frd(source)) is not None:
        return found, []
    if (table := read_object(source)) is not None:
        return responses_of(table), table.notes
    if not isinstance(source, str | Path):
        raise _nothing(source)
    path, wanted = Path(source), _FILE.limited(max_bytes)
    if file_size(path, wanted) == 0:
        raise wanted.refused(path, "empty")
    suffix = path.suffix.casefold()
    if suffix in UNIVERSAL:
        return read_uff_responses(path, wanted), []
    if suffix in TEXT:
        table = read_csv(path, wanted)
        return responses_of(table), table.notes
    known = ", ".join((*TEXT, *UNIVERSAL))
    raise invalid("frequency response", path.name, f"one of the suffixes {known}", "Convert it.")


def _nothing(source: Any) -> Exception:
    shown = str(source) if isinstance(source, str | Path) else type(source).__name__
    want = "a file or object with frequency responses"
    remedy = "Estimate them from a time record with estimate_frequency_response."
    return misfit("frequency response", shown, want, remedy)


def _renames(argument: str, known: list[str], names: Names | None) -> dict[str, str]:
    names = {} if names is None else [names] if isinstance(names, str) else names
    if isinstance(names, Mapping):
        for name in names:
            if name not in known:
                raise invalid(argument, name, f"one of {', '.join(known)}", "Check the file.")
        return {name: str(names.get(name, name)) for name in known}
    if len(names) != len(known):
        shown = f"{len(names)} names for {', '.join(known)}"
        raise misfit(argument, shown, f"{len(known)} names", "Name each, in this order.")
    return dict(zip(known, map(str, names), strict=True))


def _assembled(
    curves: list[raw.RawResponse], units: str | Mapping[str, str] | None
) -> xr.DataArray:
    """Put the curves into one array over frequency, output and input."""
    first, what = _hertz(curves[0]), "frequency response"
    if not first.size:
        raise misfit(what, "no frequencies", "one or more", "Check that the file is whole.")
    outputs = list(dict.fromkeys(c.output for c in curves))
    inputs = list(dict.fromkeys(c.input for c in curves))
    size = (first.size, len(outputs), len(inputs))
    layers: dict[str, np.ndarray] = {"response": np.full(size, np.nan, dtype=complex)}
    names, factors = np.full(size[1:], "", dtype=object), np.ones(size[1:])
    seen: set[tuple[str, str]] = set()
    given = {} if units is None or isinstance(units, str) else dict(units)
    for pair in set(given) - {f"{c.output}/{c.input}" for c in curves}:
        raise invalid("units", pair, "a pair of the file, as in 'x/F'", "Check the names.")
    for curve in curves:
        frequency, pair = _hertz(curve), f"{curve.output}/{curve.input}"
        if curve.values.shape != frequency.shape:
            shown = f"{pair} with {curve.values.size} values"
            want = f"one for each of the {frequency.size} frequencies"
            raise misfit(what, shown, want, "Check that the file is whole.")
        if frequency.shape != first.shape or not np.allclose(frequency, first, rtol=1e-6):
            shown = f"{pair} over other frequencies than the first curve"
            raise misfit("frequency", shown, "one axis for all", "Export them together.")
        if (pair, curve.kind) in seen:
            raise misfit(what, f"{pair} twice", "each pair once", "Split the file.")
        seen.add((pair, curve.kind))
        k, j = outputs.index(curve.output), inputs.index(curve.input)
        layers.setdefault(curve.kind, np.full(size, np.nan))[:, k, j] = curve.values
        if curve.kind == "response":
            unit = units if isinstance(units, str) else given.get(pair, curve.unit)
            factor, names[k, j] = raw.to_si(np.ones(1), unit, f"unit of {pair!r}")
            factors[k, j] = factor[0]
    values = layers.pop("response") * factors
    if VARIANCE in layers:
        layers[VARIANCE] = layers[VARIANCE] * factors**2
    return labelled_response(first, values, outputs, inputs, names, beside=layers)


def _hertz(curve: raw.RawResponse) -> np.ndarray:
    what, frequency = "unit of the frequency", np.asarray(curve.frequency, dtype=float)
    values, unit = raw.to_si(frequency, curve.frequency_unit, what)
    if unit not in ("Hz", "rad/s"):
        raise invalid(what, unit, "Hz or rad/s", "Correct the header.")
    return values / (2 * np.pi) if unit == "rad/s" else values
