"""Normalised coprime factors, the margin and the gap that follow from them."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.coprime import coprime


def random_plant(seed, dt=0):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((4, 4))
    shapes = ((4, 2), (3, 4), (3, 2))
    return control.ss(A, *(rng.standard_normal(shape) for shape in shapes), dt)


@pytest.mark.parametrize("seed", range(4))
def test_the_optimal_gamma_is_that_of_the_four_blocks(seed):
    # An H-infinity problem like any other, whose infimum is found by quite another way.
    plant = rp.GeneralizedPlant.from_loop(random_plant(seed))
    found = rp.output_feedback(plant)
    optimal = coprime(plant).optimal_gamma
    assert found.lower_bound == pytest.approx(optimal, rel=1e-3)
    assert found.certificate.achieved == pytest.approx(optimal, rel=6e-3)


def test_numbers_of_matlabs_documentation():
    P, C = control.tf([1, 2], [1, 5, 10]), control.tf([4.4], [1, 0])
    assert rp.uncertain.ncf_margin(P, C, sign=-1) == pytest.approx(0.1961, abs=5e-5)
    slow = control.tf([4], [1, -0.001])
    assert rp.uncertain.ncf_margin(slow, 1, sign=-1) == pytest.approx(0.7069, abs=5e-5)
    assert rp.uncertain.ncf_margin(slow, control.tf([10], [1]), sign=-1) == pytest.approx(
        0.0995, abs=5e-5
    )


@pytest.mark.parametrize(("g", "k"), [(0.5, -1.0), (3.0, -0.2), (0.5, 0.9)])
def test_gains_in_closed_form(g, k):
    # |1 - g k| / sqrt((1 + g^2)(1 + k^2))
    expected = abs(1 - g * k) / np.sqrt((1 + g * g) * (1 + k * k))
    assert rp.uncertain.ncf_margin(control.tf([g], [1]), k) == pytest.approx(expected)


@pytest.mark.parametrize("sign", [1, -1])
def test_signs(sign):
    G = control.tf([2], [1, -1])
    assert (rp.uncertain.ncf_margin(G, 3.0 * sign, sign=-sign) > 0.2) == (sign * -sign < 0)
    assert rp.uncertain.ncf_margin(G, -3.0 * sign, sign=sign) == pytest.approx(
        rp.uncertain.ncf_margin(G, -3.0), rel=1e-9
    )


def test_unstable_loops_have_none():
    G = control.tf([2], [1, -1])
    assert rp.uncertain.ncf_margin(G, 0.1) == 0
    hidden = control.ss([[-1.0, 0.0], [0.0, 1.0]], [[1.0], [0.0]], [[1.0, 0.0]], 0)
    assert rp.uncertain.ncf_margin(hidden, -1.0) == 0


def test_delays_count_as_they_are():
    lag = control.tf([1], [1, 1], inputs="u", outputs="y")
    plant = rp.GeneralizedPlant(lag, "y", "u").with_delay("u", 0.5, order=1)
    omega = np.geomspace(1e-3, 50, 20000)
    g = np.exp(-0.5j * omega) / (1 + 1j * omega)
    chord = np.abs(1 + 3 * g) / np.sqrt((1 + np.abs(g) ** 2) * 10)
    assert rp.uncertain.ncf_margin(plant, -3.0) == pytest.approx(chord.min(), rel=1e-4)
    assert rp.uncertain.ncf_margin(plant, -6.0) == 0


def test_bad_arguments_are_named():
    G = control.tf([2], [1, -1])
    with pytest.raises(rp.InvalidInputError, match="sign: got 0"):
        rp.uncertain.ncf_margin(G, 1.0, sign=0)
    with pytest.raises(rp.InvalidInputError, match="controller: got shape"):
        rp.uncertain.ncf_margin(G, np.eye(2))
    with pytest.raises(rp.InvalidInputError, match="plant: got None"):
        rp.uncertain.ncf_margin(None, 1.0)


GRID = np.concatenate([[0.0], np.geomspace(1e-5, 1e5, 20001)])


def tf(num, den):
    return control.tf(num, den)


def chordal(P1, P2, points):
    """Return the largest chordal distance on a grid of two systems of any size."""
    worst = 0.0
    for s in points:
        a, b = np.atleast_2d(P1(s)), np.atleast_2d(P2(s))
        left = np.linalg.inv(np.linalg.cholesky(np.eye(len(b)) + b @ b.conj().T))
        right = np.linalg.inv(np.linalg.cholesky(np.eye(a.shape[1]) + a.conj().T @ a)).conj().T
        worst = max(worst, np.linalg.norm(left @ (a - b) @ right, 2))
    return worst


def by_turns(P1, P2):
    """Tell by a grid whether det(I + P2* P1) turns as often as Vinnicombe asks for.

    wno + (open right poles of P1) - (those of P2) = 0, for plants without poles on the axis.
    """
    omega = np.concatenate([-GRID[:0:-1], GRID])
    values = []
    for w in omega:
        a, b = np.atleast_2d(P1(1j * w)), np.atleast_2d(P2(1j * w))
        values.append(np.linalg.det(np.eye(a.shape[1]) + b.conj().T @ a))
    turns = np.angle(np.array(values[1:]) / np.array(values[:-1])).sum() / (2 * np.pi)
    # Plants here have D = 0, so that the determinant closes at 1; upwards along the axis is
    # clockwise around the right half plane.
    right = [int((P.poles().real > 0).sum()) for P in (P1, P2)]
    return round(-turns) + right[0] - right[1] == 0


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        # MATLAB's documentation of gapmetric and of ncfmargin
        (tf([1], [1, -0.001]), tf([1], [1, 0.001]), 0.0020),
        (tf([1, 2], [1, 5, 10]), tf([1, 1], [1, 3, 10]), 0.1390),
        # Vinnicombe's plants, alike in a loop however different alone, and the other way round
        (tf([100], [2, 1]), tf([100], [2, -1]), 0.0200),
        (tf([100], [2, 1]), tf([100], [1, 2, 1]), 0.8988),
        (tf([100], [2, -1]), tf([100], [1, 2, 1]), 0.8941),
    ],
)
def test_published_numbers(first, second, expected):
    assert rp.uncertain.nu_gap(first, second) == pytest.approx(expected, abs=6e-5)
    assert rp.uncertain.nu_gap(second, first) == pytest.approx(
        rp.uncertain.nu_gap(first, second), rel=1e-6
    )


@pytest.mark.parametrize(("a", "b"), [(0.0, 1.0), (2.0, 3.0), (-1.0, 1.0), (1.0, -1.0), (0.3, -5)])
def test_gains_have_the_chordal_distance(a, b):
    # No dynamics: det(1 + a b) must not vanish and turns never.
    expected = 1.0 if a * b == -1 else abs(a - b) / np.sqrt((1 + a * a) * (1 + b * b))
    assert rp.uncertain.nu_gap(tf([a], [1]), tf([b], [1])) == pytest.approx(expected)


def test_first_order_plants_in_closed_form():
    # k/(s+a) and k/(s-a): |P1 - P2|^2 = 4 a^2 k^2 / (w^2 + a^2)^2, largest chord at rest where
    # k > a: 2 a k / (a^2 + k^2); else the determinant turns: 1.
    for a, k in ((0.1, 1.0), (0.5, 2.0), (1.0, 1.0001)):
        found = rp.uncertain.nu_gap(tf([k], [1, a]), tf([k], [1, -a]))
        assert found == pytest.approx(2 * a * k / (a * a + k * k), rel=1e-6)
    assert rp.uncertain.nu_gap(tf([1.0], [1, 2.0]), tf([1.0], [1, -2.0])) == 1.0


@pytest.mark.parametrize(
    "kind", [kind if kind < 3 else pytest.param(kind, marks=pytest.mark.long) for kind in range(30)]
)
def test_random_plants_of_unequal_orders_against_grids(kind):
    rng = np.random.default_rng(kind)
    np.random.seed(kind)  # noqa: NPY002, which is what control.rss draws from
    size = int(rng.integers(1, 3))

    def plant(order):
        P = control.rss(order, size, size, strictly_proper=True)
        return control.ss(P.A + rng.uniform(-0.2, 1.5) * np.eye(order), P.B, P.C, 0)

    P1 = plant(int(rng.integers(1, 5)))
    P2 = plant(int(rng.integers(1, 5)))
    if kind % 2:
        P2 = control.ss(P1.A + 0.05 * rng.standard_normal(P1.A.shape), P1.B, P1.C, 0)
    expected = chordal(P1, P2, 1j * GRID[::10]) if by_turns(P1, P2) else 1.0
    assert rp.uncertain.nu_gap(P1, P2) == pytest.approx(expected, rel=2e-4)


def test_a_pole_on_the_axis():
    # 1/s and 1/(s + a): the distance at rest is that of infinity and 1/a.
    a = 0.2
    assert rp.uncertain.nu_gap(tf([1], [1, 0]), tf([1], [1, a])) == pytest.approx(
        a / np.sqrt(1 + a * a)
    )


def test_discrete_time_is_that_of_the_circle():
    rng = np.random.default_rng(4)
    A = 0.4 * rng.standard_normal((3, 3))
    P1 = control.ss(A, rng.standard_normal((3, 2)), rng.standard_normal((2, 3)), 0, 0.1)
    P2 = control.ss(0.97 * A, P1.B, P1.C, [[0, 0.1], [0, 0]], 0.1)
    points = np.exp(1j * np.linspace(0, np.pi, 2001))
    assert rp.uncertain.nu_gap(P1, P2) == pytest.approx(chordal(P1, P2, points), rel=1e-4)
    assert rp.uncertain.nu_gap(P1, P1) == pytest.approx(0, abs=1e-7)


def test_a_controller_keeps_what_the_gap_promises():
    P1, P2 = tf([1, 2], [1, 5, 10]), tf([1, 1], [1, 3, 10])
    K = rp.loop_shaping(P1).controller
    gap, margin = rp.uncertain.nu_gap(P1, P2), rp.uncertain.ncf_margin(P1, K)
    assert margin > gap
    assert np.arcsin(rp.uncertain.ncf_margin(P2, K)) >= np.arcsin(margin) - np.arcsin(gap) - 1e-9


def test_a_generalised_plant_stands_for_its_part_from_u_to_y():
    P1, P2 = tf([1, 2], [1, 5, 10]), tf([1, 1], [1, 3, 10])
    assert rp.uncertain.nu_gap(rp.GeneralizedPlant.from_loop(P1), P2) == pytest.approx(
        rp.uncertain.nu_gap(P1, P2)
    )


@pytest.mark.parametrize(
    ("first", "second", "told"),
    [
        ("G", tf([1], [1, 1]), "first: got 'G'"),
        (tf([1], [1, 1]), np.eye(2), "second: got 2 inputs and 2 outputs, expected 1 and 1"),
        (tf([1], [1, 1]), control.tf([1], [1, 0.5], 0.1), "second: got sampling time 0.1"),
        (control.tf([1], [1, 1], 0.1), control.tf([1], [1, 0.5], 0.1), "a pole at z = -1"),
        (
            rp.GeneralizedPlant(tf([1], [1, 1]), 1, 1).with_delay("u[0]", 1.0),
            tf([1], [1, 1]),
            "first: got a plant with delays",
        ),
    ],
)
def test_what_cannot_be_compared_is_named(first, second, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        rp.uncertain.nu_gap(first, second)


def test_a_hidden_unstable_mode_is_named():
    hidden = control.ss([[1.0, 0.0], [0.0, -1.0]], [[0.0], [1.0]], [[1.0, 1.0]], 0)
    with pytest.raises(rp.InfeasibleError):
        rp.uncertain.nu_gap(hidden, tf([1], [1, 1]))
