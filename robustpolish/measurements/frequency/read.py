"""Frequency responses from files and objects, checked, in SI units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import control
import numpy as np
import xarray as xr

from robustpolish.errors import InvalidInputError
from robustpolish.files import Wanted, size_of
from robustpolish.measurements import readers
from robustpolish.measurements.frequency.columns import is_frequency, responses_of
from robustpolish.measurements.frequency.response import checked_response, labelled_response
from robustpolish.measurements.headers import is_count, is_time, split_header
from robustpolish.measurements.raw import RECORD
from robustpolish.measurements.raw_response import RawResponse
from robustpolish.measurements.sources import TEXT, UNIVERSAL
from robustpolish.measurements.units import to_si
from robustpolish.validation import described, invalid

_FILE = Wanted("frequency response", "a file", "Check the path.", RECORD.largest)

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
        return _renamed(checked_response(source), outputs, inputs)
    curves = _curves(source, max_bytes)
    if not any(curve.kind == "response" for curve in curves):
        raise _nothing(source)
    array = _assembled(_named(curves, outputs, inputs), units)
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
    try:
        size_of(path, _FILE)
    except InvalidInputError:  # whoever reads it will say what is wrong
        return False
    if path.suffix.casefold() in TEXT:
        return _begins_with_frequency(path)
    if path.suffix.casefold() in UNIVERSAL:
        return readers.uff_holds_responses_only(path)
    return False


def _curves(source: Any, max_bytes: float | None) -> list[RawResponse]:
    found = readers.read_frd(source)
    if found is not None:
        return found
    table = readers.read_object(source)
    if table is not None:
        return responses_of(table)
    if not isinstance(source, str | Path):
        raise _nothing(source)
    path = Path(source)
    wanted = _FILE.limited(max_bytes)
    if size_of(path, wanted) == 0:
        raise wanted.refused(path, "empty")
    suffix = path.suffix.casefold()
    if suffix in UNIVERSAL:
        return readers.read_uff_responses(path, wanted)
    if suffix in TEXT:
        return responses_of(readers.read_csv(path, wanted))
    known = ", ".join((*TEXT, *UNIVERSAL))
    raise invalid("frequency response", path.name, f"one of the suffixes {known}", "Convert it.")


def _nothing(source: Any) -> Exception:
    shown = str(source) if isinstance(source, str | Path) else type(source).__name__
    return invalid(
        "frequency response",
        described(shown),
        "a file or object with frequency responses",
        "Estimate them from a time record with estimate_frequency_response.",
    )


def _begins_with_frequency(path: Path) -> bool:
    """Return whether the head of a text table names frequencies first, and no time."""
    try:
        heads = readers.csv_headers(path)
    except (InvalidInputError, OSError):  # whoever reads it will say what is wrong
        return False
    names = [split_header(head, fraction=True)[0] for head in heads]
    named = [name for name in names if not is_count(name)]
    return len(named) > 1 and is_frequency(named[0]) and not any(map(is_time, named))


def _renamed(array: xr.DataArray, outputs: Names | None, inputs: Names | None) -> xr.DataArray:
    for dimension, names in (("output", outputs), ("input", inputs)):
        known = [str(name) for name in array[dimension].values]
        renames = _renames(f"{dimension}s", known, names)
        array = array.assign_coords({dimension: [renames[name] for name in known]})
    return array


def _named(
    curves: list[RawResponse], outputs: Names | None, inputs: Names | None
) -> list[RawResponse]:
    """Return the curves with the names that were asked for."""
    by_output = _renames("outputs", list(dict.fromkeys(c.output for c in curves)), outputs)
    by_input = _renames("inputs", list(dict.fromkeys(c.input for c in curves)), inputs)
    return [replace(c, output=by_output[c.output], input=by_input[c.input]) for c in curves]


def _renames(argument: str, known: list[str], names: Names | None) -> dict[str, str]:
    if names is None:
        return {name: name for name in known}
    if isinstance(names, Mapping):
        unknown = [name for name in names if name not in known]
        if unknown:
            listed = ", ".join(known)
            raise invalid(argument, unknown[0], f"one of {listed}", "Check the file.")
        return {name: str(names.get(name, name)) for name in known}
    given = [names] if isinstance(names, str) else [str(name) for name in names]
    if len(given) != len(known):
        shown = described(f"{len(given)} names for {', '.join(known)}")
        raise invalid(argument, shown, f"{len(known)} names", "Name each, in this order.")
    return dict(zip(known, given, strict=True))


def _assembled(curves: list[RawResponse], units: str | Mapping[str, str] | None) -> xr.DataArray:
    """Put the curves into one array over frequency, output and input."""
    first = _hertz(curves[0])
    if not first.size:
        shown = described("no frequencies")
        raise invalid("frequency response", shown, "one or more", "Check that the file is whole.")
    outputs = list(dict.fromkeys(c.output for c in curves))
    inputs = list(dict.fromkeys(c.input for c in curves))
    size = (first.size, len(outputs), len(inputs))
    layers: dict[str, np.ndarray] = {"response": np.full(size, np.nan, dtype=complex)}
    names = np.full(size[1:], "", dtype=object)
    factors = np.ones(size[1:])
    seen: set[tuple[str, str]] = set()
    given = {} if units is None or isinstance(units, str) else dict(units)
    for pair in set(given) - {f"{c.output}/{c.input}" for c in curves}:
        raise invalid("units", pair, "a pair of the file, as in 'x/F'", "Check the names.")
    for curve in curves:
        frequency, pair = _hertz(curve), f"{curve.output}/{curve.input}"
        if curve.values.shape != frequency.shape:
            shown = described(f"{pair} with {curve.values.size} values")
            want = f"one for each of the {frequency.size} frequencies"
            raise invalid("frequency response", shown, want, "Check that the file is whole.")
        if frequency.shape != first.shape or not np.allclose(frequency, first, rtol=1e-6):
            shown = described(f"{pair} over other frequencies than the first curve")
            raise invalid("frequency", shown, "one axis for all", "Export them together.")
        if (pair, curve.kind) in seen:
            shown = described(f"{pair} twice")
            raise invalid("frequency response", shown, "each pair once", "Split the file.")
        seen.add((pair, curve.kind))
        k, j = outputs.index(curve.output), inputs.index(curve.input)
        layer = layers.setdefault(curve.kind, np.full(size, np.nan))
        layer[:, k, j] = curve.values
        if curve.kind == "response":
            unit = units if isinstance(units, str) else given.get(pair, curve.unit)
            factor, names[k, j] = to_si(np.ones(1), unit, f"unit of {pair!r}")
            factors[k, j] = factor[0]
    values = layers.pop("response") * factors
    if "variance" in layers:
        layers["variance"] = layers["variance"] * factors**2
    return labelled_response(first, values, outputs, inputs, names, beside=layers)


def _hertz(curve: RawResponse) -> np.ndarray:
    values, unit = to_si(
        np.asarray(curve.frequency, dtype=float), curve.frequency_unit, "unit of the frequency"
    )
    if unit not in ("Hz", "rad/s"):
        raise invalid("unit of the frequency", unit, "Hz or rad/s", "Correct the header.")
    return values / (2 * np.pi) if unit == "rad/s" else values
