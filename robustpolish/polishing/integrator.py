"""The explicit Runge-Kutta pair of order 5(4) by Dormand and Prince, in compiled pieces.

Facts from J. R. Dormand and P. J. Prince, "A family of embedded Runge-Kutta formulae",
J. Comp. Appl. Math. 6 (1980). It is the pair of MATLAB's ode45. The loops that call these
pieces stand beside the right-hand sides, because compiled code that takes a function as an
argument cannot be kept on disk from one run to the next.
"""

from __future__ import annotations

import numpy as np

from robustpolish.base.jit import njit

STAGES = 7

NODES = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0])

# Row s combines the slopes before stage s; the last row is the solution of order 5.
COUPLING = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)

# Solution of order 5 less that of order 4.
ERROR = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])

# Powers 1 to 4 of the fraction of the step, per slope, for values inside the step.
DENSE = np.array(
    [
        [1.0, -183 / 64, 37 / 12, -145 / 128],
        [0.0, 0.0, 0.0, 0.0],
        [0.0, 1500 / 371, -1000 / 159, 1000 / 371],
        [0.0, -125 / 32, 125 / 12, -375 / 64],
        [0.0, 9477 / 3392, -729 / 106, 25515 / 6784],
        [0.0, -11 / 7, 11 / 3, -55 / 28],
        [0.0, 3 / 2, -4.0, 5 / 2],
    ]
)


@njit(cache=True)
def stage_state(slopes, stage, start, step, state):  # pragma: no cover - compiled
    """Write into `state` where stage `stage` evaluates; stage 6 is the end of the step."""
    for i in range(start.size):
        total = 0.0
        for s in range(stage):
            total += COUPLING[stage, s] * slopes[s, i]
        state[i] = start[i] + step * total


@njit(cache=True)
def step_error(slopes, step, scale):  # pragma: no cover - compiled
    """Return the largest error of the step, each divided by its scale; infinite if undefined."""
    largest = 0.0
    for i in range(scale.size):
        total = 0.0
        for s in range(STAGES):
            total += ERROR[s] * slopes[s, i]
        error = abs(step * total) / scale[i]
        if np.isnan(error):
            return np.inf
        largest = max(largest, error)
    return largest


@njit(cache=True)
def inside_step(slopes, start, step, fraction, first, state):  # pragma: no cover - compiled
    """Write into `state` the components from `first` on, at a fraction of the step."""
    for i in range(state.size):
        total = 0.0
        for s in range(STAGES):
            power = fraction
            weight = 0.0
            for p in range(4):
                weight += DENSE[s, p] * power
                power *= fraction
            total += weight * slopes[s, first + i]
        state[i] = start[first + i] + step * total
