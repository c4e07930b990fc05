"""Small problems of output feedback with optima in closed form."""

import numpy as np

from tests.synthesis.small_plants import priced


def unstable_lag(price=1.0, noise=1.0, a=1.0):
    """X' = a x + w1 + u, z = (x, price u), y = x + noise w2."""
    return priced([[a]], *[[[1.0]]] * 4, price, noise)


# With a = price = noise = 1 both Riccati equations have the same solution x.
# H-infinity: 2 x - x^2 (1 - g^-2) + 1 = 0, and x = g at the optimum: g^2 - 2 g - 2 = 0.
LAG_HINF = 1 + np.sqrt(3)
# H2: 2 x - x^2 + 1 = 0, so x = 1 + sqrt(2); the squared norm is x + x^3.
LAG_H2 = np.sqrt((1 + np.sqrt(2)) + (1 + np.sqrt(2)) ** 3)
