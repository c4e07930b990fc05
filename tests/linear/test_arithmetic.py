"""Balls, powers of two and rational numbers: nothing is rounded unseen."""

import control
import flint
import numpy as np
import pytest
from flint import fmpq_mat
from scipy.linalg import lapack

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.linear.arithmetic import powers_of_two as exponents
from robustpolish.linear.arithmetic import rational as kit
from robustpolish.linear.arithmetic.balls import (
    ball,
    identity,
    independent_first,
    magnitude,
    midpoint,
    part,
    precision,
)
from robustpolish.linear.arithmetic.balls import scaled as scaled_ball
from robustpolish.linear.arithmetic.even_units import balance
from robustpolish.linear.arithmetic.powers_of_two import FloatRangeError, bracket, scaled
from robustpolish.linear.arithmetic.rational import rational, reachable
from robustpolish.linear.arithmetic.realisation import (
    Realisation,
    realisation,
    rescaled,
    size,
)

# Matrices that carry proven bounds on their rounding errors.


def test_the_precision_is_restored_even_by_an_error():
    before = flint.ctx.prec
    with pytest.raises(ZeroDivisionError), precision(999):
        assert flint.ctx.prec == 999
        raise ZeroDivisionError
    assert flint.ctx.prec == before


def test_a_sum_in_balls_holds_the_exact_one():
    """(1 + 2^-80) - 1 is lost in doubles and kept, or covered by the radius, in balls."""
    for bits in (53, 200):
        with precision(bits):
            tiny = ball([[2.0**-80]])
            rest = identity(1) + tiny - identity(1)
            assert rest[0, 0].contains(flint.arb(2) ** -80)
            assert magnitude(rest)[0, 0] >= 2.0**-80


def test_rows_and_columns_are_scaled_without_rounding():
    M = ball(np.array([[1.0, 3.0], [0.1, -7.0], [1e300, 5e-324]]))
    rows, columns = np.array([2.0**900, 0.5, 1.0]), np.array([2.0**900, 2.0**-10])
    found = scaled_ball(M, rows, columns)
    product = ball(np.diag(rows)) * M * ball(np.diag(columns))
    assert all(entry.is_exact() for entry in found.entries())
    assert all(a == b for a, b in zip(found.entries(), product.entries(), strict=True))


# Rank and dependence of columns in ball arithmetic.


@pytest.mark.parametrize("rank", [0, 1, 2, 3])
def test_dependent_columns_vanish(rank):
    rng = np.random.default_rng(rank)
    # Whole numbers: the product is exact.
    M = rng.integers(-9, 10, (5, rank)).astype(float) @ rng.integers(-9, 10, (rank, 3))
    with precision(300):
        turn, found = independent_first(ball(M))
        turned = ball(M) * turn
        assert found == rank
        assert np.linalg.matrix_rank(midpoint(turned)[:, :rank], tol=1e-9) == rank
        assert all(entry.contains(0) for entry in part(turned, columns=slice(rank, None)).entries())
        assert np.linalg.matrix_rank(midpoint(turn)) == 3


def test_what_doubles_call_nothing_counts():
    with precision(300):
        _, rank = independent_first(ball(np.array([[1.0, 1.0], [0.0, 1e-60]])))
    assert rank == 2


# Balancing.


@pytest.mark.parametrize("seed", range(10))
def test_states_are_balanced_as_by_lapack(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 9))
    A = rng.standard_normal((n, n)) * 10.0 ** rng.uniform(-9, 9, (n, n))
    A *= rng.random((n, n)) < (1.0, 0.4)[seed % 2]
    rows, columns = np.zeros((2, n), np.int64)
    found = A.copy()
    balance(found, n, rows, columns, False)
    expected, _, _, scales, _ = lapack.dgebal(A, scale=1, permute=0)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(np.ldexp(1.0, columns), scales)
    np.testing.assert_array_equal(rows, -columns)


# Powers of two as factors.


def test_factors_whose_product_no_double_holds():
    M = np.array([[3.0, -0.1], [0.0, 1e-300]])
    assert np.array_equal(scaled(M, 2.0**1000, 2.0**1000, 2.0**-1000, 2.0**-1001), M / 2)


@pytest.mark.parametrize(
    ("value", "factor"),
    [(1e300, 2.0**100), (1e-300, 2.0**-100), (3 * 2.0**-1074, 0.5), (1.0, 0.0), (1.0, np.inf)],
)
def test_what_would_be_lost_is_refused(value, factor):
    # Overflow, underflow, a lost bit of a denormal number, and factors that are none.
    with pytest.raises(FloatRangeError):
        scaled(np.array([[value]]), factor)


def test_bounds_enclose_below_normal_doubles():
    value, lower, upper = bracket(3.0, 2.0, 4.0, 2.0**-1074)
    assert lower == 0.0
    assert upper == np.finfo(float).tiny
    assert 0.0 <= value <= upper
    assert bracket(0.0, 0.0, 0.0, 1.0) == (0.0, 0.0, 0.0)
    assert bracket(np.inf, np.inf, np.inf, 0.5) == (np.inf, np.inf, np.inf)
    with pytest.raises(FloatRangeError):
        bracket(1e300, 1e300, 1e300, 1e10)


