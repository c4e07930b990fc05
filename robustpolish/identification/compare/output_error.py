"""The error figures of one output, and the band of its RMS error."""

from __future__ import annotations

import numpy as np
from scipy.stats import t as student

from robustpolish.arrays import Array
from robustpolish.identification.findings.record_error import OutputError


def output_error(name: str, unit: str, measured: Array, simulated: Array) -> OutputError:
    """Return the error figures of one output; they are infinite where the simulation diverged.

    Parameters
    ----------
    name, unit : str
    measured, simulated : ndarray, shape (samples,)

    Returns
    -------
    OutputError
    """
    with np.errstate(over="ignore", invalid="ignore"):
        square = (measured - simulated) ** 2
    square = np.where(np.isfinite(square), square, np.inf)
    mean_square = float(np.mean(square))
    rmse = float(np.sqrt(mean_square))
    spread, size = float(np.std(measured)), float(np.sqrt(np.mean(measured**2)))
    low, high = _mean_square_band(square, mean_square)
    return OutputError(
        name=name,
        unit=unit,
        nrmse=rmse / spread if spread > 0 else (0.0 if rmse == 0 else np.inf),
        rmse=rmse,
        band=(low, high),
        relative=rmse / size if size > 0 else (0.0 if rmse == 0 else np.inf),
    )


def _mean_square_band(square: Array, mean: float) -> tuple[float, float]:
    """95 % band of the RMS value, from the scatter of the mean square over long blocks.

    The logarithm of a mean square scatters symmetrically enough; Student's t makes up for the
    small number of blocks.
    """
    blocks = min(20, square.size // 4)
    if blocks < 2 or not np.isfinite(mean) or mean == 0:
        root = float(np.sqrt(mean))
        return root, root
    length = square.size // blocks
    means = square[: blocks * length].reshape(blocks, length).mean(axis=1) / mean
    # Neighbouring blocks that resemble each other count as fewer.
    deviation = means - means.mean()
    total = float(deviation @ deviation)
    alike = float(deviation[1:] @ deviation[:-1]) / total if total > 0 else 0.0
    alike = float(np.clip(alike, 0.0, 0.9))
    spread = float(np.std(means, ddof=1)) / np.sqrt(blocks) * np.sqrt((1 + alike) / (1 - alike))
    width = float(student.ppf(0.975, blocks - 1)) * spread / 2  # half: root of the mean square
    root = float(np.sqrt(mean))
    return root * np.exp(-width), root * np.exp(width)
