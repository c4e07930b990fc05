"""Small problems of output feedback with optima in closed form."""

import numpy as np

from robustpolish.plants.plant import GeneralizedPlant


def unstable_lag(price=1.0, noise=1.0, a=1.0):
    """X' = a x + w1 + u, z = (x, price u), y = x + noise w2."""
    return GeneralizedPlant.from_matrices(
        [[a]],
        [[1.0, 0.0]],
        [[1.0]],
        [[1.0], [0.0]],
        [[1.0]],
        D12=[[0.0], [price]],
        D21=[[0.0, noise]],
    )


# With a = price = noise = 1 both Riccati equations have the same solution x.
# H-infinity: 2 x - x^2 (1 - g^-2) + 1 = 0, and x = g at the optimum: g^2 - 2 g - 2 = 0.
LAG_HINF = 1 + np.sqrt(3)
# H2: 2 x - x^2 + 1 = 0, so x = 1 + sqrt(2); the squared norm is x + x^3.
LAG_H2 = np.sqrt((1 + np.sqrt(2)) + (1 + np.sqrt(2)) ** 3)
