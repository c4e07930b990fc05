from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

import robustpolish as rp
from robustpolish.robust import branch_and_bound as branch
from robustpolish.robust.branch_and_bound import branch_and_bound, parameter_norm_of
from robustpolish.robust.loop_model import DeltaBlock, DeltaStructure, LoopModel
from tests.robust.loops import servo


def chain(damping=0.01):
    """Three masses in a row between walls, with springs that are known to 20, 25 and 30 %."""
    springs = [rp.uncertain.real(f"k{i}", 1 + 0.3 * i, percent=20 + 5 * i) for i in range(3)]
    K = [[0] * 3 for _ in range(3)]
    for i, k in enumerate(springs):
        K[i][i] = K[i][i] + k
        if i:
            K[i - 1][i - 1] = K[i - 1][i - 1] + k
            K[i][i - 1], K[i - 1][i] = -k, -k
    A = [[0] * 6 for _ in range(6)]
    for i in range(3):
        A[i][3 + i], A[3 + i][3 + i] = 1, -damping * (1 + i)
        for j in range(3):
            A[3 + i][j] = -1 * K[i][j] if K[i][j] != 0 else 0
    return rp.uncertain.system(A, np.eye(6)[:, [3]], np.eye(6)[[2]])


def cubic(seed):
    """s^3 + a s^2 + b s + c, with the numbers in an ellipsoid: centre, L, and the system."""
    random = np.random.default_rng(seed)
    centre = np.array([2.0, 3.0, 2.0]) * random.uniform(0.7, 1.3, 3)
    L = 0.3 * random.standard_normal((3, 3))
    e = rp.uncertain.ellipsoid(dict(zip("abc", centre, strict=True)), shape=L)
    A = [[0, 1, 0], [0, 0, 1], [-e["c"], -e["b"], -e["a"]]]
    return centre, L, rp.uncertain.system(A, [[0], [0], [1]], [[1, 0, 0]])


def routh(centre, L):
    """Distance of the centre from a b = c and from c = 0, in units of the ellipsoid."""

    def square(x):
        return np.sum(np.linalg.solve(L, np.array([x[0], x[1], x[0] * x[1]]) - centre) ** 2)

    found = [centre[2] / np.linalg.norm(L[2])]
    for a in np.linspace(0.2, 6, 9):
        for b in np.linspace(0.2, 6, 9):
            end = minimize(square, [a, b], tol=1e-13)
            if end.x.min() > 0:
                found.append(np.sqrt(end.fun))
    return min(found)


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.long) for k in (1, 2, 3))])
def test_ellipsoid_is_exact(seed):
    centre, L, loop = cubic(seed)
    margin = rp.robust_stability(loop, gap=1e-6)
    assert margin.status == "bracketed"
    assert margin.proven
    assert margin.upper <= margin.lower * (1 + 1.01e-6)
    assert margin.lower <= routh(centre, L) * (1 + 1e-9)
    assert margin.upper == pytest.approx(routh(centre, L), rel=1e-8)
    assert np.linalg.norm(list(margin.witness.values())) == pytest.approx(margin.upper)


def test_ellipsoid_of_a_mass():
    # m s^2 + c s + k: stable as long as all are positive, so the nearest of three planes counts
    centre = {"m": 2.0, "c": 0.5, "k": 3.0}
    L = np.array([[0.3, 0.1, 0.0], [0.05, 0.2, 0.04], [0.0, 0.6, 0.5]])
    e = rp.uncertain.ellipsoid(centre, shape=L)
    loop = rp.uncertain.system([[0, 1], [-e["k"] / e["m"], -e["c"] / e["m"]]], [[0], [1]], [[1, 0]])
    truth = min(p / np.linalg.norm(row) for p, row in zip(centre.values(), L, strict=True))
    margin = rp.robust_stability(loop, gap=1e-6)
    assert margin.lower <= truth * (1 + 1e-12)
    assert margin.upper >= truth * (1 - 1e-12)
    assert margin.upper <= margin.lower * (1 + 1.01e-6)


def test_worst_gain_over_an_ellipsoid():
    # 1 / (s^2 + c s + k) has the gain 1 / (c sqrt(k - c^2 / 4)): least over the circle
    L = np.array([[0.1, 0.05], [0.2, 0.3]])
    e = rp.uncertain.ellipsoid({"c": 0.5, "k": 2.0}, shape=L)
    loop = rp.uncertain.system([[0, 1], [-e["k"], -e["c"]]], [[0], [1]], [[1, 0]])
    angles = np.linspace(0, 2 * np.pi, 200001)
    c, k = np.array([[0.5], [2.0]]) + L @ np.array([np.cos(angles), np.sin(angles)])
    truth = (1 / (c * np.sqrt(k - c**2 / 4))).max()
    worst = rp.worst_case_gain(loop, gap=1e-4)
    assert worst.lower <= truth * (1 + 1e-8)
    assert truth <= worst.upper <= worst.lower * (1 + 1.01e-4)
    assert np.linalg.norm(list(worst.witness.values())) <= 1 + 1e-12


def test_light_damping():
    # scalings alone leave a third between the bounds
    loop = chain()
    worst = rp.worst_case_gain(loop)
    assert worst.status == "bracketed"
    assert worst.proven
    assert worst.lower <= worst.upper <= 1.00201 * worst.lower
    machine = loop.at(worst.witness)
    assert rp.hinf_norm(machine).value == pytest.approx(worst.lower, rel=1e-6)
    assert max(rp.hinf_norm(one).value for one in loop.sample(20)) <= worst.upper
    margin = rp.robust_performance(loop, gamma=1.5 * worst.lower)
    assert margin.status == "bracketed"
    assert 1 < margin.lower <= margin.upper <= 1.00201 * margin.lower


@pytest.mark.parametrize("claimed", [1.05, 1.5])
def test_a_size_that_nothing_has_is_not_proven(claimed, monkeypatch):
    # branching is told of a witness that does not exist, far above the true one
    monkeypatch.setattr(branch, "POLICY", replace(branch.POLICY, work=2e7))
    truth = rp.robust_stability(servo())
    loop = LoopModel.of(servo())
    best = claimed * truth.upper * loop.gain
    found = branch_and_bound(loop, "both", 0.0, best, 1e-3, lambda numbers, frequency: best)
    assert truth.lower * 0.9 <= found / loop.gain <= truth.upper


def test_gauge_of():
    blocks = (
        DeltaBlock("real"),
        DeltaBlock("real", group="e"),
        DeltaBlock("complex"),
        DeltaBlock("real", group="e"),
    )
    parameter_norm = parameter_norm_of(DeltaStructure(blocks))
    assert (parameter_norm.alone, parameter_norm.together) == ((0,), ((1, 2),))
