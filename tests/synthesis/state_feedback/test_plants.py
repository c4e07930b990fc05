"""State feedback of plants of all kinds: random, scaled, discrete, infeasible, malformed."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.problem.pole_regions import Disk, HalfPlane
from robustpolish.synthesis.state_feedback.state_feedback import state_feedback


def random_plant(seed, discrete=False, feedthrough=False, wild=False):
    rng = np.random.default_rng(seed)
    nx, nw, nu, nz = rng.integers(2, 8), rng.integers(1, 4), rng.integers(1, 3), rng.integers(1, 4)
    A = rng.normal(size=(nx, nx))
    if discrete:
        A *= 1.2 / np.abs(np.linalg.eigvals(A)).max()

    def units(count):
        return 10 ** rng.uniform(-3, 3, count) if wild else np.ones(count)

    x, u, t = units(nx), units(nu), 1.0 if discrete else units(1)[0]
    return rp.GeneralizedPlant.from_matrices(
        A * x[:, None] / x / t,
        rng.normal(size=(nx, nw)) * x[:, None] / t,
        rng.normal(size=(nx, nu)) * x[:, None] * u / t,
        rng.normal(size=(nz, nx)) / x,
        np.eye(nx),
        0.3 * rng.normal(size=(nz, nw)) if feedthrough else None,
        dt=0.1 if discrete else 0,
    ), 1 / u


def independent_norm(plant, F, weight, norm, discrete):
    """The norm of (z, weight u), from the loop's matrices."""
    import control

    loop = control.ss(
        plant.A + plant.B2 @ F,
        plant.B1,
        np.vstack([plant.C1, weight[:, None] * F]),
        np.vstack([plant.D11, np.zeros((plant.nu, plant.nw))]),
        plant.dt,
    )
    poles = loop.poles()
    assert (np.abs(poles) < 1).all() if discrete else (poles.real < 0).all()
    return float(rp.hinf_norm(loop) if norm == "hinf" else rp.h2_norm(loop))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("discrete", [False, True])
def test_random_plants(seed, discrete):
    feedthrough = seed % 3 == 1
    plant, unit = random_plant(seed, discrete, feedthrough, wild=seed % 2 == 1)
    # The H2 norm is infinite with D11 in continuous time.
    norms = ("hinf",) if feedthrough and not discrete else ("hinf", "h2")
    weight = 0.5 * unit
    for norm in norms:
        achieved, designs = [], []
        for method in ("riccati", "lmi"):
            design = state_feedback(plant, norm, method, control_weight=weight)
            assert design.certificate.valid
            truth = independent_norm(plant, design.gain, weight, norm, discrete)
            assert design.certificate.achieved == pytest.approx(truth, rel=1e-4)
            assert truth <= design.certificate.claimed * (1 + 1e-4)
            achieved.append(truth)
            designs.append(design)
        # On many of these plants the H-infinity infimum is a limit of gains beyond 1e9. There
        # rounding, which differs between processors, decides whether a program is solved (plant 3:
        # 0.0016 above the optimum on one of them, 0.0123 on another); what is not optimal has to
        # say so.
        near = 1e-3 if norm == "hinf" else 1e-5
        if norm == "hinf" and designs[1].status == "suboptimal":
            near = 2e-2
        assert achieved[0] == pytest.approx(achieved[1], rel=near)
        assert max(d.lower_bound or 0.0 for d in designs) <= min(achieved) * (1 + 1e-6)


@pytest.mark.parametrize("norm", [pytest.param("hinf", marks=pytest.mark.long), "h2"])
def test_discrete_region_and_bound(norm):
    plant, unit = random_plant(5, discrete=True)
    held = state_feedback(plant, norm, control_weight=unit, pole_region=Disk(0.2, 0.6))
    poles = np.linalg.eigvals(plant.A + plant.B2 @ held.gain)
    assert Disk(0.2, 0.6).contains(poles)
    free = state_feedback(plant, norm, "riccati", control_weight=unit)
    bound = 0.95 * np.linalg.norm(free.gain, 2)
    bounded = state_feedback(plant, norm, control_weight=unit, gain_bound=bound)
    assert np.linalg.norm(bounded.gain, 2) <= bound
    assert bounded.certificate.achieved >= free.certificate.achieved * (1 - 1e-4)


def test_unstabilisable_mode_is_named():
    plant = rp.GeneralizedPlant.from_matrices(
        np.diag([0.6, -1.0]),
        np.ones((2, 1)),
        [[0.0], [1.0]],
        np.eye(2),
        np.eye(2),
        states=["drift", "decay"],
    )
    for method in ("lmi", "riccati"):
        with pytest.raises(rp.InfeasibleError, match=r"0\.6 .*drift") as caught:
            state_feedback(plant, "hinf", method, control_weight=1.0)
        assert caught.value.modes == pytest.approx((0.6,))


def test_uncontrollable_stable_mode_is_no_obstacle():
    plant = rp.GeneralizedPlant.from_matrices(
        np.diag([0.6, -1.0]), np.ones((2, 1)), [[1.0], [0.0]], np.eye(2), np.eye(2)
    )
    norms = [
        state_feedback(plant, "hinf", m, control_weight=1.0).certificate.achieved
        for m in ("lmi", "riccati")
    ]
    assert norms[0] == pytest.approx(norms[1], rel=1e-4)


def test_h2_with_feedthrough_is_infeasible():
    plant = rp.GeneralizedPlant.from_matrices(
        [[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], D11=[[0.5]]
    )
    with pytest.raises(rp.InfeasibleError, match="D11"):
        state_feedback(plant, "h2", control_weight=1.0)


PLANT = rp.GeneralizedPlant.from_matrices([[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])


@pytest.mark.parametrize(
    ("argument", "options"),
    [
        ("norm", {"norm": "h3"}),
        ("method", {"method": "magic"}),
        ("backend", {"backend": "matlab"}),
        ("control_weight", {"control_weight": [1.0, 2.0]}),
        ("control_weight", {"control_weight": np.nan}),
        ("control_weight", {"control_weight": -1.0}),
        ("gain_bound", {"gain_bound": 0.0}),
        ("gain_bound", {"gain_bound": np.inf}),
        ("tolerance", {"tolerance": -1e-3}),
        ("time_limit", {"time_limit": 0}),
        ("pole_region", {"pole_region": "left"}),
        ("pole_region", {"pole_region": HalfPlane(-1.0), "method": "riccati"}),
        ("pole_region", {"pole_region": HalfPlane(-1.0), "gain_bound": 3.0}),
        ("solver", {"solver": "NONE", "control_weight": 1.0}),
    ],
)
def test_bad_arguments_are_named(argument, options):
    with pytest.raises(rp.InvalidInputError, match=rf"^{argument}: got .*expected"):
        state_feedback(PLANT, **options)


def test_a_plant_is_required():
    with pytest.raises(rp.InvalidInputError, match=r"^plant: got StateSpace"):
        state_feedback(PLANT.open_loop)
