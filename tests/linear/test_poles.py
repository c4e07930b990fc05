"""Stability, modes and zeros."""

import control
import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.linear.modes import modes
from robustpolish.linear.norms.hinf import zeros_on_axis
from robustpolish.linear.stability import stability
from robustpolish.polishing.air_bearing import AirBearingParameters, air_bearing

# The stability decision at and around the boundary.


def ss(A, dt=0):
    n = len(A)
    return control.StateSpace(
        A, np.zeros((n, 1)), np.zeros((1, n)), 0, dt, remove_useless_states=False
    )


@pytest.mark.parametrize("rate", [1e-9, 1.0, 1e17])
@pytest.mark.parametrize(("damping", "verdict"), [(1, "stable"), (0, "marginal"), (-1, "unstable")])
def test_a_damping_ratio_far_below_rounding_is_decided(rate, damping, verdict):
    w = float(2.0 ** np.round(np.log2(rate)))  # so that w * w is exact
    A = np.array([[0, w], [-w, -damping * 1e-25 * w]])
    result = stability(ss(A))
    assert result.verdict == verdict
    assert bool(result) is (verdict == "stable")
    assert result.exact


@pytest.mark.parametrize("dt", [0, 1.0])
def test_defective_poles_at_the_boundary(dt):
    jordan = np.diag(np.ones(3), 1)
    edge = 1.0 if dt else 0.0
    for shift, verdict in ((-1e-10, "stable"), (0, "marginal"), (1e-10, "unstable")):
        assert stability(ss(jordan + (edge + shift) * np.eye(4), dt)).verdict == verdict


def test_poles_at_minus_one_are_on_the_circle():
    assert stability(ss(np.diag([-1.0, 0.5]), True)).pole == -1
    assert stability(ss(np.diag([-1.0, 0.5]), True)).verdict == "marginal"


def test_symmetric_real_pairs_are_not_taken_for_axis_poles():
    result = stability(ss(np.diag([1e-18, -1e-18, -1.0])))
    assert result.verdict == "unstable"
    assert result.pole == pytest.approx(1e-18)


# Modes.


def test_the_modes_of_the_thesis():
    plant = air_bearing(AirBearingParameters.as_published(), dissipation=0.001)
    found = modes(plant.open_loop)
    assert found.frequencies_hz == pytest.approx(
        [194.0691, 194.0691, 2069.58, 2069.58, 2824.58, 4610.75], rel=2e-6
    )
    expected = [7.93745e-5, 7.93745e-5, 8.17425e-5, 8.17425e-5, 5.78604e-5, 1.99226e-5]
    assert found.damping_ratios == pytest.approx(expected, rel=5e-6)
    names = [mode.state.removeprefix("d") for mode in found]
    assert names == ["x", "y", "x_m", "y_m", "z", "z_m"]


@pytest.mark.parametrize("zeta", [1e-15, 1e-12, 0.3])
@pytest.mark.parametrize("w", [1e-9, 1e9])
def test_any_damping_at_any_frequency(zeta, w):
    w = float(2.0 ** np.round(np.log2(w)))
    G = control.ss([[0, 1], [-w * w, -2 * zeta * w]], [[0], [1]], [[1, 0]], 0)
    (mode,) = modes(G)
    assert mode.damping_ratio == pytest.approx(zeta, rel=1e-12)
    assert mode.natural_frequency_hz == pytest.approx(w / 2 / np.pi, rel=1e-14)
    assert mode.frequency_hz == pytest.approx(w * np.sqrt(1 - zeta**2) / 2 / np.pi, rel=1e-14)


def test_sampled_modes_are_those_of_the_continuous_system():
    G = control.ss([[0, 1], [-100, -2]], [[0], [1]], [[1, 0]], 0)
    (before,), (after,) = modes(G), modes(control.sample_system(G, 0.01))
    assert after.frequency_hz == pytest.approx(before.frequency_hz)
    assert after.damping_ratio == pytest.approx(before.damping_ratio)


def test_real_unstable_and_zero_eigenvalues():
    G = control.ss(np.diag([0.0, 2.0, -3.0]), np.ones((3, 1)), np.ones((1, 3)), 0)
    zero, unstable, stable = modes(G)
    assert np.isnan(zero.damping_ratio)
    assert (unstable.damping_ratio, stable.damping_ratio) == (-1, 1)
    assert (unstable.state, stable.state) == ("x[1]", "x[2]")
    assert unstable.frequency_hz == 0


# Zeros on the stability boundary.


@pytest.mark.parametrize("rate", [1e-6, 1.0, 1e6])
def test_a_notch(rate):
    A = np.array([[0, 1], [-1, -1]]) * rate
    G = control.StateSpace(A, [[0], [rate]], [[3, -1]], 1)
    (zero,) = zeros_on_axis(G)
    assert zero.frequency == pytest.approx(2 * rate)


def test_differentiators_and_integrators():
    assert zeros_on_axis(control.ss([[0, 1], [-1, -1]], [[0], [1]], [[0, 1]], 0))[0].frequency == 0
    assert zeros_on_axis(control.ss([[0, 1], [0, 0]], [[0], [1]], [[1, 0]], 0)) == ()


def test_a_zero_that_rounding_tells_from_the_origin():
    A = [[0, 1, 0], [-4, -1e-14, 0.1], [0, 0, -1]]  # at -1e-14
    (zero,) = zeros_on_axis(control.ss(A, [[1], [0], [0]], [[1, 0, 0]], 0))
    assert zero.frequency == 0


def test_more_outputs_than_inputs():
    A, B = [[0, 1, 0], [-1, -1, 0], [0, 0, -2]], [[0], [1], [1]]
    common = [[0, 1, 0], [0, 2, 0]]  # both outputs vanish at zero frequency
    assert len(zeros_on_axis(control.ss(A, B, common, [[0], [0]]))) == 1
    assert zeros_on_axis(control.ss(A, B, [[0, 1, 0], [0, 0, 1]], [[0], [0]])) == ()


def test_zeros_off_the_axis_and_no_signals():
    assert zeros_on_axis(control.ss([[-1]], [[1]], [[1]], 1)) == ()
    assert zeros_on_axis(control.ss(np.eye(2), np.zeros((2, 0)), np.eye(2), np.zeros((2, 0)))) == ()
    with pytest.raises(InvalidInputError, match="tolerance"):
        zeros_on_axis(control.ss([[-1]], [[1]], [[1]], 1), tolerance=0)


@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("tiny", [2.0**-40, -(2.0**-40)])
def test_the_margin_beside_an_exact_verdict_is_exact(tiny, discrete):
    # In skew coordinates, which are exact, doubles lose a pole so near the boundary.
    A = np.diag([0.0, 0.0, 0.5, -0.25]) if discrete else np.diag([0.0, 0.0, -3.0, -4.0])
    A[:2, :2] = [[1.5, tiny - 1], [1, 0]] if discrete else [[-tiny, 2], [-2, 0]]
    rng = np.random.default_rng(1)
    left, right = (np.eye(4) + np.tril(rng.integers(-3, 4, (4, 4)), -1) for _ in range(2))
    skew = left @ right.T
    result = stability(ss(np.round(np.linalg.inv(skew)) @ A @ skew, 1.0 if discrete else 0))
    # |p|^2 = 1 - tiny; or p^2 + tiny p + 4 = 0
    want = tiny / (1 + np.sqrt(1 - tiny)) if discrete else tiny / 2
    assert result.exact
    assert result.margin == pytest.approx(want, rel=1e-9, abs=0)
    assert result.verdict == ("stable" if tiny > 0 else "unstable")
