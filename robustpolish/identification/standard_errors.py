"""Standard errors of fitted numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robustpolish.identification.least_squares import Fit
from robustpolish.identification.parameters import FreeParameter
from robustpolish.identification.record import Record

Array = NDArray[np.float64]


def standard_errors(fitted: Fit, record: Record) -> dict[str, float]:
    """Return standard errors, residuals taken as coloured as they are.

    The information is divided by the variance inflation of autocorrelated residuals.
    """
    inflation = max(_inflation(e) for e in (fitted.errors / fitted.sigma).T)
    information = fitted.information
    keep = [j for j in range(len(fitted.free)) if information[j, j] > 0]
    errors = {f.key: np.inf for f in fitted.free}
    if keep:
        block = information[np.ix_(keep, keep)]
        size = np.sqrt(np.diag(block))
        covariance = np.linalg.pinv(block / np.outer(size, size), rcond=1e-12, hermitian=True)
        share = float(np.mean((fitted.errors / fitted.sigma) ** 2))
        for row, j in enumerate(keep):
            f: FreeParameter = fitted.free[j]
            variance = max(covariance[row, row], 0.0) / size[row] ** 2 * inflation * share
            errors[f.key] = float(np.sqrt(variance) * f.scale)
    return errors


def _inflation(e: Array) -> float:
    """Return one plus twice the sum of squared autocorrelations, Bartlett's factor."""
    e = np.nan_to_num(e - np.mean(e))
    power = float(e @ e)
    if power == 0:
        return 1.0
    lags = min(200, len(e) // 10)
    rho = np.array([e[k:] @ e[:-k] for k in range(1, lags)]) / power
    return float(1 + 2 * np.sum(rho**2))
