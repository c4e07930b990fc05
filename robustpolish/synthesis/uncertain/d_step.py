"""The D step: scalings of low order for a controller, and the plant with scalings around it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import AnyArray
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.uncertain.levels import Levels
from robustpolish.synthesis.uncertain.problem import RobustProblem
from robustpolish.synthesis.uncertain.scaling_fit import Filter, beside, fitted, scaled_norms


@dataclass(frozen=True)
class DStepPolicy:
    """How scalings are fitted.

    Attributes
    ----------
    orders : int
        Largest order of one.
    near : float
        A fit is good if it raises the level of no frequency by more than this share.
    low : float
        Levels below this share of the peak count as so much: there a fit matters little.
    """

    orders: int = 4
    near: float = 0.01
    low: float = 0.5


POLICY = DStepPolicy()


def unscaled(problem: RobustProblem) -> list[Filter]:
    """Return the scalings to begin with: none."""
    return [Filter(1.0, np.zeros(0), np.zeros(0))] * len(problem.as_complex.blocks)


def scaled_plant(problem: RobustProblem, filters: Sequence[Filter]) -> PlantMatrices:
    """Return the plant with D on the signals z and its inverse on the signals w."""
    plant, blocks = problem.matrices, problem.as_complex.blocks
    into = beside([f.inverse for f in filters], [b.rows for b in blocks])
    out = beside(filters, [b.columns for b in blocks])
    n, i, o = plant.nx, len(into.A), len(out.A)
    zeros = np.zeros
    A = np.block(
        [
            [plant.A, plant.B1 @ into.C, zeros((n, o))],
            [zeros((i, n)), into.A, zeros((i, o))],
            [out.B @ plant.C1, out.B @ plant.D11 @ into.C, out.A],
        ]
    )
    return PlantMatrices(
        A=A,
        B1=np.vstack([plant.B1 @ into.D, into.B, out.B @ plant.D11 @ into.D]),
        B2=np.vstack([plant.B2, zeros((i, plant.nu)), out.B @ plant.D12]),
        C1=np.hstack([out.D @ plant.C1, out.D @ plant.D11 @ into.C, out.C]),
        C2=np.hstack([plant.C2, plant.D21 @ into.C, zeros((plant.ny, o))]),
        D11=out.D @ plant.D11 @ into.D,
        D12=out.D @ plant.D12,
        D21=plant.D21 @ into.D,
        D22=plant.D22,
    )


def scalings_of(problem: RobustProblem, found: Levels, M: AnyArray) -> list[Filter]:
    """Return the scalings of lowest order that raise the levels next to nothing."""
    blocks = problem.as_complex.blocks
    sizes = found.diagonals()
    weights = (found.values / found.peak) ** 2 + 1e-3
    offered = [
        fitted(found.omega, np.log(sizes[:, k]), weights, POLICY.orders)
        for k in range(len(blocks) - 1)
    ]
    last = Filter(1.0, np.zeros(0), np.zeros(0))
    wanted = np.maximum(found.values, POLICY.low * found.peak)

    def loss(orders: list[int]) -> float:
        chosen = [one[order] for one, order in zip(offered, orders, strict=True)] + [last]
        logs = np.array([f.sizes(found.omega) for f in chosen]).T
        left = np.exp(np.repeat(logs, [b.columns for b in blocks], axis=1))
        right = np.exp(np.repeat(logs, [b.rows for b in blocks], axis=1))
        return float((scaled_norms(M, left, right) / wanted).max())

    losses = [loss([order] * len(offered)) for order in range(POLICY.orders + 1)]
    enough = max(min(losses), 1 + POLICY.near)
    order = next(k for k, value in enumerate(losses) if value <= enough)
    orders = [order] * len(offered)
    for k in range(len(offered)):
        while orders[k] and loss([*orders[:k], orders[k] - 1, *orders[k + 1 :]]) <= enough:
            orders[k] -= 1
    return [one[order] for one, order in zip(offered, orders, strict=True)] + [last]
