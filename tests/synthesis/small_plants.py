"""Small plants that several tests share."""

import numpy as np

from robustpolish.plants.plant import GeneralizedPlant


def priced(A, B1, B2, C1, C2, price=1.0, noise=None, **more):
    """One control with a price, which is the last of z, and perhaps noise on y, the last of w."""
    n, D21 = len(A), None
    C1 = np.vstack([C1, np.zeros((1, n))])
    if noise is not None:
        B1 = np.hstack([B1, np.zeros((n, 1))])
        D21 = [[0.0] * (B1.shape[1] - 1) + [noise]]
    D12 = [[0.0]] * (len(C1) - 1) + [[price]]
    return GeneralizedPlant.from_matrices(A, B1, B2, C1, C2, D12=D12, D21=D21, **more)


def double_integrator(noise=1.0):
    """X'' = w + u."""
    push = [[0.0], [1.0]]
    return priced([[0.0, 1.0], [0.0, 0.0]], push, push, [[1.0, 0.0]], [[1.0, 0.0]], noise=noise)


def oscillator():
    """X'' + 0.1 x' + x = w + u; price on u, noise on y."""
    A, push, x = [[0.0, 1.0], [-1.0, -0.1]], [[0.0], [1.0]], [[1.0, 0.0]]
    names = {"disturbances": ["force", "noise"], "performance": ["x", "price"]}
    return priced(A, push, push, x, x, 0.5, 0.2, **names)


def two_masses(measured):
    """Unstable first mode, two actuators, two sensors."""
    A = [[0, 1, 0, 0], [1.0, -0.1, 0.3, 0], [0, 0, 0, 1], [0.3, 0, -4.0, -0.1]]
    B = [[0, 0], [1, 0], [0, 0], [0, 1.0]]
    w = [[0.0], [1], [0], [0.5]]
    C1 = [[1.0, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
    D12 = [[0, 0], [0, 0], [0.1, 0], [0, 0.1]]
    return GeneralizedPlant.from_matrices(A, w, B, C1, measured, D12=D12)


FULL = [[1.0, 0.5, 0, 0], [0, 0, 1.0, 0.5]]


def regular_plant(n=3, seed=0, d22=0.0):
    """Random, with price on u and noise on y, so that LQG is the H2 optimum."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    B1, C1, B2, C2 = (rng.normal(size=shape) for shape in ((n, 2), (2, n), (n, 1), (1, n)))
    return priced(A, B1, B2, C1, C2, noise=1.0, D22=[[d22]])
