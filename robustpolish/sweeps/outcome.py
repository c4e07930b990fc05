"""What a function returned at one point, as named arrays that a file holds bit for bit."""

from __future__ import annotations

import base64
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

RESULT = "result"
"""The variable of a function that returns a number or an array without a name."""

Named = dict[str, tuple[tuple[str, ...], np.ndarray]]


@dataclass(frozen=True)
class Outcome:
    """The result of a point, or why there is none.

    Attributes
    ----------
    values, coords : dict of str to (tuple of str, ndarray)
        Variables and their coordinates with their dimensions.
    failure : str
        The reason why the point has none; empty if it has.
    """

    values: Named = field(default_factory=dict)
    coords: Named = field(default_factory=dict)
    failure: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return what a line of JSON holds."""
        if self.failure:
            return {"failure": self.failure}
        return {"values": _written(self.values), "coords": _written(self.coords)}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Outcome:
        """Read what :meth:`to_json` wrote."""
        if "failure" in data:
            return cls(failure=data["failure"])
        return cls(_read(data["values"]), _read(data["coords"]))

    @property
    def form(self) -> tuple[Any, ...]:
        """Names, dimensions, shapes and coordinates, in which all points have to agree."""
        shapes = sorted((name, dims, array.shape) for name, (dims, array) in self.values.items())
        coords = sorted(
            (name, dims, array.dtype.str, array.tobytes())
            for name, (dims, array) in self.coords.items()
        )
        return (*shapes, *coords)


def outcome_of(returned: Any, taken: Collection[str]) -> Outcome:
    """Sort what a function returned into variables; `taken` are names that points have.

    Raises
    ------
    TypeError, ValueError
        If it is none of what a sweep can hold; the sweep records that as the point's failure.
    """
    values: Named = {}
    coords: Named = {}
    if isinstance(returned, xr.DataArray):
        returned = returned.to_dataset(name=str(returned.name or RESULT))
    if isinstance(returned, xr.Dataset):
        coords = {str(name): _labelled(name, returned[name]) for name in returned.coords}
        variables: Mapping[Any, Any] = {name: returned[name] for name in returned.data_vars}
    else:
        variables = returned if isinstance(returned, Mapping) else {RESULT: returned}
    for name, value in variables.items():
        if isinstance(value, xr.DataArray):
            values[str(name)] = _labelled(name, value)
        else:
            array = _array(name, value)
            values[str(name)] = (tuple(f"{name}_{i}" for i in range(array.ndim)), array)
    dims = {dim for held, _ in values.values() for dim in held}
    double = sorted((set(values) | set(coords) | dims) & set(taken))
    if double:
        raise ValueError(f"returned the name {double[0]!r}, which a parameter of the sweep has")
    return Outcome(values, coords)


def _labelled(name: Any, value: xr.DataArray) -> tuple[tuple[str, ...], np.ndarray]:
    return tuple(map(str, value.dims)), _array(name, value.values)


def _array(name: Any, value: Any) -> np.ndarray:
    array = np.asarray(value)
    if array.dtype.kind not in "biufcUmM":
        what = type(value).__name__
        raise TypeError(f"returned {what} as {name!r}; numbers, text and arrays can be kept")
    return np.ascontiguousarray(array).reshape(array.shape)


def _written(named: Named) -> dict[str, Any]:
    return {
        name: [
            list(dims),
            array.dtype.str,
            list(array.shape),
            base64.b64encode(array.tobytes()).decode("ascii"),
        ]
        for name, (dims, array) in named.items()
    }


def _read(data: Mapping[str, Any]) -> Named:
    return {
        name: (
            tuple(dims),
            np.frombuffer(base64.b64decode(text), np.dtype(kind)).reshape(shape)
            if text
            else np.empty(shape, np.dtype(kind)),
        )
        for name, (dims, kind, shape, text) in data.items()
    }
