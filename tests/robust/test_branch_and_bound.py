"""Real numbers whose bounds are drawn together by branching, against closed forms and samples."""

import flint
import numpy as np
import pytest
from scipy.optimize import minimize

import robustpolish as rp
from robustpolish.linear.arithmetic.balls import precision
from robustpolish.robust.bounds import proven_real_margin
from robustpolish.robust.branch_and_bound import split
from robustpolish.robust.loop_model import LoopModel
from tests.robust.loops import random_loop


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


@pytest.mark.parametrize(
    "seed",
    [
        0,
        *(pytest.param(k, marks=pytest.mark.long) for k in (1, 2, 3)),
    ],
)
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


# two real numbers, one complex one twice, eleven states: 3 % apart without branching
SEED = 122


def test_both_bounds_are_drawn_together():
    system = random_loop(SEED)
    margin = rp.robust_stability(system)
    assert (margin.status, margin.proven) == ("bracketed", True)
    assert margin.lower <= margin.upper <= 1.002 * margin.lower
    # and what is proven holds for machines just inside
    for machine in system.sample(20, seed=1) if margin.lower > 1 else ():
        assert machine.poles().real.max() < 0


def spring():
    """A spring that is known to 30 %, and two gains that are known to 10 %."""
    k = rp.uncertain.real("k", 4, percent=30)
    plant = rp.uncertain.system([[0, 1], [-k, -0.4]], [[0], [1]], [[1, 0]])
    first, second = (rp.uncertain.dynamics(name, bound=0.1) for name in ("first", "second"))
    return rp.feedback(plant * (1 + first), 0.5 * (1 + second))


def test_nothing_is_proven_beyond_a_witness():
    loop, margin = LoopModel.of(spring()), rp.robust_stability(spring())
    size = margin.upper * loop.gain
    # a witness is said to be a tenth larger than one that there is
    assert split(loop, None, 1e-3, 0.0, 1.1 * size, lambda numbers, at: 1.1 * size) <= size


@pytest.mark.parametrize("gap", [2e-3, 2e-2])
def test_worst_gain_beside_two_dynamics(gap):
    loop = spring()
    worst = rp.worst_case_gain(loop, gap=gap)
    assert worst.proven
    assert worst.lower <= worst.upper <= (1 + 1.01 * gap) * worst.lower
    assert max(rp.hinf_norm(one).value for one in loop.sample(10)) <= worst.upper


def repeated(seed):
    """A stable matrix, its change with a number, and the loop."""
    random = np.random.default_rng(100 + seed)
    n, r = int(random.integers(2, 7)), int(random.integers(1, 4))
    A = random.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.3) * np.eye(n)
    change = random.standard_normal((n, r)) @ random.standard_normal((r, n))
    p = rp.uncertain.real("p", 0, plus_minus=1)
    return A, change, rp.uncertain.system(A + change * p, np.ones((n, 1)), np.ones((1, n)))


def exact(A, change):
    """The Kronecker sum of A + v change is singular where two poles have the sum 0."""
    one = np.eye(len(A))
    sums = [np.kron(M, one) + np.kron(one, M) for M in (A, change)]
    inverse = np.linalg.eigvals(-np.linalg.solve(*sums))
    real = inverse[np.abs(inverse.imag) < 1e-6 * np.abs(inverse)].real
    values = [1 / v for v in real if abs(v) > 1e-9]
    values = [v for v in values if np.linalg.eigvals(A + v * change).real.max() < 1e-6]
    return abs(sharpened(A, change, min(values, key=abs)))


def sharpened(A, change, value):
    """Those eigenvalues are double, good to half the digits: secants with 60 digits give the rest.

    They bring the pole that is nearest to the axis onto it.
    """

    def real_part(v):
        poles = np.array((flint.acb_mat(start) + flint.acb_mat(slope) * v).eig(), dtype=object)
        return min((pole.real for pole in poles), key=lambda x: abs(float(x))).mid()

    with precision(200):
        start, slope = flint.arb_mat(A.tolist()), flint.arb_mat(change.tolist())
        last, now = flint.arb(value * (1 + 1e-7)), flint.arb(value)
        for _ in range(6):
            there, here = real_part(last), real_part(now)
            if there == here:
                break
            last, now = now, (now - here * (now - last) / (here - there)).mid()
        return float(now)


def check(seed):
    A, change, loop = repeated(seed)
    margin = rp.robust_stability(loop)
    answer = exact(A, change)
    assert margin.upper == pytest.approx(answer, rel=1e-8)
    assert answer * (1 - 1e-8) <= margin.lower <= margin.upper
    assert margin.proven
    at = loop.at(margin.witness).poles()
    assert np.min(np.abs(at.real)) <= 1e-8 * np.abs(at).max()


@pytest.mark.parametrize("seeds", [range(10), range(10, 100)])
def test_hundred_cases_are_exact(seeds):
    for seed in seeds:
        check(seed)


def test_a_larger_size_is_not_proven():
    _, _, loop = repeated(0)
    margin, model = rp.robust_stability(loop), LoopModel.of(loop)
    assert proven_real_margin(model, 1.001 * margin.upper * model.gain) is None
    assert proven_real_margin(model, 0.9 * margin.upper * model.gain) is not None
