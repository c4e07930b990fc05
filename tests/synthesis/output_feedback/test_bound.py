"""What "optimal" means: within the tolerance of a lower bound that is stated, on any machine."""

import itertools
import time

import control
import numpy as np
import pytest
from hard_plants import flexible_structure, random_plant
from output_tasks import LAG_H2, LAG_HINF, unstable_lag
from published_plants import compleib, mit_lecture, quadruple_tank, scherer_1997
from scipy import linalg

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.errors import InfeasibleError, InvalidInputError
from robustpolish.synthesis.output_feedback.output_feedback import output_feedback
from robustpolish.synthesis.problem.preflight import SolverPlant
from robustpolish.synthesis.riccati.gamma import lower_bound

TOLERANCE = 4e-3


def in_states(plant, T):
    """Return the plant with x = T x_new."""
    P = plant
    A, B1, B2 = (np.linalg.solve(T, M) for M in (P.A @ T, P.B1, P.B2))
    return rp.GeneralizedPlant.from_matrices(
        A, B1, B2, P.C1 @ T, P.C2 @ T, P.D11, P.D12, P.D21, P.D22
    )


def realisations(plant):
    """Return the plant in Schur form, in random states of bad units, and with hidden states."""
    rng = np.random.default_rng(7)
    n, P = plant.nx, plant
    yield plant
    yield in_states(plant, linalg.schur(plant.A)[1])
    yield in_states(plant, rng.standard_normal((n, n)) * 10.0 ** rng.uniform(-3, 3, n))
    hidden = linalg.block_diag(P.A, -1.0, -3.0)
    into = [np.vstack([B, rng.standard_normal((2, B.shape[1]))]) for B in (P.B1, P.B2)]
    out_of = [np.hstack([C, np.zeros((len(C), 2))]) for C in (P.C1, P.C2)]
    yield rp.GeneralizedPlant.from_matrices(hidden, *into, *out_of, P.D11, P.D12, P.D21, P.D22)
    order = rng.permutation(plant.nw)
    yield plant.replace(B1=P.B1[:, order], D11=P.D11[:, order], D21=P.D21[:, order])


@pytest.mark.parametrize(
    "make",
    [
        scherer_1997,
        mit_lecture,
        lambda: random_plant(4, 1),
        *(
            pytest.param(make, marks=pytest.mark.long)
            for make in (quadruple_tank, lambda: random_plant(5, 2, singular=False))
        ),
    ],
)
def test_the_norm_does_not_depend_on_the_realisation(make):
    designs = [output_feedback(plant) for plant in realisations(make())]
    norms = [design.certificate.achieved for design in designs]
    assert {design.status for design in designs} == {"optimal"}
    assert max(norms) <= min(norms) * (1 + TOLERANCE)
    for design in designs:
        assert design.lower_bound <= design.certificate.achieved
        assert design.certificate.achieved <= design.lower_bound * (1 + TOLERANCE)
        assert f"no controller comes below {design.lower_bound:.6g}" in design.message


@pytest.mark.shared
@pytest.mark.parametrize(
    "name",
    ["AC3", "NN2"]
    + [
        pytest.param(name, marks=pytest.mark.long)
        for name in ("AC15", "HE2", "REA1", "HE1", "ROC6")
    ],
)
def test_singular_plants_too(shared, name):
    plants = realisations(compleib(shared, name))
    norms = [output_feedback(each).certificate.achieved for each in plants]
    assert max(norms) <= min(norms) * (1 + TOLERANCE)


def test_a_finer_tolerance_is_kept():
    design = output_feedback(scherer_1997(), tolerance=2e-4)
    assert design.status == "optimal"
    assert design.certificate.achieved <= design.lower_bound * (1 + 2e-4)


def test_what_is_left_to_be_gained_is_told():
    design = output_feedback(scherer_1997(), method="lmi")
    gap = design.certificate.achieved / design.lower_bound - 1
    assert design.status == ("optimal" if gap <= TOLERANCE else "suboptimal")
    assert gap < 0.01
    if design.status == "suboptimal":
        assert f"at most {gap:.2g} of it above the infimum" in design.message


def test_the_h2_optimum_is_its_own_bound():
    plant = random_plant(4, 0, singular=False, feedthrough=False)
    design = output_feedback(plant, "h2")
    assert design.status == "optimal"
    assert design.certificate.achieved == pytest.approx(design.lower_bound, rel=1e-4)


