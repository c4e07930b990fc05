"""The points of a sweep: every combination of a grid's values, or samples one by one."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from robustpolish.validation import invalid

SAMPLE = "sample"
FAILURE = "failure"


@dataclass(frozen=True)
class Points:
    """Points in their order, the last name of a grid fastest.

    Attributes
    ----------
    each : list of dict
        The arguments of every point, as numbers, truth values and text of Python.
    dims : tuple of str
        The dimensions that the points span.
    shape : tuple of int
        Their lengths.
    coords : dict of str to (tuple of str, ndarray)
        The parameters over these dimensions.
    """

    each: list[dict[str, Any]]
    dims: tuple[str, ...]
    shape: tuple[int, ...]
    coords: dict[str, tuple[tuple[str, ...], np.ndarray]]

    @property
    def text(self) -> str:
        """All of it as text, every number to the last bit, for a checksum."""
        return json.dumps([self.dims, self.shape, self.each])


def read_points(points: Any) -> Points:
    """Read a grid (mapping of names to values) or samples (mappings, or a Dataset)."""
    if isinstance(points, xr.Dataset):
        return _from_dataset(points)
    if isinstance(points, Mapping):
        return _from_grid(points)
    if isinstance(points, Sequence) and not isinstance(points, str) and len(points) > 0:
        return _from_samples(points)
    expected = "a mapping of names to values, a sequence of mappings or a Dataset, not empty"
    raise invalid("points", points, expected, 'Write {"gain": [1, 2, 3]}, for example.')


def _from_grid(grid: Mapping[str, Any]) -> Points:
    if not grid:
        raise invalid("points", grid, "at least one name", 'Write {"gain": [1, 2, 3]}.')
    values = {name: _column(name, grid[name]) for name in grid}
    lists = [column.tolist() for column in values.values()]
    each = [dict(zip(values, point, strict=True)) for point in itertools.product(*lists)]
    coords = {name: ((name,), column) for name, column in values.items()}
    return Points(each, tuple(values), tuple(len(column) for column in lists), coords)


def _from_samples(samples: Sequence[Any]) -> Points:
    for i, sample in enumerate(samples):
        if not isinstance(sample, Mapping) or set(sample) != set(samples[0]):
            remedy = "Give every sample a value of every parameter."
            raise invalid(("points", i), sample, "a mapping with the first one's names", remedy)
    if not samples[0]:
        raise invalid("points", samples, "at least one name", 'Write [{"gain": 1.0}].')
    return _of_columns({name: [sample[name] for sample in samples] for name in samples[0]})


def _from_dataset(samples: xr.Dataset) -> Points:
    if len(samples.dims) != 1 or not samples.data_vars:
        remedy = "Give each parameter as a variable over one dimension, the sample."
        raise invalid("points", dict(samples.sizes), "a Dataset with one dimension", remedy)
    (size,) = samples.sizes.values()
    columns = {str(name): np.broadcast_to(samples[name], (size,)) for name in samples.data_vars}
    return _of_columns(columns)


def _of_columns(values: Mapping[str, Any]) -> Points:
    columns = {name: _column(name, values[name], (SAMPLE,)) for name in values}
    lists = [column.tolist() for column in columns.values()]
    each = [dict(zip(columns, point, strict=True)) for point in zip(*lists, strict=True)]
    coords = {name: ((SAMPLE,), column) for name, column in columns.items()}
    return Points(each, (SAMPLE,), (len(each),), coords)


def _column(name: Any, values: Any, taken: tuple[str, ...] = ()) -> np.ndarray:
    """Return the values of one parameter as an array of numbers, truth values or text."""
    reserved = (FAILURE, "rng", *taken)
    if not isinstance(name, str) or not name.isidentifier() or name in reserved:
        expected = f"a name of an argument, none of {', '.join(reserved)}"
        raise invalid(("points", str(name)), name, expected, "Rename the parameter.")
    try:
        column = np.array(values if isinstance(values, np.ndarray) else list(values))
    except (TypeError, ValueError):
        column = np.empty(0, dtype=object)
    if column.ndim != 1 or column.size == 0 or column.dtype.kind not in "bifuU":
        remedy = "Bind anything else to the function by functools.partial, or sweep its index."
        raise invalid(("points", name), values, "real numbers, truth values or text", remedy)
    if column.dtype.kind == "f" and not all(math.isfinite(value) for value in column):
        raise invalid(("points", name), values, "finite numbers", "Leave the others out.")
    return column
