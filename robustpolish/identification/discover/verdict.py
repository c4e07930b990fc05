"""Choose the verdict of a diagnosis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robustpolish.identification.discover.screening import Screening
from robustpolish.identification.fit.prepared import Setting

Array = NDArray[np.float64]

AT_FLOOR = 1.25
EXPLAINED = 0.85
IMPROVED = 1.1
SILENT = 0.002
LOUDEST = 0.4


def choose_verdict(
    setting: Setting,
    steady: bool,
    screening: Screening | None,
    base: Array,
    refitted: Array,
    error: Array,
    added: bool,
) -> tuple[str, list[str], Array]:
    """Return the verdict, the reasons, and the noise floor over the outputs' deviations.

    Parameters
    ----------
    setting : Setting
    steady : bool
        Whether free runs over the whole record judge; otherwise the errors are of windows.
    screening : Screening, optional
        The last one.
    base, refitted, error : ndarray, shape (ny,)
        Free-run errors of the model as it was, refitted, and in the end.
    added : bool
        Whether effects were added.
    """
    size = np.std(setting.record.Y, axis=0)
    white = setting.scales.noise
    noise_like = _noise_like(screening) and bool(np.all(error < LOUDEST * size))
    at_floor = float(np.max(error / white)) < AT_FLOOR or noise_like
    floor = (error if at_floor else np.minimum(white, error)) / size
    if added:
        share = _explained(refitted, error, white)
        if at_floor or share > EXPLAINED or not steady:
            told = f"The effects explain {100 * share:.0f} % of the error above the noise."
            return "missing_effect", [told] if share > 0 else [], floor
        why = f"What was found explains {100 * share:.0f} % of the error above the noise only."
        return "unexplained", [why], floor
    if not at_floor:
        return "unexplained", ["No effect of the catalogue makes the error fall visibly."], floor
    if np.any(base > IMPROVED * error):
        return "parameters", [], floor
    return "adequate", [], floor


def _explained(before: Array, after: Array, noise: Array) -> float:
    """Return the share of the error's power above the noise that went away."""
    excess = float(np.sum((before**2 - noise**2) / noise**2))
    left = float(np.sum(np.maximum(after**2 - noise**2, 0) / noise**2))
    return 1 - left / excess if excess > 0 else 1.0


def _noise_like(screening: Screening | None) -> bool:
    """Return whether the last screening saw coloured noise, and no missing force."""
    return screening is not None and screening.level.force <= SILENT