def test_the_singular_h2_infimum_is_the_limit_of_vanishing_price_and_noise():
    draw = np.random.default_rng(0).standard_normal
    parts = draw((3, 3)), draw((3, 2)), draw((3, 1)), draw((2, 3)), draw((1, 3))
    plant = rp.GeneralizedPlant.from_matrices(*parts)
    bound = output_feedback(plant, "h2").lower_bound
    norms = []
    for size in (1e-2, 1e-3, 1e-4):
        design = output_feedback(plant, "h2", control_weight=size, measurement_noise=size)
        norms.append(design.certificate.achieved)
    assert norms[0] > norms[1] > norms[2] > bound
    assert norms[2] == pytest.approx(bound, rel=0.05)


def test_the_bound_is_shown_and_kept_in_a_file(tmp_path):
    design = output_feedback(scherer_1997())
    assert f"no H-infinity norm below  {design.lower_bound:.6g}" in " ".join(str(design).split(" "))
    design.save(tmp_path / "design.json")
    assert rp.results.Design.load(tmp_path / "design.json").lower_bound == design.lower_bound


def same_controller(first, second):
    K, L = first.controller, second.controller
    return all(np.array_equal(getattr(K, name), getattr(L, name)) for name in "ABCD")


def test_a_slow_clock_changes_nothing(monkeypatch):
    """A machine that is forty times as busy gives the same bits."""
    plant = random_plant(6, 3)
    design = output_feedback(plant, time_limit=1e6)
    began, clock = time.monotonic(), time.monotonic
    monkeypatch.setattr(time, "monotonic", lambda: began + 40 * (clock() - began))
    worked = time.process_time
    monkeypatch.setattr(time, "process_time", lambda: 40 * worked())
    assert same_controller(output_feedback(plant, time_limit=1e6), design)


def test_less_work_is_said():
    plant = flexible_structure(8)
    design = output_feedback(plant, effort=0.005)
    assert "The work allowed was spent; allow more with effort." in design.message
    assert same_controller(design, output_feedback(plant, effort=0.005))


def test_a_safety_net_that_was_reached_is_said(monkeypatch):
    looks = itertools.count()
    # The clock stands still at first, so that something is found, and then jumps to where there is
    # time for a proof alone.
    shown = [0.0]

    def jumping():
        shown[0] = 0.0 if next(looks) < 60 else 58.0
        return shown[0]

    monkeypatch.setattr(time, "process_time", jumping)
    monkeypatch.setattr(time, "monotonic", lambda: shown[0])
    design = output_feedback(random_plant(4, 1))
    assert design.certificate.valid
    assert design.status == "time_limit"
    assert "The safety net of 60 s stopped the search" in design.message


# No controller, however it was found, has a norm below the bound that a design states.


def weighted_servo(seed):
    """A small plant, oscillating, unstable or integrating, perhaps delayed, with weights."""
    draw = np.random.default_rng(seed)
    rate = 10 ** draw.uniform(0, 2)
    kinds = (
        ([rate**2], [1.0, rate / 3, -(rate**2)]),
        ([rate**3], [1.0, 0.02 * rate, rate**2, 0.0]),
        ([-(rate**3)], np.poly([rate, -rate, -0.7 * rate])),
    )
    system = control.ss(control.tf(*kinds[seed % 3]))
    plant = rp.GeneralizedPlant(
        control.ss(system, inputs="u", outputs="y"), measurements="y", controls="u"
    )
    if draw.random() < 0.6:
        plant = plant.with_delay("u", 10 ** draw.uniform(-3, -1) / rate, order=2)
    performance = rp.weight(10 ** draw.uniform(1, 4), rate * 10 ** draw.uniform(-1.5, 0.5), 0.5)
    effort = rp.weight(10 ** draw.uniform(-3, -1), rate * 10 ** draw.uniform(0.5, 2), 100.0)
    robustness = rp.weight(0.9, rate * 10 ** draw.uniform(0.5, 2), 100.0, order=1 + seed % 2)
    some = {"performance": performance, "effort": effort, "robustness": robustness}
    kept = [name for name in some if draw.random() < 0.6] or ["effort"]
    return rp.mixed_sensitivity(plant, **{name: some[name] for name in kept}).without_delays()


def in_other_units(plant, seed):
    """Return the plant in another unit of time and of every state, which no norm sees."""
    draw = np.random.default_rng(seed)
    unit, rate = 10 ** draw.uniform(-1.5, 1.5, plant.nx), 10 ** draw.uniform(-3, 3)
    return plant.replace(
        A=rate * plant.A * unit / unit[:, None],
        B1=rate * plant.B1 / unit[:, None],
        B2=rate * plant.B2 / unit[:, None],
        C1=plant.C1 * unit,
        C2=plant.C2 * unit,
    )


