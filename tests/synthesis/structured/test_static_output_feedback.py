"""Static and fixed-order output feedback: literature values, structure, refusals, time."""

import control
import numpy as np
import pytest
from hard_plants import rescaled
from published_plants import compleib
from small_plants import FULL, oscillator, two_masses

import robustpolish as rp
from robustpolish.errors import InfeasibleError, InvalidInputError, SolverError
from robustpolish.plants.plant import GeneralizedPlant

static_output_feedback, hinf_norm = rp.static_output_feedback, rp.hinf_norm

# Best published values (HIFOO, hinfstruct and searches), COMPleib names.
PUBLISHED = {
    "AC15": 15.19,
    "HF2D11": 7.72e4,
    "HE4": 22.84,
    "AC8": 2.01,
    "HE1": 0.154,
    "AC3": 3.61,
    "AC4": 0.937,
}


def check(design, norm="hinf"):
    """Recompute the norm by other means than the search."""
    assert design.certificate.valid
    loop = design.plant.closed_loop(design.controller)
    measured = float(hinf_norm(loop) if norm == "hinf" else rp.h2_norm(loop))
    # The certificate proves a bound; its estimate of the norm is good to a few 1e-5.
    assert measured == pytest.approx(design.certificate.achieved, rel=1e-4)
    assert (design.closed_loop.A == loop.A).all()


@pytest.mark.long
@pytest.mark.shared
@pytest.mark.parametrize("name", PUBLISHED)
def test_reaches_the_best_published_norms(shared, name):
    design = static_output_feedback(compleib(shared, name), time_limit=60.0)
    check(design)
    assert design.certificate.achieved <= PUBLISHED[name]
    assert design.elapsed < 61.0


@pytest.mark.shared
@pytest.mark.parametrize("name", ["HE1", "AC4", "AC8"])
def test_stops_at_a_target(shared, name):
    design = static_output_feedback(compleib(shared, name), target=1.001 * PUBLISHED[name])
    check(design)
    assert design.certificate.achieved <= 1.002 * PUBLISHED[name]


def test_structure_is_kept_and_costs():
    plant = two_masses(FULL)
    free = static_output_feedback(plant, time_limit=4)
    diagonal = static_output_feedback(plant, structure=np.eye(2, dtype=bool), time_limit=4)
    check(free)
    check(diagonal)
    assert diagonal.gain[0, 1] == diagonal.gain[1, 0] == 0
    assert free.certificate.achieved <= diagonal.certificate.achieved * 1.001


def test_state_measured_h2_equals_the_regulator():
    plant = two_masses(np.eye(4))
    design = static_output_feedback(plant, "h2", time_limit=4)
    check(design, "h2")
    X, _, _K = control.care(plant.A, plant.B2, plant.C1.T @ plant.C1, plant.D12.T @ plant.D12)
    best = np.sqrt(np.trace(plant.B1.T @ X @ plant.B1))
    assert design.certificate.achieved == pytest.approx(best, rel=1e-4)


@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_discrete_time(norm):
    plant = two_masses(FULL)
    sampled = control.c2d(plant.system, 0.1)
    discrete = GeneralizedPlant(sampled, 2, 2)
    design = static_output_feedback(discrete, norm, time_limit=3)
    check(design, norm)
    assert np.abs(design.certificate.poles).max() < 1
    assert design.controller.dt == 0.1


def test_d22_is_part_of_the_loop():
    plant = two_masses(FULL)
    D22 = np.array([[0.3, 0.0], [0.2, -0.1]])
    with_d22 = GeneralizedPlant.from_matrices(
        plant.A, plant.B1, plant.B2, plant.C1, plant.C2, D12=plant.D12, D22=D22
    )
    # Without a bound the infimum is a limit of loops through D22 that are nearly singular.
    design = static_output_feedback(with_d22, gain_bound=2.0)
    check(design)
    # u = K y with y = y0 + D22 u is u = K0 y0: the same infimum.
    K = design.gain
    same = np.linalg.solve(np.eye(2) - K @ D22, K)
    assert float(hinf_norm(plant.closed_loop(same))) == pytest.approx(
        design.certificate.achieved, rel=1e-6
    )


@pytest.mark.long
def test_fixed_order_stabilises_where_no_static_gain_does():
    # A double integrator with its position measured needs a derivative.
    plant = GeneralizedPlant.from_matrices(
        [[0, 1], [0, 0]], [[0], [1]], [[0], [1]], [[1, 0], [0, 0]], [[1, 0]], D12=[[0], [1]]
    )
    with pytest.raises(SolverError, match="No stabilising static gain"):
        static_output_feedback(plant, time_limit=3)
    design = static_output_feedback(plant, order=1, time_limit=20)
    check(design)
    assert design.controller.nstates == 1
    assert design.gain is None


def test_gain_bound_and_price():
    plant = two_masses(FULL)
    free = static_output_feedback(plant, time_limit=3)
    bounded = static_output_feedback(plant, gain_bound=2.0, time_limit=3)
    assert np.linalg.norm(bounded.gain, 2) <= 2.0 * (1 + 1e-8)
    assert bounded.certificate.achieved >= free.certificate.achieved * 0.999
    dear = static_output_feedback(plant, control_weight=10.0, time_limit=3)
    check(dear)
    assert dear.plant.performance_names[-2:] == ("price_u1", "price_u2")
    assert dear.details["plain_norm"] <= dear.certificate.achieved


