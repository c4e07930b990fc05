"""Every engine of output feedback against closed forms, and what is said where it fails."""

import warnings

import control
import numpy as np
import pytest
from hard_plants import flexible_structure
from output_tasks import LAG_H2, LAG_HINF, unstable_lag

import robustpolish as rp
from robustpolish.synthesis.backends.slycot_backend import SlycotAnswer
from robustpolish.synthesis.output_feedback import output_feedback
from robustpolish.synthesis.output_feedback.output_feedback import SLYCOT_EPSILON


@pytest.mark.parametrize("method", ["riccati", "lmi", "slycot"])
@pytest.mark.parametrize(("norm", "optimum"), [("hinf", LAG_HINF), ("h2", LAG_H2)])
def test_the_optimum_is_reached(norm, optimum, method):
    if method == "slycot":
        pytest.importorskip("slycot")
    design = rp.output_feedback(unstable_lag(), norm, method)
    assert optimum * (1 - 1e-6) <= design.certificate.achieved
    assert design.certificate.achieved <= optimum * (1.02 if method == "slycot" else 1.004)
    assert design.method == method
    if method != "slycot":
        assert design.status == "optimal"
    if method == "lmi" and norm == "hinf":  # claims are the gammas that were solved for
        assert design.history[-1]["gamma"] == pytest.approx(1.004 * LAG_HINF, rel=1e-3)


def test_a_regular_plant_takes_one_pair_of_equations():
    design = rp.output_feedback(unstable_lag(), "h2", "riccati")
    (entry,) = design.history
    assert entry["epsilon"] == 0.0
    # u = F xhat and xhat' = (a + F + L) xhat - L y with F = L = -(1 + sqrt(2)).
    K, x = design.controller, 1 + np.sqrt(2)
    assert K.A.item() == pytest.approx(1 - 2 * x)
    assert K.B.item() * K.C.item() == pytest.approx(-x * x)


@pytest.mark.parametrize("method", ["riccati", "lmi"])
def test_large_norms_are_solved_in_a_unit_of_their_own(method):
    plant, factor = unstable_lag(), 1e6
    large = plant.replace(C1=factor * plant.C1, D12=factor * plant.D12)
    design = rp.output_feedback(large, method=method)
    assert LAG_HINF * factor * (1 - 1e-6) <= design.certificate.achieved
    assert design.certificate.achieved <= 1.004 * LAG_HINF * factor


def test_gamma_falls_down_the_ladder_and_bounds_the_true_norm():
    # A price on u but no noise on y: the optimum is that of state feedback. u = F x has
    # (1 + F^2) / (w^2 + (1 - F)^2), at rest least for F = -1, where it is 1/2.
    design = rp.output_feedback(unstable_lag(noise=0.0, a=-1.0), method="riccati")
    rungs = [entry for entry in design.history if entry["epsilon"] > 0]
    gammas = [entry["gamma"] for entry in rungs]
    assert len(rungs) > 2
    assert gammas == sorted(gammas, reverse=True)
    assert np.sqrt(0.5) * (1 - 1e-6) <= design.certificate.achieved <= np.sqrt(0.5) * 1.01
    for entry in rungs:
        assert entry["achieved"] <= entry["gamma"] * 1.04
    aimed = rp.output_feedback(unstable_lag(noise=0.0, a=-1.0), method="riccati", tolerance=0.05)
    assert len(aimed.history) < len(design.history)


@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_an_infimum_of_zero_is_told_by_a_norm_that_falls_on(norm):
    design = rp.output_feedback(unstable_lag(price=0.0, noise=0.0), norm, "riccati")
    assert design.status == "infimum_not_attained"
    assert "D12 has rank 0 only" in design.message
    norms = [entry["achieved"] for entry in design.history if entry["achieved"] >= 0]
    assert design.certificate.achieved < 1e-2 * norms[0]
    assert design.certificate.largest_gain > 1e2
    plant, effort = unstable_lag(price=0.0, noise=0.0), 0.5 * design.details["work"] / 20_000
    short = rp.output_feedback(plant, norm, "riccati", effort=effort)
    assert 0 < len(short.history) < len(design.history)
    assert "The work allowed was spent" in short.message


def test_a_singular_plant_whose_norm_settles_is_not_falling():
    # The lag that is disturbed and watched is not the one that is measured and moved.
    plant = rp.GeneralizedPlant.from_matrices(
        np.diag([-1.0, 1.0]), [[1.0], [0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0, 1.0]]
    )
    design = rp.output_feedback(plant, "h2", split=False)
    assert design.status == "optimal"
    assert design.certificate.achieved == pytest.approx(np.sqrt(0.5), rel=1e-6)
    assert len(design.history) < 5  # two rungs without a fall are enough


def test_next_to_the_feedthrough_the_optimum_is_that_of_parrott():
    # Hardly any dynamics: D11 + [0, 0; 0, Dk] can be made as small as its first row or column.
    one, small = np.eye(1), 1e-6 * np.ones((1, 2))
    plant = rp.GeneralizedPlant.from_matrices(
        -one, small, one, small.T, one, [[1, 2], [3, 4]], D12=[[0], [1]], D21=[[0, 1]]
    )
    design = rp.output_feedback(plant)
    assert design.lower_bound == pytest.approx(np.sqrt(10), rel=1e-4)
    assert design.lower_bound <= design.certificate.achieved <= 1.001 * np.sqrt(10)


