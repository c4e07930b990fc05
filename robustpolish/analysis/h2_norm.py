"""The H2 norm: root mean square response to white noise, or the energy of the impulse response."""

from __future__ import annotations

import math
from dataclasses import dataclass

import control
import numpy as np
import scipy.linalg as sla

from robustpolish.analysis._realisation import realisation, rescaled


@dataclass(frozen=True)
class H2Norm:
    """Size of a system's response to white noise of unit intensity.

    Attributes
    ----------
    value : float
        The norm; infinite if the system is unstable or has a direct feedthrough in continuous time.
    stable : bool
        Whether all poles are strictly stable.
    reason : str
        How the value was found, or why it is infinite.
    """

    value: float
    stable: bool
    reason: str

    def __float__(self) -> float:
        return self.value


def h2_norm(system: control.StateSpace) -> H2Norm:
    """Compute the H2 norm."""
    model = realisation("system", system)
    if 0 in model.D.shape:
        return H2Norm(0.0, True, "there are no inputs or no outputs")
    poles = np.linalg.eigvals(model.A)
    margin = 1 - np.abs(poles) if model.discrete else -poles.real
    if margin.size and margin.min() <= 0:
        return H2Norm(math.inf, False, f"unstable pole {poles[margin.argmin()]:.6g}")
    if not model.discrete and model.D.any():
        return H2Norm(math.inf, True, "D is not zero in continuous time")
    if model.states == 0:
        return H2Norm(float(np.linalg.norm(model.D)), True, "a static gain")
    scaled = rescaled(model)
    A, B, C, D = scaled.A, scaled.B, scaled.C, scaled.D
    if scaled.discrete:
        gramian = sla.solve_discrete_lyapunov(A, B @ B.T)
        square = np.trace(C @ gramian @ C.T) + np.sum(D**2)
    else:
        gramian = sla.solve_continuous_lyapunov(A, -B @ B.T)
        square = np.trace(C @ gramian @ C.T) * scaled.time
    return H2Norm(
        math.sqrt(max(square, 0.0)) * scaled.gain, True, "trace of the controllability Gramian"
    )
