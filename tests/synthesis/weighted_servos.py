"""Random servos with weights, and the same plants in other units and digits."""

from __future__ import annotations

from collections.abc import Iterator

import control
import numpy as np

import robustpolish as rp
from robustpolish.synthesis.problem.preflight import SolverPlant


def drawn(seed: int) -> tuple[rp.GeneralizedPlant, np.random.Generator]:
    """Return a servo, perhaps with a delay, with one to three weights, and the generator after it.

    An unstable oscillator, a flexible mode with one or two integrators, or an unstable actuator.
    """
    rng = np.random.default_rng(seed)
    kind = rng.integers(4)
    if kind == 0:
        p = 10 ** rng.uniform(-1, 2)
        model = control.tf([p**2], [1, 10 ** rng.uniform(-1, 1) * p, -(p**2)])
    elif kind == 1:
        p = 10 ** rng.uniform(0, 3)
        model = control.tf([p**3], np.polymul([1, 0.02 * p, p * p], [1, 0]))
    elif kind == 2:
        p = 10 ** rng.uniform(0, 3)
        model = control.tf([1, 0, 0.5 * p * p], np.polymul([1, 0.02 * p, p * p], [1, 0, 0]))
    else:
        p = 10 ** rng.uniform(0, 2)
        model = control.tf([-(p**3)], np.poly([p, -p, -0.7 * p]))
    modes = abs(model.poles())
    rate = float(np.median(modes[modes > 1e-6]))
    system = control.ss(control.ss(model), inputs="u", outputs="y")
    plant = rp.GeneralizedPlant(system, measurements="y", controls="u")
    if rng.random() < 0.6:
        delay = 10 ** rng.uniform(-3, -1) / rate
        plant = plant.with_delay("u", delay, order=int(rng.integers(1, 4)))
    weights = {}
    chosen = rng.integers(1, 8)
    if chosen & 1:
        low, crossover = 10 ** rng.uniform(1, 4), rate * 10 ** rng.uniform(-1.5, 0.5)
        order = int(rng.integers(1, 3))
        weights["performance"] = rp.weight(low, crossover, 0.5, order=order)
    if chosen & 2:
        low, crossover = 10 ** rng.uniform(-3, -1), rate * 10 ** rng.uniform(0.5, 2)
        weights["effort"] = rp.weight(low, crossover, 10 ** rng.uniform(0.5, 3))
    if chosen & 4:
        low = 0.999 if rng.random() < 0.5 else 0.5
        crossover, high = rate * 10 ** rng.uniform(0.5, 2), 10 ** rng.uniform(1, 3)
        order = int(rng.integers(1, 3))
        weights["robustness"] = rp.weight(low, crossover, high, order=order)
    return rp.mixed_sensitivity(plant, **weights).without_delays(), rng


def realisations(
    plant: rp.GeneralizedPlant, rng: np.random.Generator
) -> Iterator[rp.GeneralizedPlant]:
    """Return a plant, and the same one in other units of time and of states, and rounded."""
    yield plant
    part = SolverPlant.of(plant, mapped=True)
    m, unit = part.matrices, part.norm(1.0)

    def built(A, B1, B2, C1, C2):
        return rp.GeneralizedPlant.from_matrices(
            A, B1, B2, C1 * unit, C2, D11=m.D11 * unit, D12=m.D12 * unit, D21=m.D21
        )

    for rate in (1e3, 1e-3):
        yield built(m.A * rate, m.B1 * rate, m.B2 * rate, m.C1, m.C2)
    S = 10 ** rng.uniform(-1.5, 1.5, m.nx)
    column = S[:, None]
    yield built(m.A * S / column, m.B1 / column, m.B2 / column, m.C1 * S, m.C2 * S)

    def rounded(M):
        return M * (1 + 1e-13 * rng.standard_normal(M.shape))

    yield built(*(rounded(M) for M in (m.A, m.B1, m.B2, m.C1, m.C2)))
