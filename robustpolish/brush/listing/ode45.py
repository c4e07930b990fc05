"""Step control of MATLAB's ode45, which integrated everything in the thesis.

Facts from L. F. Shampine and M. W. Reichelt, "The MATLAB ODE suite", SIAM J. Sci. Comput. 18
(1997): the error of a step is the largest of its components, each divided by the larger of the
state's size before and after, and of absolute over relative tolerance.
"""

from __future__ import annotations

import numpy as np

from robustpolish.brush.dormand_prince import step_error
from robustpolish.compiling import njit

ABSOLUTE = 1e-6  # MATLAB's default, in the units of the state


@njit(cache=True)
def first_step(slope, state, longest, relative):  # pragma: no cover - compiled
    """Return the length of the first step."""
    threshold = ABSOLUTE / relative
    rate = 0.0
    for i in range(state.size):
        rate = max(rate, abs(slope[i]) / max(abs(state[i]), threshold))
    rate /= 0.8 * relative**0.2
    return longest if longest * rate <= 1.0 else 1.0 / rate


@njit(cache=True)
def relative_error(slopes, step, start, end, relative, scale):  # pragma: no cover - compiled
    """Return the error of a step, to be compared with the relative tolerance."""
    threshold = ABSOLUTE / relative
    for i in range(start.size):
        scale[i] = max(abs(start[i]), abs(end[i]), threshold)
    return step_error(slopes, step, scale)


@njit(cache=True)
def shorter(step, error, relative, again):  # pragma: no cover - compiled
    """Return the step after a refusal; `again` if the step before it was refused too."""
    if again or not np.isfinite(error):
        return 0.5 * step
    return step * max(0.1, 0.8 * (relative / error) ** 0.2)


@njit(cache=True)
def longer(step, error, relative):  # pragma: no cover - compiled
    """Return the step after one that passed at the first attempt."""
    return step / max(0.2, 1.25 * (error / relative) ** 0.2)


@njit(cache=True)
def shortest(time):  # pragma: no cover - compiled
    """Return the step below which rounding of the time takes over."""
    return 16.0 * np.spacing(time)
