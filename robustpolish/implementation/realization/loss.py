"""What single precision costs a loop: its certificate with rounded coefficients."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import control
import numpy as np

from robustpolish.arrays import Vector
from robustpolish.implementation.realization.float32 import rounded, roundoff_bound
from robustpolish.implementation.sampled.certificate import (
    Norm,
    SampledCertificate,
    certificate_of,
)
from robustpolish.models import GeneralizedPlant


@dataclass(frozen=True, eq=False)
class SinglePrecision:
    """A loop whose controller has its coefficients in single precision.

    Attributes
    ----------
    certificate : SampledCertificate
        Of the loop with rounded coefficients.
    pole_shift : float
        How far the farthest pole of the controller has moved (of the z plane's unit circle).
    norm_change : float
        Relative; infinite if the loop is unstable.
    per_sample, outputs : ndarray
        Bounds of what rounding adds to each control in one sample, and over 10,000 samples in all,
        rounding of coefficients included, for measurements of at most one unit each.
    size : ndarray
        The largest controls that such measurements bring.
    """

    certificate: SampledCertificate
    pole_shift: float
    norm_change: float
    per_sample: Vector
    outputs: Vector
    size: Vector

    @property
    def sentence(self) -> str:
        """The loss in words."""
        if not self.certificate.stable:
            return "With coefficients in single precision the loop is unstable."
        relative = float(np.max(self.per_sample / np.maximum(self.size, 1e-300), initial=0.0))
        change = 100 * self.norm_change
        told = f"by {change:+.2g} %" if abs(change) >= 1e-4 else "by less than 0.0001 %"
        return (
            f"In single precision its poles move by up to {self.pole_shift:.2g}, the norm of the "
            f"loop changes {told}, and rounding adds up to {relative:.2g} of the largest control "
            "in every sample."
        )


def single_precision(
    filtered: GeneralizedPlant,
    controller: control.StateSpace,
    delay: float,
    norm: Norm,
    before: float,
) -> SinglePrecision:
    """Certify a loop whose controller is rounded to single precision, and bound its roundoff.

    Parameters
    ----------
    filtered : GeneralizedPlant
        Continuous, with its filter.
    controller : control.StateSpace
        Discrete, in the form in which it is computed.
    delay : float
        In s.
    norm : {"hinf", "h2"}
    before : float
        The norm in double precision.

    Returns
    -------
    SinglePrecision
    """
    short = rounded(controller)
    certificate = certificate_of(filtered, short, delay, norm)
    change = certificate.achieved / before - 1 if before > 0 else 0.0
    bound = roundoff_bound(controller)
    return SinglePrecision(certificate, _shift(controller, short), float(change), *bound)


def _shift(first: Any, second: Any) -> float:
    """Return the largest distance between poles that belong together."""
    one = np.linalg.eigvals(np.asarray(first.A)) if first.nstates else np.zeros(0)
    other = list(np.linalg.eigvals(np.asarray(second.A))) if second.nstates else []
    most = 0.0
    for pole in one:
        distances = np.abs(np.array(other) - pole)
        nearest = int(np.argmin(distances))
        most = max(most, float(distances[nearest]))
        other.pop(nearest)
    return most
