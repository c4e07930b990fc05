"""The same plant has the same answer: in other units, states and orders."""

import numpy as np
import pytest

import robustpolish as rp

TOLERANCE = 1e-4


def force_axis():
    """One axis of the air bearing, with a price of 0.1 um on every N."""
    plant = rp.air_bearing(actuation="force")
    states, controls = slice(4, 8), slice(2, 4)
    return plant.A[states, states], plant.B1[states], plant.B2[states, controls], 1e-7


def drawn(seed):
    rng = np.random.default_rng(seed)
    A, B1, B2 = rng.normal(size=(5, 5)), rng.normal(size=(5, 2)), rng.normal(size=(5, 2))
    return A, B1, B2, 0.5


PLANTS = {"axis": force_axis(), **{f"drawn {seed}": drawn(seed) for seed in (1, 2, 6)}}


def designed(A, B1, B2, C1, weight, norm, method):
    plant = rp.GeneralizedPlant.from_matrices(A, B1, B2, C1, np.eye(len(A)))
    design = rp.state_feedback(plant, norm, method, control_weight=weight, tolerance=TOLERANCE)
    bound = design.lower_bound
    assert bound <= design.certificate.achieved
    within = design.certificate.achieved <= bound * (1 + TOLERANCE)
    assert (design.status == "optimal") == within
    return design


@pytest.mark.parametrize("method", ["lmi", "riccati"])
@pytest.mark.parametrize("norm", ["hinf", "h2"])
@pytest.mark.parametrize("name", PLANTS)
def test_realisation_units_and_order_do_not_change_the_norm(name, norm, method):
    A, B1, B2, weight = PLANTS[name]
    n = len(A)
    rng = np.random.default_rng(7)
    C1 = np.eye(n)[:2]
    first = designed(A, B1, B2, C1, weight, norm, method)
    # Other states, another unit of time and of u, and all signals in another order.
    # Mixed states of the stiff axis would lose its damping to rounding.
    mixed = np.eye(n)[rng.permutation(n)] if name == "axis" else np.linalg.qr(drawn(7)[0])[0]
    T = mixed * 10.0 ** rng.uniform(-2, 2, n)
    time, unit = 1e3, 1e-4
    order = [rng.permutation(M.shape[1]) for M in (B1, B2)]
    second = designed(
        time * np.linalg.solve(T, A @ T),
        time * np.linalg.solve(T, B1[:, order[0]]),
        time * unit * np.linalg.solve(T, B2[:, order[1]]),
        (C1 @ T)[::-1],
        weight * unit,
        norm,
        method,
    )
    factor = 1.0 if norm == "hinf" else time**-0.5
    norms = first.certificate.achieved, factor * second.certificate.achieved
    bounds = first.lower_bound, factor * second.lower_bound
    # Whatever was found in one form bounds what can be found in the other.
    assert max(bounds) <= min(norms) * (1 + 1e-6)
    if first.status == second.status == "optimal":
        assert norms[0] == pytest.approx(norms[1], rel=TOLERANCE)
    if norm == "h2" or name == "axis":
        assert first.status == second.status == "optimal"


def test_a_limit_of_gains_is_not_called_optimal_far_above_it():
    """The Riccati equation stops 4e-4 above what the inequalities reach, and says so."""
    rng = np.random.default_rng(1)
    nx, nw, nu, nz = rng.integers(2, 8), rng.integers(1, 4), rng.integers(1, 3), rng.integers(1, 4)
    A = rng.normal(size=(nx, nx))
    x, u, t = (10 ** rng.uniform(-3, 3, n) for n in (nx, nu, 1))
    plant = rp.GeneralizedPlant.from_matrices(
        A * x[:, None] / x / t,
        rng.normal(size=(nx, nw)) * x[:, None] / t,
        rng.normal(size=(nx, nu)) * x[:, None] * u / t,
        rng.normal(size=(nz, nx)) / x,
        np.eye(nx),
        0.3 * rng.normal(size=(nz, nw)),
    )
    designs = [
        rp.state_feedback(plant, method=method, control_weight=0.5 / u)
        for method in ("riccati", "lmi")
    ]
    least = min(design.certificate.achieved for design in designs)
    for design in designs:
        assert design.lower_bound <= least
        if design.status == "optimal":
            assert design.certificate.achieved <= least * (1 + TOLERANCE)