def test_errors_name_the_entries():
    matrices = {"A": np.array([[1.0, 0.0]]), "B": np.array([[1e-120], [1e200]])}
    with (
        pytest.raises(rp.InvalidInputError, match=r"plant: got entries from 1e-120 \(B\[0, 0\]\)"),
        exponents.range_errors_as_input_errors("plant", matrices),
    ):
        raise FloatRangeError


@pytest.mark.parametrize("value", [1e101, 1e-101, np.inf, np.nan])
def test_extreme_matrices_are_refused(value):
    with pytest.raises(rp.InvalidInputError, match="units"):
        exponents.refuse_extreme("system", {"A": np.array([[value]])})


def test_small_entries_beside_ordinary_ones_pass():
    # exp(-500) in the transition of a fast pole is no mistake.
    exponents.refuse_extreme("system", {"A": np.diag([0.5, 7e-218]), "B": np.zeros((2, 1))})


# State-space matrices in scaled units.


def badly_scaled(dt=0):
    rng = np.random.default_rng(0)
    units = 10.0 ** rng.integers(-6, 7, 4)
    A = (rng.standard_normal((4, 4)) - 3 * np.eye(4)) * units / units[:, None]
    A = A * (0.1 if dt else 1e5)
    B, C = rng.standard_normal((4, 2)) / units[:, None] * 1e8, rng.standard_normal((3, 4)) * units
    return control.ss(A, B, C, rng.standard_normal((3, 2)), dt)


@pytest.mark.parametrize("dt", [0, 0.25])
def test_the_gain_is_the_same_in_other_units(dt):
    system = badly_scaled(dt)
    model = rescaled(realisation("system", system))
    for x in (0.3, 2.0):
        point = np.exp(1j * x) if dt else 1j * x
        G = model.C @ np.linalg.solve(point * np.eye(4) - model.A, model.B) + model.D
        original = system(np.exp(1j * x) if dt else 1j * x * model.time)
        np.testing.assert_allclose(G * model.gain, original, rtol=1e-9)
    assert 0.25 < size(model.B) < 4
    assert 0.25 < size(model.C) < 4


@pytest.mark.parametrize("seed", range(20))
def test_nothing_is_rounded(seed):
    rng = np.random.default_rng(seed)
    n, spread = 4, (3, 40)[seed % 2]

    def wide(*shape):
        return rng.standard_normal(shape) * 10.0 ** rng.uniform(-spread, spread, shape)

    given = Realisation(wide(n, n), wide(n, 2), wide(3, n), wide(3, 2), seed % 3 == 0)
    found = rescaled(given)
    for name, M in found.matrices.items():
        assert (np.frexp(np.abs(M / given.matrices[name]))[0] == 0.5).all()
        assert M.flags.c_contiguous
    for power in (found.time, found.gain):
        assert np.frexp(power)[0] == 0.5
    assert found.time == 1.0 or not given.discrete


def test_what_would_lose_bits_is_refused():
    A = np.array([[-1e300, 1e-20], [1e-20, -1e300]])  # over 1e300 no double holds 1e-20
    one = np.ones((2, 2))
    with pytest.raises(InvalidInputError, match="double precision can hold"):
        rescaled(Realisation(A, one, one, 0 * one, False))


# Hidden modes split off exactly.


def hidden_behind(seed, n, lost, inputs):
    """Whole numbers in which `lost` states are out of reach in mixed coordinates."""
    rng = np.random.default_rng(seed)
    A, B, C = (rng.integers(-5, 6, shape) for shape in ((n, n), (n, inputs), (2, n)))
    A[:lost, lost:], B[:lost] = 0, 0
    lower, upper = (np.tril(rng.integers(-2, 3, (n, n)), -1) + np.eye(n) for _ in range(2))
    T = fmpq_mat(rational(lower) * rational(upper.T))  # its determinant is one
    back = T.inv()
    return T * rational(A * 1.0) * back, T * rational(B * 1.0), rational(C * 1.0) * back


@pytest.mark.parametrize(("n", "lost", "inputs"), [(1, 1, 1), (4, 1, 2), (9, 3, 1), (12, 11, 3)])
def test_the_reachable_part_keeps_the_transfer_matrix(n, lost, inputs):
    for seed in range(5):
        A, B, C = hidden_behind(seed, n, lost, inputs)
        Ar, Br, Cr = reachable(A, B, C)
        assert Ar.nrows() <= n - lost
        assert reachable(Ar, Br, Cr)[0].nrows() == Ar.nrows()
        power, small = B, Br
        for _ in range(n + 1):  # the Markov parameters agree exactly
            assert C * power == Cr * small
            power, small = A * power, Ar * small


def test_an_unlucky_prime_changes_nothing(monkeypatch):
    A, B = rational(np.array([[1.0, 0], [7, 2]])), rational(np.array([[1.0], [0]]))
    C = rational(np.eye(2))
    monkeypatch.setattr(kit, "_PRIME", 7)  # modulo 7 the second state is out of reach
    assert reachable(A, B, C) == (A, B, C)


def test_a_large_system_with_a_hidden_mode_is_settled():
    rng = np.random.default_rng(40)  # by elimination of fractions it took minutes
    A, B = rng.standard_normal((40, 40)), rng.standard_normal((40, 2))
    A[0, 1:], B[0] = 0, 0
    Ar, _, _ = reachable(rational(A), rational(B), rational(np.eye(40)))
    assert Ar == rational(A[1:, 1:])
