"""Random stable systems, and their response."""

import control
import numpy as np

from robustpolish.linear.arithmetic.realisation import realisation


def model(seed, states=6, inputs=2, outputs=3, dt=0):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((states, states))
    A -= (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(states)
    if dt:
        A = np.linalg.solve(3 * np.eye(states) - A, 3 * np.eye(states) + A)
    B, C = rng.standard_normal((states, inputs)), rng.standard_normal((outputs, states))
    D = rng.standard_normal((outputs, inputs))
    return realisation("system", control.ss(A, B, C, D, dt))


def response(G, x):
    """Evaluate the transfer matrix at s = i x, or z = (1 + i x)/(1 - i x)."""
    point = (1 + 1j * x) / (1 - 1j * x) if G.discrete else 1j * x
    return G.C @ np.linalg.solve(point * np.eye(G.states) - G.A, G.B) + G.D
