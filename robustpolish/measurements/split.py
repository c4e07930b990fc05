"""Records in contiguous parts, for estimation and for judging."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import xarray as xr

from robustpolish.validation import described, invalid, is_whole


def split_blocks(data: xr.Dataset, parts: int | Sequence[float] = (0.6, 0.4)) -> list[xr.Dataset]:
    """Cut a record into contiguous blocks; samples are never shuffled.

    Neighbouring samples of a vibration are nearly copies of each other, so that a model fitted to
    every second one has seen the others too.

    Parameters
    ----------
    data : xarray.Dataset
        Over ``time``.
    parts : int or sequence of float, optional
        Number of equal blocks, or the shares of the record; 60 % for estimation and 40 % held
        out by default.

    Returns
    -------
    list of xarray.Dataset
        In the order of time, which keeps running.

    Raises
    ------
    InvalidInputError
        If the shares are not positive or exceed 1, or a block would have less than two samples.

    Examples
    --------
    >>> import xarray as xr
    >>> data = xr.Dataset({"x": ("time", range(10))}, {"time": range(10)})
    >>> [block.sizes["time"] for block in split_blocks(data)]
    [6, 4]
    """
    samples = data.sizes["time"]
    if is_whole(parts):
        if parts < 1:
            raise invalid("parts", parts, "one block or more", "Ask for fewer or more blocks.")
        shares = [1 / parts] * int(parts)
    else:
        try:
            shares = [float(share) for share in parts]  # type: ignore[union-attr]
        except (TypeError, ValueError):
            raise invalid("parts", parts, "a number or shares", "Pass (0.6, 0.4).") from None
    if not shares or not all(share > 0 for share in shares) or sum(shares) > 1 + 1e-9:
        raise invalid("parts", parts, "positive shares of at most 1 in all", "Pass (0.6, 0.4).")
    edges = np.rint(np.concatenate([[0.0], np.cumsum(shares)]) * samples).astype(int)
    if np.min(np.diff(edges)) < 2:
        raise invalid(
            "parts",
            described(f"{len(shares)} blocks of a record with {samples} samples"),
            "two samples or more in each",
            "Ask for fewer blocks or record longer.",
        )
    return [data.isel(time=slice(first, last)) for first, last in pairwise(edges)]
