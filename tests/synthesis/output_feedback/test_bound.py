"""What "optimal" means: within the tolerance of a lower bound that is stated, on any machine."""

import itertools
import time

import numpy as np
import pytest
from hard_plants import flexible_structure, random_plant
from published_plants import compleib, mit_lecture, quadruple_tank, scherer_1997
from scipy import linalg

import robustpolish as rp
from robustpolish.synthesis.output_feedback.output_feedback import output_feedback

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
    monkeypatch.setattr(time, "monotonic", lambda: 0.0 if next(looks) < 60 else 58.0)
    design = output_feedback(random_plant(4, 1))
    assert design.certificate.valid
    assert design.status == "time_limit"
    assert "The safety net of 60 s stopped the search" in design.message
