"""Norms in doubles, against textbook peaks and the norm in exact arithmetic."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.proofs import achieved_norm as module
from robustpolish.synthesis.proofs.achieved_norm import estimate_norm, state_scale


def test_a_narrow_resonance_beside_a_broad_one():
    A = np.zeros((4, 4))
    A[:2, :2] = [[0.0, 1.0], [-1.0, -0.2]]  # peaks with 5
    A[2:, 2:] = [[0.0, 1.0], [-1e4, -2e-4]]  # peaks with 50
    B = np.array([[0.0], [1.0], [0.0], [1.0]])
    found = estimate_norm(
        A, B, np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]), np.zeros((2, 1))
    )
    assert found.settled
    assert found.value == pytest.approx(50.0, rel=1e-5)
    assert found.frequency == pytest.approx(100.0, rel=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_random_systems_in_wild_units(seed):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((6, 6))
    A -= (np.linalg.eigvals(A).real.max() + 0.01) * np.eye(6)
    unit = 10.0 ** rng.uniform(-6, 6, 6)
    system = (
        A * unit / unit[:, None],
        rng.standard_normal((6, 2)) / unit[:, None],
        rng.standard_normal((3, 6)) * unit,
        rng.standard_normal((3, 2)),
    )
    exact = rp.hinf_norm(control.StateSpace(*system))
    found = estimate_norm(*system)
    assert found.settled
    assert exact.lower * (1 - 2e-6) <= found.value <= exact.upper * (1 + 1e-9)


def test_peaks_at_both_ends_of_the_frequencies():
    lag = np.array([[-2.0]]), np.array([[1.0]])
    assert estimate_norm(*lag, np.array([[6.0]]), np.zeros((1, 1)))[:2] == pytest.approx((3.0, 0.0))
    # 3 s/(s + 2)
    high = estimate_norm(*lag, np.array([[-6.0]]), np.array([[3.0]]))
    assert high[:2] == (pytest.approx(3.0, rel=1e-6), np.inf)
    nothing = np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0))
    assert estimate_norm(*nothing, np.diag([3.0, -4.0])) == (4.0, np.inf, True)


def test_a_pole_on_the_axis_has_no_norm():
    one = np.eye(1)
    assert estimate_norm(np.zeros((1, 1)), one, one, np.zeros((1, 1)))[::2] == (np.inf, False)


def test_scales_even_out_units_and_are_powers_of_two():
    rng = np.random.default_rng(0)
    unit = 10.0 ** rng.uniform(-8, 8, 5)
    A = rng.uniform(1, 2, (5, 5)) * unit / unit[:, None]
    B, C = rng.uniform(1, 2, (5, 1)) / unit[:, None], rng.uniform(1, 2, (1, 5)) * unit
    scale = state_scale(A, B, C)
    assert (np.exp2(np.round(np.log2(scale))) == scale).all()
    even = A * scale / scale[:, None]
    assert np.abs(even).max() < 16 * np.abs(even).min()


@pytest.mark.parametrize("seed", range(3))
def test_many_states_have_the_norm_of_the_proven_bracket(seed):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((60, 60))
    A -= (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(60)
    B, C, D = rng.standard_normal((60, 2)), rng.standard_normal((3, 60)), np.ones((3, 2))
    found = estimate_norm(A, B, C, D)
    proven = rp.hinf_norm(control.StateSpace(A, B, C, D))
    assert found.settled
    assert found.value == pytest.approx(proven.value, rel=1e-9)
    assert found.frequency == pytest.approx(proven.frequency, rel=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_a_peak_that_modes_leave_in_doubt_is_settled_by_the_hamiltonian(monkeypatch, seed):
    monkeypatch.setattr(module, "_WIDEST", 0.0)  # every bracket is too wide
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((60, 60))
    A -= (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(60)
    B, C, D = rng.standard_normal((60, 2)), rng.standard_normal((3, 60)), np.ones((3, 2))
    looked = []

    def highest(*loop):
        looked.append(loop[4].size)
        return real(*loop)

    real = module._highest
    monkeypatch.setattr(module, "_highest", highest)
    found = estimate_norm(A, B, C, D)
    assert looked[0] == 1  # the peak of the modes, and no resonance
    assert found.settled
    proven = rp.hinf_norm(control.StateSpace(A, B, C, D))
    assert proven.lower * (1 - 2e-6) <= found.value <= proven.upper * (1 + 1e-9)