def test_zeros_on_the_axis_and_weights_over_six_decades():
    servo = control.StateSpace([[0, 1], [0, -1]], [[0], [1]], [[1, 0]], [[0]])
    plant = rp.mixed_sensitivity(
        servo, performance=rp.weight(1e3, 0.2, 0.5), effort=rp.weight(0.01, 10, 100)
    )
    for method in ("riccati", "lmi"):
        design = rp.output_feedback(plant, method=method)
        assert design.status == "optimal"
        # What the same plant has with its pole at -1e-4 and 1e-4 instead of 0.
        assert design.certificate.achieved == pytest.approx(0.8471, rel=5e-3)


def test_the_axis_is_moved_where_no_controller_of_the_plant_itself_is_near():
    design = rp.output_feedback(flexible_structure(12), method="riccati", tolerance=1e-3)
    gammas = [entry["gamma"] for entry in design.history if "shift" in entry]
    assert gammas  # lightly damped
    assert gammas[0] >= design.history[0]["gamma"]


def answering(monkeypatch, gain, message=""):
    """Let SLICOT's routine answer with a static gain, and return what it is given."""
    given, none = {}, np.zeros
    K = gain and (none((0, 0)), none((0, 1)), none((1, 0)), np.array([[gain]]))

    def routine(name, sizes, matrices, time_limit):
        given.update(name=name, sizes=sizes, matrices=matrices, time_limit=time_limit)
        return SlycotAnswer(K, 0.5, message)

    monkeypatch.setattr(output_feedback, "synthesise", routine)
    return given


def test_a_false_claim_of_slicot_becomes_a_remark(monkeypatch):
    given = answering(monkeypatch, -3.0)
    design = rp.output_feedback(unstable_lag(), method="slycot")
    assert design.certificate.achieved >= 3.0 - 1e-6  # u alone passes the noise on with 3
    assert "SB10AD claimed a norm" in design.message
    A, B, C, D = given["matrices"]
    assert (A.shape, B.shape, C.shape) == ((1, 1), (1, 3), (3, 1))
    assert D.tolist() == [[0, 0, 0], [0, 0, 1], [0, 1, 0]]
    rp.output_feedback(unstable_lag(price=0.0), method="slycot")
    nx, nu, ny = given["sizes"]  # a singular plant is regularised
    assert np.linalg.norm(given["matrices"][3][:-ny, -nu:]) == pytest.approx(SLYCOT_EPSILON)
    assert given["matrices"][0].shape == (nx, nx)


@pytest.mark.parametrize(
    ("gain", "told"),
    [(-0.5, "The controller of SB10AD does not stabilise"), (None, "SB10AD ended with 4.")],
)
def test_what_slicot_cannot_do_is_quoted(gain, told, monkeypatch):
    given = answering(monkeypatch, gain, "SB10AD ended with 4")
    with pytest.raises(rp.SolverError, match=told):
        rp.output_feedback(unstable_lag(), method="slycot")
    assert given["name"] == "SB10AD"
    assert 0 < given["time_limit"] <= 60.0


# What a refusal advises leads to an answer.

DOUBLE = np.array([[0.0, 1.0], [0.0, 0.0]])


def copies(matrix, count):
    """Return [G G; G G] of a part with w and u, z and y, every G with states of its own."""
    n = len(matrix)
    A = np.kron(np.eye(count), matrix)
    B, C, D = np.zeros((n * count, 2)), np.zeros((3, n * count)), np.zeros((3, 2))
    for i in range(count):  # G_zw, G_zu, G_yw, G_yu
        B[n * i + n - 1, i % 2] = C[0 if i < count // 2 else 2, n * i] = 1
    D[1, 1] = 1
    return control.ss(A, B, C, D)


def mass(inputs, outputs):
    """Return two carts on rails, of which w pushes both, with the given controls and sensors."""
    A = np.kron(np.eye(2), DOUBLE)
    B, C = np.kron(np.eye(2), [[0.0], [1.0]]), np.kron(np.eye(2), [[1.0, 0.0]])
    return rp.GeneralizedPlant.from_matrices(
        A, B @ [[1.0], [1.0]], B[:, inputs], np.vstack([C, np.zeros((len(inputs), 4))]), C[outputs],
        D12=np.vstack([np.zeros((2, len(inputs))), np.eye(len(inputs))]),
    )  # fmt: skip


@pytest.mark.parametrize("part", [DOUBLE, np.array([[0.5]]), np.array([[0.0, 1.0], [4.0, 0.0]])])
def test_copies_are_built_once(part):
    whole = copies(part, 4)
    with pytest.raises(rp.InfeasibleError, match=rf"needs {len(part)} states.*minreal") as told:
        rp.output_feedback(rp.GeneralizedPlant(whole, 1, 1))
    assert "actuator" not in str(told.value)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        once = control.minreal(whole, verbose=False)
    assert rp.output_feedback(rp.GeneralizedPlant(once, 1, 1)).certificate.valid


@pytest.mark.parametrize(
    ("inputs", "outputs", "told"),
    [([0], [0, 1], "add an actuator"), ([0, 1], [1], "add a sensor"), ([0], [1], "and add a")],
)
def test_what_is_out_of_reach_gets_an_actuator_or_a_sensor(inputs, outputs, told):
    with pytest.raises(rp.InfeasibleError, match=told) as error:
        rp.output_feedback(mass(inputs, outputs))
    inputs = [0, 1] if "actuator" in str(error.value) else inputs
    outputs = [0, 1] if "sensor" in str(error.value) else outputs
    assert rp.output_feedback(mass(inputs, outputs)).certificate.valid
