"""Outcomes of all points as one Dataset over the parameters."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from robustpolish.sweeps.outcome import Outcome
from robustpolish.sweeps.points import FAILURE, Points


def assembled(points: Points, outcomes: Mapping[int, Outcome]) -> xr.Dataset:
    """Return one Dataset; points that do not have the first one's form count as failures."""
    count = len(points.each)
    failures = [outcomes[i].failure for i in range(count)]
    good = [i for i in range(count) if not failures[i]]
    for i in good[1:]:
        if outcomes[i].form != outcomes[good[0]].form:
            failures[i] = (
                f"ValueError: names, shapes or coordinates differ from those of point {good[0]}"
            )
    good = [i for i in good if not failures[i]]
    variables: dict[str, tuple[tuple[str, ...], np.ndarray]] = {}
    coords = dict(points.coords)
    if good:
        first = outcomes[good[0]]
        coords |= first.coords
        for name, (dims, _) in first.values.items():
            stacked = np.stack([outcomes[i].values[name][1] for i in good])
            if len(good) < count:
                stacked = _with_gaps(stacked, good, count)
            variables[name] = (
                (*points.dims, *dims),
                stacked.reshape(points.shape + stacked.shape[1:]),
            )
    reasons = np.array(failures, dtype=object).astype(str).reshape(points.shape)
    variables[FAILURE] = (points.dims, reasons)
    return xr.Dataset(variables, coords)


def _with_gaps(values: np.ndarray, good: list[int], count: int) -> np.ndarray:
    """Return values at all points: nan, not a time or empty text where there is none."""
    if values.dtype.kind in "biu":
        values = values.astype(float)
    blank = {"U": "", "m": "NaT", "M": "NaT"}.get(values.dtype.kind, np.nan)
    kept = np.full((count, *values.shape[1:]), blank, values.dtype)
    kept[good] = values
    return kept
