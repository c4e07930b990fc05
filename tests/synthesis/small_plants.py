"""Small plants that several tests share."""

import numpy as np

from robustpolish.plants.plant import GeneralizedPlant


def oscillator():
    """X'' + 0.1 x' + x = w + u; price on u, noise on y."""
    return GeneralizedPlant.from_matrices(
        [[0.0, 1.0], [-1.0, -0.1]],
        [[0.0, 0.0], [1.0, 0.0]],
        [[0.0], [1.0]],
        [[1.0, 0.0], [0.0, 0.0]],
        [[1.0, 0.0]],
        D12=[[0.0], [0.5]],
        D21=[[0.0, 0.2]],
        disturbances=["force", "noise"],
        performance=["x", "price"],
    )


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
    B1 = np.hstack([rng.normal(size=(n, 2)), np.zeros((n, 1))])
    C1 = np.vstack([rng.normal(size=(2, n)), np.zeros((1, n))])
    return GeneralizedPlant.from_matrices(
        A,
        B1,
        rng.normal(size=(n, 1)),
        C1,
        rng.normal(size=(1, n)),
        D12=[[0.0], [0.0], [1.0]],
        D21=[[0.0, 0.0, 1.0]],
        D22=[[d22]],
    )