@pytest.mark.parametrize(
    "seed",
    [
        seed if seed in (2, 5, 6, 8) else pytest.param(seed, marks=pytest.mark.long)
        for seed in range(10)
    ],
)
def test_no_certified_norm_lies_below_a_bound_of_the_plant_in_any_units(seed):
    plant = weighted_servo(seed)
    design = rp.output_feedback(plant)
    assert design.certificate.valid
    for k in range(4):
        part = SolverPlant.of(in_other_units(plant, k), mapped=True)
        found = lower_bound(part.matrices, 1e-4, Budget())
        if found is not None and found.proven:
            assert part.norm(found.value) <= design.certificate.achieved * (1 + 1e-5)


def test_an_estimate_of_the_infimum_is_no_bound(monkeypatch):
    """Where rounding decides every equation, nothing is stated and no status rests on it."""
    plant = weighted_servo(0)
    found = lower_bound(SolverPlant.of(plant, mapped=True).matrices, 1e-4, Budget())
    assert found is not None
    monkeypatch.setattr(
        "robustpolish.synthesis.driver.lower_bound",
        lambda *_: found._replace(proven=False, how="estimated"),
    )
    design = rp.output_feedback(plant)
    assert design.lower_bound is None
    assert design.status != "optimal"
    assert "no controller comes below" not in design.message


# Any norm below gamma, or the smallest within a range, kept by a proven bound or refused.


OPTIMUM = 9.508


def largest(design):
    K = design.controller
    return max(np.abs(M).max(initial=0.0) for M in (K.A, K.B, K.C, K.D))


@pytest.mark.parametrize("method", ["auto", "riccati", "lmi"])
@pytest.mark.parametrize("factor", [1.05, 1.5, 20.0])
def test_a_number_is_kept_and_the_rest_buys_a_smaller_gain(method, factor):
    design = rp.output_feedback(scherer_1997(), method=method, gamma=factor * OPTIMUM)
    assert design.certificate.valid
    assert design.certificate.bound <= factor * OPTIMUM
    assert f"a norm below gamma = {factor * OPTIMUM:.6g}" in design.message
    assert design.status == "suboptimal"
    assert design.lower_bound == pytest.approx(OPTIMUM, rel=1e-3)
    if method != "lmi":  # which has no central controller
        assert largest(design) <= largest(rp.output_feedback(scherer_1997(), method=method))


def test_what_no_controller_reaches_is_refused_with_the_lower_bound():
    with pytest.raises(InfeasibleError, match=r"below gamma = 9\..*at least 9\.50.*Riccati"):
        rp.output_feedback(scherer_1997(), gamma=9.0)
    with pytest.raises(InfeasibleError, match=r"within gamma = 1 to 9\."):
        rp.output_feedback(scherer_1997(), gamma=(1.0, 9.0))


def test_a_range_is_searched_down_to_its_low_end_only():
    inside = rp.output_feedback(scherer_1997(), gamma=(5.0, 12.0))
    assert inside.status == "optimal"
    assert inside.certificate.achieved <= OPTIMUM * 1.004
    above = rp.output_feedback(scherer_1997(), gamma=(11.0, 12.0))
    assert above.certificate.bound <= 11.0
    assert "within gamma = 11 to 12" in above.message
    assert above.details["gamma"] == (11.0, 12.0)


def test_at_the_optimum_a_number_is_optimal():
    design = rp.output_feedback(unstable_lag(), gamma=1.003 * LAG_HINF)
    assert design.status == "optimal"
    assert design.certificate.bound <= 1.003 * LAG_HINF


def test_the_h2_norm_too():
    design = rp.output_feedback(unstable_lag(), "h2", gamma=1.5 * LAG_H2)
    assert design.certificate.bound <= 1.5 * LAG_H2
    with pytest.raises(InfeasibleError, match=r"The H2 norm of every .* at least 4\."):
        rp.output_feedback(unstable_lag(), "h2", gamma=0.9 * LAG_H2)


def test_parts_that_share_no_signal_each_keep_it():
    one, other = unstable_lag(), unstable_lag(a=0.5)
    block = [
        np.block([[M, np.zeros((M.shape[0], N.shape[1]))], [np.zeros((N.shape[0], M.shape[1])), N]])
        for M, N in (
            (getattr(one, name), getattr(other, name))
            for name in ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21")
        )
    ]
    both = rp.GeneralizedPlant.from_matrices(*block)
    design = rp.output_feedback(both, gamma=4.0)
    assert len(design.details["parts"]) == 2
    assert design.certificate.bound <= 4.0


@pytest.mark.parametrize("gamma", [0, -1, "2", np.nan, (3, 1), (1, 2, 3), True])
def test_bad_values(gamma):
    with pytest.raises(InvalidInputError, match=r"gamma: got .*low, high"):
        rp.output_feedback(unstable_lag(), gamma=gamma)
    with pytest.raises(InvalidInputError, match=r"gamma: got .*low, high"):
        rp.state_feedback(unstable_lag(), gamma=gamma)
