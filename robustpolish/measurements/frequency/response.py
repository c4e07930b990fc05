"""The currency of frequency responses: one labelled array over frequency, output and input."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from robustpolish.validation import described, invalid

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
    shape = (len(outputs), len(inputs))
    coords: dict[str, Any] = {
        "frequency": ("frequency", np.asarray(frequency, dtype=float), {"units": "Hz"}),
        "output": list(outputs),
        "input": list(inputs),
        "units": (("output", "input"), np.broadcast_to(np.asarray(units, dtype=str), shape)),
    }
    for name, curve in (beside or {}).items():
        coords[name] = (DIMENSIONS, np.asarray(curve, dtype=float))
    array = np.asarray(values, dtype=complex)
    attrs = {**(attributes or {}), "notes": list(notes)}
    return xr.DataArray(array, coords, DIMENSIONS, "response", attrs)


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
    for name in ("output", "input"):
        if name not in data.coords:
            raise invalid(
                "frequency response",
                described(f"an array over {', '.join(map(str, data.dims))} without {name!r}"),
                "the dimensions frequency, output and input, with names",
                "Read it with read_frequency_response.",
            )
        if name not in data.dims:
            data = data.expand_dims(name)
    if set(data.dims) != set(DIMENSIONS) or "frequency" not in data.coords:
        shown = described(f"an array over {', '.join(map(str, data.dims))}")
        raise invalid(
            "frequency response", shown, "frequency, output and input", "Select one of the others."
        )
    # expand_dims leaves what lies beside the array without the new dimension
    beside = {
        name: data.coords[name].broadcast_like(data).transpose(*DIMENSIONS).values
        for name in (COHERENCE, VARIANCE)
        if name in data.coords
    }
    data = data.transpose(*DIMENSIONS)
    units: Any = ""
    if "units" in data.coords:
        like = data.isel(frequency=0, drop=True)
        units = data.coords["units"].broadcast_like(like).transpose("output", "input").values
    order = np.argsort(data["frequency"].values, kind="stable")
    result = labelled_response(
        data["frequency"].values[order],
        data.values[order],
        _names(data, "output"),
        _names(data, "input"),
        units,
        beside={name: curve[order] for name, curve in beside.items()},
        notes=data.attrs.get("notes", ()),
        attributes={str(name): value for name, value in data.attrs.items()},
    )
    _check_numbers(result)
    return result


def _names(data: xr.DataArray, dimension: str) -> list[str]:
    names = [str(name) for name in data[dimension].values]
    if len(set(names)) < len(names):
        raise invalid(dimension, described(", ".join(names)), "each name once", "Rename one.")
    return names


def _check_numbers(data: xr.DataArray) -> None:
    frequency = data["frequency"].values
    if frequency.size < 3:
        shown = described(f"{frequency.size} lines")
        raise invalid("frequency response", shown, "three or more", "Measure more frequencies.")
    if not np.isfinite(frequency).all() or frequency[0] < 0:
        raise invalid(
            "frequency", described("negative or no numbers"), "Hz from 0", "Leave them out."
        )
    twice = np.flatnonzero(np.diff(frequency) == 0)
    if twice.size:
        raise invalid(
            "frequency",
            described(f"{frequency[twice[0]]:g} Hz twice"),
            "each frequency once",
            "Read runs at several amplitudes as several responses.",
        )
    if np.isinf(data.values).any():
        raise invalid(
            "frequency response", described("infinite numbers"), "finite ones", "Leave them out."
        )
    for k, output in enumerate(data["output"].values):
        for j, source in enumerate(data["input"].values):
            curve = data.values[:, k, j]
            if np.isfinite(curve).any() and not np.nan_to_num(curve).any():
                shown = described("zero at every frequency")
                raise invalid(
                    f"{output}/{source}", shown, "a response", "Check sensor and channel."
                )
