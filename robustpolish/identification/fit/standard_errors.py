"""Standard errors and covariance of fitted numbers."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.identification.fit.least_squares import Fit
from robustpolish.identification.record import Record

Array = NDArray[np.float64]


def covariance_of(fitted: Fit, record: Record) -> xr.DataArray:
    """Return the covariance of the fitted numbers, residuals taken as coloured as they are.

    The information is divided by the variance inflation of autocorrelated residuals.

    Parameters
    ----------
    fitted : Fit
    record : Record

    Returns
    -------
    xarray.DataArray
        Over ``parameter`` and ``other``, the keys of the fitted numbers, in products of their SI
        units. Numbers that the data does not see have an infinite variance.
    """
    inflation = max(_inflation(e) for e in (fitted.errors / fitted.sigma).T)
    information = fitted.information
    keys = [f.key for f in fitted.free]
    seen = np.flatnonzero(np.diag(information) > 0).tolist()
    matrix = np.diag(np.full(len(keys), np.inf))
    if seen:
        block = information[np.ix_(seen, seen)]
        size = np.sqrt(np.diag(block))
        relative = np.linalg.pinv(block / np.outer(size, size), rcond=1e-12, hermitian=True)
        share = float(np.mean((fitted.errors / fitted.sigma) ** 2))
        unit = np.array([fitted.free[j].scale for j in seen]) / size
        matrix[np.ix_(seen, seen)] = relative * np.outer(unit, unit) * inflation * share
    return xr.DataArray(matrix, {"parameter": keys, "other": keys}, ("parameter", "other"))


def standard_errors(fitted: Fit, record: Record) -> dict[str, float]:
    """Return the standard errors of the fitted numbers by their keys, in SI units."""
    return errors_from(covariance_of(fitted, record))


def errors_from(covariance: xr.DataArray) -> dict[str, float]:
    """Return the standard errors that belong to a covariance."""
    errors = np.sqrt(np.maximum(np.diag(covariance.values), 0.0))
    return dict(zip(covariance["parameter"].values.tolist(), errors.tolist(), strict=True))


def _inflation(e: Array) -> float:
    """Return one plus twice the sum of squared autocorrelations, Bartlett's factor."""
    e = np.nan_to_num(e - np.mean(e))
    power = float(e @ e)
    if power == 0:
        return 1.0
    lags = min(200, len(e) // 10)
    rho = np.array([e[k:] @ e[:-k] for k in range(1, lags)]) / power
    return float(1 + 2 * np.sum(rho**2))