def test_dynamic_gain_bound_holds_at_all_frequencies():
    plant = rp.air_bearing(actuation="force", measured="displacement")
    design = static_output_feedback(plant, order=1, gain_bound=1e5, time_limit=5)
    check(design)
    assert float(hinf_norm(design.controller)) <= 1e5 * (1 + 1e-6)


@pytest.mark.parametrize("actuation", ["displacement", "force"])
def test_thesis_plant_by_axes(actuation):
    plant = rp.air_bearing(actuation=actuation, measured="displacement")
    bound = 1e4 if actuation == "displacement" else 1e6
    design = static_output_feedback(plant, gain_bound=bound, time_limit=4)
    check(design)
    assert design.certificate.achieved < float(hinf_norm(plant.open_loop))
    parts = design.details["part_norms"]
    assert max(parts) == pytest.approx(design.certificate.achieved, rel=1e-6)
    # x and y are the same axis twice.
    assert (design.gain[:2, :2] == design.gain[2:4, 2:4]).all()
    assert not design.gain[:2, 2:].any()


def test_an_infimum_that_is_not_attained_is_said():
    design = static_output_feedback(lags([1.0], price=0.0))
    check(design)
    assert design.status == "infimum_not_attained"
    assert "gain_bound" in design.message
    assert design.lower_bound is None


def test_modes_that_stay_are_named():
    plant = GeneralizedPlant.from_matrices(
        np.diag([0.5, -1.0]), np.ones((2, 1)), [[0.0], [1.0]], [[1.0, 1.0]], [[1.0, 1.0]]
    )
    with pytest.raises(InfeasibleError, match=r"\+0\.5 rad/s \(state x1\)") as caught:
        static_output_feedback(plant)
    assert caught.value.modes == (0.5,)
    # The sensor of the unstable mode is joined to no actuator.
    both = plant.replace(B2=np.ones((2, 1)), C2=np.eye(2), measurements=["y1", "y2"])
    with pytest.raises(InfeasibleError, match="structure"):
        static_output_feedback(both, structure=[[0, 1]])


def test_h2_with_a_feedthrough_is_refused_or_cancelled():
    one = [[1.0]]
    plant = GeneralizedPlant.from_matrices([[-1.0]], one, one, one, one, D11=one, D21=one)
    with pytest.raises(InfeasibleError, match="none cancels the feedthrough D11"):
        static_output_feedback(plant, "h2")
    cancels = plant.replace(D12=np.ones((1, 1)))
    design = static_output_feedback(cancels, "h2")
    assert design.gain[0, 0] == pytest.approx(-1.0, abs=1e-12)
    with pytest.raises(InvalidInputError, match="Absorb D22"):
        static_output_feedback(cancels.replace(D22=np.ones((1, 1))), "h2")


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"norm": "h3"}, "norm"),
        ({"structure": np.ones((3, 3))}, "structure"),
        ({"order": -1}, "order"),
        ({"time_limit": 0}, "time_limit"),
        ({"target": -1.0}, "target"),
        ({"gain_bound": -1}, "gain_bound"),
        ({"control_weight": [1, 2, 3]}, "control_weight"),
        ({"measurement_noise": -1}, "measurement_noise"),
        ({"initial": np.eye(3)}, "initial"),
    ],
)
def test_bad_arguments_are_named(arguments, named):
    with pytest.raises(InvalidInputError, match=named):
        static_output_feedback(two_masses(FULL), **arguments)


def lags(rates, price=1.0):
    """X' = -a x + w + u for each rate a, z = x and the priced u, y = x.

    u = -k x: sqrt(1 + k^2)/(a + k) is least for k = 1/a: sqrt(1/(1 + a^2)).
    """
    eye = np.eye(len(rates))
    C1, D12 = np.vstack([eye, 0 * eye]), np.vstack([0 * eye, price * eye])
    return GeneralizedPlant.from_matrices(-np.diag(rates), eye, eye, C1, eye, D12=D12)


def test_optima_in_closed_form_are_reached_in_the_units_of_the_plant():
    unit, plant = 1e-6, lags([1.0])
    plant = plant.replace(C1=unit * plant.C1, D12=unit * plant.D12)
    free = static_output_feedback(plant, target=1.00007 * unit * np.sqrt(0.5))
    assert free.certificate.achieved == pytest.approx(unit * np.sqrt(0.5), rel=7.5e-5)
    assert free.gain.item() == pytest.approx(-1.0, abs=0.05)
    bounded = static_output_feedback(plant, gain_bound=0.5, time_limit=2.0)
    assert bounded.gain.item() == pytest.approx(-0.5, rel=1e-6)
    assert bounded.certificate.achieved == pytest.approx(unit * np.sqrt(1.25) / 1.5, rel=1e-4)


