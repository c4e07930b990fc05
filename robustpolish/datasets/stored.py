"""The files beside this module, and how they become datasets."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray


def stored(name: str) -> dict[str, NDArray[Any]]:
    """Return the arrays of a file of this folder."""
    with (
        files("robustpolish.datasets").joinpath("files", name).open("rb") as file,
        np.load(file, allow_pickle=False) as archive,
    ):
        return {key: archive[key] for key in archive.files}


def dataset(
    columns: Mapping[str, tuple[NDArray[np.float64], str]], sampling_rate: float, source: str
) -> xr.Dataset:
    """Return columns, each with its unit, over time from 0 in s."""
    length = len(next(iter(columns.values()))[0])
    time = np.arange(length) / sampling_rate
    return xr.Dataset(
        {name: ("time", values, {"units": unit}) for name, (values, unit) in columns.items()},
        coords={"time": ("time", time, {"units": "s"})},
        attrs={"source": source},
    )
