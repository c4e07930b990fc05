"""Fixed modes are named, and no others; prices and noises, and the channels they join."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.certificate import boundaries, violated_regions
from robustpolish.synthesis.problem.pole_regions import Disk, HalfPlane, PoleRegion, Sector
from robustpolish.synthesis.problem.preflight import check_solvability


def integrator_behind_a_lag(seed=17):
    """Some dynamics, an actuator with a lag, and an integrator of the error, in mixed states."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    lag = 10 ** rng.uniform(3, 8)
    inner = rng.standard_normal((n, n))
    inner -= (np.linalg.eigvals(inner).real.max() + 0.1) * np.eye(n)
    inner *= 10 ** rng.uniform(0, 2)
    N = n + 2
    A, B2, C = np.zeros((N, N)), np.zeros((N, 1)), np.zeros((1, N))
    A[:n, :n], A[:n, n], A[n, n] = inner, rng.standard_normal(n), -lag
    A[-1, :n], B2[n], C[0, -1] = rng.standard_normal(n), lag, 1
    T = rng.standard_normal((N, N)) + 2 * np.eye(N)
    back = np.linalg.inv(T)
    B1 = np.hstack([rng.standard_normal((N, 1)), np.zeros((N, 1))])
    return rp.GeneralizedPlant.from_matrices(
        T @ A @ back,
        T @ B1,
        T @ B2,
        np.vstack([C, 0 * C]) @ back,
        C @ back,
        D12=[[0], [0.1]],
        D21=[[0, 0.1]],
    )


@pytest.mark.parametrize("seed", [17, 21, 23, 39])
def test_an_integrator_behind_a_fast_lag_is_not_fixed(seed):
    assert check_solvability(integrator_behind_a_lag(seed)).fixed_modes == ()


def test_a_method_that_fails_does_not_blame_the_integrator():
    plant = integrator_behind_a_lag()
    assert rp.output_feedback(plant).certificate.valid
    try:
        design = rp.output_feedback(plant, method="slycot")
    except rp.SolverError as error:
        assert "No controller stabilises" not in str(error)  # noqa: PT017 it may succeed as well
    else:
        assert design.certificate.valid


def test_a_slow_stable_mode_out_of_reach_is_no_obstacle():
    # Beside rates of 1e8 rounding could make it unstable, but it is stable as it stands.
    A = np.diag([-1e8, -0.15, 0.0])
    A[2, 0] = 1.0
    plant = rp.GeneralizedPlant.from_matrices(
        A, [[0], [1], [1]], [[1e8], [1e-14], [0]], [[0, 1, 1]], [[0, 0, 1]]
    )
    assert check_solvability(plant).fixed_modes == ()


@pytest.mark.parametrize("dt", [0, 0.1])
def test_modes_that_are_fixed_are_named_with_their_state(dt):
    A = np.diag([1.2, 0.5, -0.5])
    plant = rp.GeneralizedPlant.from_matrices(
        A,
        np.ones((3, 1)),
        [[0], [1], [1]],
        np.ones((1, 3)),
        [[1, 0, 1]],
        dt=dt,
        states=["drift", "lag", "other"],
    )
    modes = check_solvability(plant).fixed_modes
    told = {(mode.lack, mode.state) for mode in modes}
    expected = {("uncontrollable", "drift")} | ({("unobservable", "lag")} if not dt else set())
    assert told == expected
    assert all(mode.exact for mode in modes)
    with pytest.raises(rp.InfeasibleError, match=r"uncontrollable mode \+1\.2 \(state drift\)"):
        rp.output_feedback(plant)


def test_a_mode_fixed_to_rounding_in_mixed_states_is_named():
    T = np.random.default_rng(5).standard_normal((3, 3)) + 2 * np.eye(3)
    back = np.linalg.inv(T)
    plant = rp.GeneralizedPlant.from_matrices(
        T @ np.diag([1.2, -0.5, -0.7]) @ back,
        T @ np.ones((3, 1)),
        T @ [[0], [1], [1]],
        np.ones((1, 3)) @ back,
        np.ones((1, 3)) @ back,
    )
    (mode,) = check_solvability(plant).fixed_modes
    assert mode.eigenvalue == pytest.approx(1.2)
    assert mode.lack == "uncontrollable"


# Pole regions: the matrix description says the same as the geometry.


POLES = np.random.default_rng(0).normal(size=200) * 5 + 3j * np.random.default_rng(1).normal(
    size=200
)


def geometry(region, s):
    if isinstance(region, HalfPlane):
        return s.real < region.max_real
    if isinstance(region, Disk):
        return abs(s - region.center) < region.radius
    seen = s - region.apex
    return seen.real < 0 and -seen.real / abs(seen) > region.damping


@pytest.mark.parametrize("region", [HalfPlane(-1.0), Disk(-4.0, 3.5), Sector(0.6), Sector(0.3, -1)])
def test_matrix_form_matches_geometry(region):
    assert isinstance(region, PoleRegion)
    for s in POLES:
        assert region.contains(s) == geometry(region, s)
    scaled = region.in_unit_of_time(0.01)
    assert all(scaled.contains(0.01 * s) == region.contains(s) for s in POLES)


@pytest.mark.parametrize(
    ("make", "argument"),
    [
        (lambda: HalfPlane(np.nan), "max_real"),
        (lambda: Disk(0.0, -1.0), "radius"),
        (lambda: Disk("a", 1.0), "center"),  # pyright: ignore[reportArgumentType]
        (lambda: Sector(1.5), "damping"),
        (lambda: Sector(0.0), "damping"),
        (lambda: Sector(0.5, np.inf), "apex"),
    ],
)
def test_bad_regions_are_refused(make, argument):
    with pytest.raises(rp.InvalidInputError, match=rf"^{argument}: got"):
        make()


def test_a_tolerance_counts_relative_to_the_size_of_the_terms():
    region = Disk(-1000.0, 900.0)
    assert not region.contains(-99.9)
    assert region.contains(-99.9, tolerance=1e-3)
    assert not region.contains(-50.0, tolerance=1e-3)
    assert region.contains([])


def test_regions_that_are_missed_are_named():
    regions = HalfPlane(-1.0), Disk(-4.0, 2.0)
    assert violated_regions(regions, [-3.0, -5.0]) == []
    assert violated_regions(regions, [-1.5]) == [
        "a pole lies outside Disk(center=-4.0, radius=2.0)"
    ]
    assert len(violated_regions(regions, [0.0])) == 2
    drawn = boundaries(regions)
    assert list(drawn) == [f"outside {region}" for region in regions]
    for region, (L, M) in zip(regions, drawn.values(), strict=True):
        np.testing.assert_array_equal(L, region.L)
        np.testing.assert_array_equal(M, region.M)
