"""Small problems of output feedback as the engines see them, with optima in closed form."""

import numpy as np

from robustpolish.base.budget import Budget
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.engine import Settings, Task
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.riccati.gamma import has_full_rank, lower_bound
from robustpolish.synthesis.riccati.lqg import h2_lower_bound


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


def task(plant, norm: Norm = "hinf", tolerance=4e-3, bounded=True):
    """State the problem of a continuous plant, unscaled, with its lower bound if asked."""
    matrices = PlantMatrices.of(plant).without_d22()
    bound = None
    if bounded:
        search = norm == "hinf"
        bound = (
            lower_bound(matrices, 0.03 * tolerance, Budget())
            if search
            else h2_lower_bound(matrices)
        )
    return Task(matrices, norm, has_full_rank(matrices), tolerance, bound)


def settings(norm: Norm = "hinf", method="auto", tolerance=4e-3):
    """What a user asks of the engines by default."""
    return Settings(norm, method, "cvxpy", None, tolerance)
