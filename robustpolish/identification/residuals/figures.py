"""The figures of a residual analysis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from robustpolish.identification.residuals.correlation import Coherence, Correlation
from robustpolish.identification.residuals.places import PlaceShares


@dataclass(frozen=True, eq=False, repr=False)
class ResidualFigures:
    """What :class:`ResidualAnalysis` says in words and pictures; its attributes are told there."""

    residual: xr.Dataset
    channels: xr.DataArray
    windows: xr.DataArray
    bands: xr.DataArray
    modes: xr.DataArray
    harmonics: xr.DataArray
    places: Mapping[str, PlaceShares]
    phase: xr.DataArray | None
    contact: xr.DataArray | None
    autocorrelation: Mapping[str, Correlation]
    cross_correlation: Mapping[tuple[str, str], Correlation]
    coherence: Mapping[tuple[str, str], Coherence]
    nrmse: Mapping[str, float]

    def overall(self, shares: xr.DataArray) -> xr.DataArray:
        """Return the shares of the total error: those of the outputs, weighted by `channels`.

        Parameters
        ----------
        shares : xarray.DataArray
            One of the tables of shares, over ``output``.

        Returns
        -------
        xarray.DataArray
        """
        return (shares * self.channels).sum("output")

    @property
    def worst(self) -> str:
        """The output with the largest share of the error."""
        return str(self.channels["output"].values[int(np.argmax(self.channels.values))])