def test_disturbances_that_are_measured_are_cancelled_or_weighed_against_a_feedthrough():
    # y = w and u = -k y: x' = -x + (0.3 - 0.1 k) w.
    one, none = [[1.0]], [[0.0]]
    plant = GeneralizedPlant.from_matrices([[-1.0]], [[0.3]], [[0.1]], one, none, D21=one)
    found = static_output_feedback(plant, time_limit=1.0)
    assert found.gain.item() == pytest.approx(-3.0, abs=1e-9)
    assert found.certificate.achieved < 1e-12
    # z = u + 2 w - x: |1 + k| at rest and |2 + k| at infinite frequency.
    plant = GeneralizedPlant.from_matrices(
        [[-1.0]], one, none, [[-1.0]], none, D11=[[2.0]], D12=one, D21=one
    )
    found = static_output_feedback(plant, target=0.50004)
    assert found.certificate.achieved == pytest.approx(0.5, rel=1e-4)


def test_refusals_say_what_was_tried_and_what_to_do():
    # x' = x + u needs k > 1.
    with pytest.raises(SolverError, match=r"that meets the gain bound 0\.9 was found"):
        static_output_feedback(lags([-1.0]), gain_bound=0.9, time_limit=0.5)
    with pytest.raises(SolverError, match=r"before time ran out.*raise time_limit"):
        static_output_feedback(lags([-1.0]), time_limit=1e-9)


def test_parts_are_designed_alone_and_certified_together():
    norms = np.sqrt([1 / 2, 1 / 5])
    design = static_output_feedback(lags([1.0, 2.0, 2.0]), target=1.0005 * norms[0])
    assert max(design.details["part_norms"]) == pytest.approx(norms[0], rel=1e-3)
    check(design)
    assert {entry["part"] for entry in design.history} == {0, 1, 2}
    assert design.details["descents"] == len(design.history)
    # Equal parts are searched once.
    assert design.gain[1, 1] == design.gain[2, 2]
    assert "descents ended there" in design.message


def test_a_part_that_is_left_alone_has_to_be_stable():
    only_first = np.array([[True, False], [False, False]])
    with pytest.raises(InfeasibleError, match=r"\(state x2\) to a control and a measurement"):
        static_output_feedback(lags([1.0, -2.0]), structure=only_first)
    design = static_output_feedback(lags([1.0, 0.5]), structure=only_first, target=0.71)
    assert len(design.details["part_norms"]) == 1
    assert design.certificate.achieved == pytest.approx(2.0, rel=1e-6)
    idle = static_output_feedback(lags([1.0]), structure=[[False]])
    assert "the loop is the open loop" in idle.message
    # A plant without states leaves nothing to choose.
    gain = GeneralizedPlant(control.StateSpace([], [], [], np.eye(2)), 1, 1)
    assert "the open loop" in static_output_feedback(gain).message


def test_the_search_starts_at_what_was_given():
    # The first of all descents begins there, and its norm is good enough.
    plant = rescaled(oscillator(), seed=1)[0]
    known = static_output_feedback(plant, order=1, target=float(hinf_norm(plant.open_loop)))
    goal = 1.001 * known.certificate.achieved
    again = static_output_feedback(plant, order=1, initial=known.controller, target=goal)
    assert len(again.history) == 1
    assert again.certificate.achieved <= goal
    late = static_output_feedback(plant, order=1, initial=known.controller, time_limit=0.2)
    assert late.status == "time_limit"
    assert "Raise time_limit" in late.message


@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_disturbances_that_reach_nothing_leave_an_optimum_of_zero(norm):
    # w moves x2; u, z and y have to do with x1 only.
    first, second = [[1.0], [0.0]], [[0.0], [1.0]]
    plant = GeneralizedPlant.from_matrices(-np.eye(2), second, first, [[1.0, 0.0]], [[1.0, 0.0]])
    found = static_output_feedback(plant, norm)
    assert (found.status, found.certificate.achieved, found.lower_bound) == ("optimal", 0.0, 0.0)
    assert "do not reach" in found.message


def some_gain_stabilises(plant):
    """Whether a loop with one of many gains from the one y to the one u is stable."""
    sizes = np.logspace(-4, 4, 4001)
    for k in (*sizes, *-sizes):
        gain = k / (1 - plant.D22[0, 0] * k)
        if np.linalg.eigvals(plant.A + gain * plant.B2 @ plant.C2).real.max() < 0:
            return True
    return False


def test_random_plants_never_get_a_false_answer():
    rng = np.random.default_rng(11)
    designed = 0
    for _ in range(5):
        n, nu, ny = (int(rng.integers(1, high)) for high in (6, 3, 3))
        shapes = ((n, n), (n, 2), (n, nu), (2, n), (ny, n), (2, 2), (2, nu), (ny, 2), (ny, nu))
        *matrices, D22 = (rng.normal(size=shape) for shape in shapes)
        plant = GeneralizedPlant.from_matrices(*matrices, 0.1 * D22)
        try:
            check(static_output_feedback(plant, time_limit=1.0))
            designed += 1
        except (SolverError, InfeasibleError):
            assert nu == ny == 1
            assert not some_gain_stabilises(plant)
    assert designed == 3
