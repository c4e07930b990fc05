"""Loop shaping: gamma, certificates, targets and what plants do not permit."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.synthesis.coprime import consistent_matrices, coprime, loop_plant
from robustpolish.synthesis.loop_shaping import (
    TargetLoop,
    limits_in_words,
    reduce_in_gap_metric,
    target_weight,
)
from robustpolish.synthesis.problem.matrices import SystemMatrices, in_series


def book_plant():
    s = control.tf("s")
    return 200 / ((10 * s + 1) * (0.05 * s + 1) ** 2), (s + 2) / s


def test_example_of_skogestad_and_postlethwaite():
    # Example 9.3: gamma_min = 2.34, and gamma = 2.59 = 1.1 gamma_min was asked for.
    G, W1 = book_plant()
    design = rp.loop_shaping(G, W1=W1)
    assert design.details["optimal_gamma"] == pytest.approx(2.34, abs=0.005)
    assert 2.34 < design.details["gamma"] <= 1.1 * 2.3388
    assert design.certificate.valid
    assert design.details["shaped_certificate"].valid
    # The controller holds the weight: an integrator, and no error at rest.
    K = design.controller
    assert np.abs(K.poles()).min() < 1e-9
    sensitivity = 1 / (1 - complex(G(1e-6j)) * complex(K(1e-6j)))
    assert abs(sensitivity) < 1e-6


def test_a_lightly_damped_oscillator():
    # 16/(s^2 + 0.16 s + 16): X and Z of the equations by SciPy give 1.747266. A controller below
    # the number 1.98835 that is told elsewhere is proven here, so that that cannot be the minimum.
    G = control.tf([16], [1, 0.16, 16])
    design = rp.loop_shaping(G)
    assert design.lower_bound == pytest.approx(1.7472657, abs=1e-6)
    assert design.certificate.bound < 1.1 * 1.7472657 < 1.98835
    near = rp.loop_shaping(G, factor=1.001)
    assert near.certificate.achieved == pytest.approx(1.7472657, rel=1.1e-3)


def test_without_weights_the_certificate_is_that_of_gamma():
    G = control.tf([1], [1, 0, -4], inputs="F", outputs="phi")
    design = rp.loop_shaping(G)
    assert design.certificate.achieved == pytest.approx(design.details["gamma"])
    assert 1 / design.certificate.achieved == pytest.approx(
        rp.uncertain.ncf_margin(G, design.controller)
    )
    assert design.details["ncf_margin"] == pytest.approx(
        rp.uncertain.ncf_margin(G, design.controller)
    )
    assert (design.controller.input_labels, design.controller.output_labels) == (["phi"], ["F"])
    assert design.plant.disturbance_names == ("disturbance_phi", "disturbance_F")
    assert design.certificate.achieved <= 1.1 * design.lower_bound


@pytest.mark.parametrize("dt", [0, 0.1])
@pytest.mark.parametrize("seed", range(4))
def test_weights_of_every_kind_make_the_shaped_loop(seed, dt):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((3, 3)) * (0.5 if dt else 1)
    G = control.ss(A, rng.standard_normal((3, 2)), rng.standard_normal((2, 3)), 0, dt)
    W1 = rp.weight(20.0, 0.5, 0.3, dt=dt)
    design = rp.loop_shaping(G, W1=W1, W2=[2.0, None])
    Ks, Gs = design.details["shaped_controller"], design.details["shaped_plant"]
    K, point = design.controller, np.exp(0.7j) if dt else 0.7j
    W2 = np.diag([2.0, 1.0])
    np.testing.assert_allclose(Gs(point), W2 @ G(point) * W1(point), rtol=1e-9)
    np.testing.assert_allclose(K(point), W1(point) * Ks(point) @ W2, rtol=1e-9)
    assert rp.uncertain.ncf_margin(Gs, Ks) == pytest.approx(1 / design.details["gamma"], rel=1e-6)
    assert design.details["gamma"] <= 1.1 * design.details["optimal_gamma"] * (1 + 1e-9)
    four_blocks = rp.output_feedback(rp.GeneralizedPlant.from_loop(Gs))
    assert four_blocks.lower_bound == pytest.approx(design.details["optimal_gamma"], rel=2e-3)


def test_a_matrix_weight():
    G = control.ss(-np.eye(2), np.eye(2), np.eye(2), 0)
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
    design = rp.loop_shaping(G, W2=turn)
    np.testing.assert_allclose(design.details["shaped_plant"](1j), turn / (1j + 1))


def test_a_plant_as_it_is_wired():
    G = control.tf([1], [1, 1], inputs="F", outputs="x")
    plant = rp.GeneralizedPlant(G, "x", "F", units={"F": "N", "x": "m"})
    plant = plant.with_actuator("F", 20.0, limit=5.0).with_delay("x", 0.05)
    design = rp.loop_shaping(plant, W1=rp.weight(np.inf, 0.5, 0.5))
    assert design.plant.units["F"] == "N"
    assert dict(design.plant.limits) == {"F": 5.0}
    assert design.certificate.exact_delays.stability
    assert rp.uncertain.ncf_margin(plant, design.controller) > 0.2


def test_it_comes_back_from_its_file(tmp_path):
    G, W1 = book_plant()
    design = rp.loop_shaping(G, W1=W1)
    design.save(tmp_path / "design.json")
    again = rp.load(tmp_path / "design.json")
    assert again.details["gamma"] == design.details["gamma"]
    np.testing.assert_array_equal(
        again.details["shaped_controller"].A, design.details["shaped_controller"].A
    )


def test_gains_that_do_not_suit_the_plant_are_told():
    # An unstable pole at 1 and a zero at 1.3 leave next to no margin.
    G = control.tf([-1, 1.3], [1, -1])
    message = rp.loop_shaping(control.tf([1], [1, 1]) * G, factor=1.01).message
    assert "too small" in message


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"plant": "G"}, "plant: got 'G'"),
        ({"factor": 1.0}, "factor: got 1.0, expected a number above 1"),
        ({"factor": "1.1x"}, "factor: got '1.1x'"),
        ({"order": 9}, "order: got 9, expected a whole number from 0 to 1"),
        ({"order": 0.5}, "order: got 0.5"),
        ({"W1": [1.0, 2.0]}, "W1: got 2 weights, expected 1, one per channel"),
        ({"W2": np.eye(2)}, "W2: got 2 inputs and 2 outputs, expected one of each, or 1"),
        ({"W1": control.tf([1], [1, 0.5], 0.1)}, r"W1\[0\]: got sampling time 0.1"),
        ({"W1": control.tf([1, 0, 0], [1, 1])}, "W1: got an improper"),
    ],
)
def test_bad_arguments_are_named(given, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        rp.loop_shaping(**({"plant": control.tf([1], [1, 1])} | given))


def test_an_integrator_that_the_plant_cancels_is_named():
    with pytest.raises(rp.InfeasibleError, match="No controller stabilises the plant"):
        rp.loop_shaping(control.tf([1, 0], [1, 3, 1]), W1=rp.weight(np.inf, 1.0, 0.1))


def test_a_shorter_controller_tells_what_it_costs():
    G, W1 = book_plant()
    full = rp.loop_shaping(G, W1=W1)
    short = rp.loop_shaping(G, W1=W1, order=2)
    assert short.controller.nstates == full.controller.nstates - 2
    assert short.details["shaped_controller"].nstates == 2
    assert short.details["gamma"] == pytest.approx(
        1
        / rp.uncertain.ncf_margin(short.details["shaped_plant"], short.details["shaped_controller"])
    )
    assert full.details["optimal_gamma"] < short.details["gamma"] < 1.5 * full.details["gamma"]
    with pytest.raises(rp.SolverError, match=r"order 0 could not be certified.*ask for more"):
        rp.loop_shaping(control.tf([1], [1, 0, -4]), order=0)


@pytest.mark.parametrize("dt", [0, 0.01])
def test_a_target_in_place_of_weights(dt):
    s = control.tf("s")
    G, target = 200 / ((10 * s + 1) * (0.05 * s + 1) ** 2), 10 / s
    if dt:
        G, target = (control.c2d(control.ss(system), dt) for system in (G, target))
    design = rp.loop_shaping(G, target=target)
    details = design.details
    assert design.certificate.valid
    assert details["shape_factor"] < 1.01
    assert details["target_factor"] <= details["gamma"] < 2
    assert f"within a factor of {details['target_factor']:.3g}" in design.message
    assert "no proof between" in design.message
    assert details["band_hz"] == pytest.approx((0.1 / (2 * np.pi), 100 / (2 * np.pi)), rel=0.05)
    # The loop itself, from the plant and the controller that is returned.
    for omega in (0.2, 1.0, 50.0):
        point = np.exp(1j * omega * dt) if dt else 1j * omega
        own, wanted = (abs(complex(x(point))) for x in (G * design.controller, target))
        lacking = wanted / own if wanted > 1 else own / wanted
        assert lacking < details["target_factor"] * 1.001


def test_a_target_for_several_loops_and_units():
    rng = np.random.default_rng(3)
    A = rng.standard_normal((4, 4)) - 2 * np.eye(4)
    G = control.ss(A, rng.standard_normal((4, 3)), rng.standard_normal((2, 4)), 0)
    s = control.tf("s")
    design = rp.loop_shaping(G, target=0.5 / s, W2=2.0)
    assert design.certificate.valid
    assert design.details["shape_factor"] < 1.01
    assert (design.controller.noutputs, design.controller.ninputs) == (3, 2)
    assert design.details["W1"].noutputs == 3
    assert design.details["shaped_plant"].ninputs == 2


def test_a_target_that_the_plant_does_not_permit_is_told():
    s = control.tf("s")
    design = rp.loop_shaping((1 - s) / (s + 1) ** 2, target=10 / s)
    assert design.details["gamma"] > 4
    assert "zero in the right half plane at 1 rad/s" in design.message
    assert "do not suit the plant" in design.message


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"target": "10/s"}, "target: got"),
        ({"target": control.tf([1], [1, 0]), "W1": 2.0}, "target: got.*W2 may be given"),
        ({"target": control.tf([1], [1, 0], 0.1)}, "target.*got sampling time"),
        ({"target": [1.0]}, "target: got.*one system"),
        (
            {"target": control.ss(np.zeros((2, 2)), np.eye(2), np.eye(2), 0)},
            "target: got.*2 inputs",
        ),
        ({"target": 5.0}, "target: got.*never falls"),
        ({"target": control.tf([10], [1, -1])}, "unstable system"),
        ({"target": control.tf([1], [1, 0]), "band_hz": (3, 1)}, "band_hz: got"),
        ({"band_hz": (1, 3)}, "band_hz: got"),
        ({"target": control.tf([1, 0], [1])}, "target: got"),
    ],
)
def test_bad_targets(arguments, words):
    with pytest.raises(rp.InvalidInputError, match=words):
        rp.loop_shaping(control.tf([1], [1, 1]), **arguments)


def random_controller(seed, dt=0):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((5, 5)) * (0.4 if dt else 1)
    shapes = ((5, 2), (3, 5), (3, 2))
    return control.ss(A, *(rng.standard_normal(shape) for shape in shapes), dt)


@pytest.mark.parametrize("seed", range(5))
def test_fewer_states_stay_within_the_bound_of_the_gap(seed):
    # The nu-gap to the truncated one is at most the error of the factors, and that at most twice
    # the sum of the Hankel singular values left out.
    K = random_controller(seed)
    gaps = [
        rp.uncertain.nu_gap(K, control.ss(*reduce_in_gap_metric(K, order), 0))
        for order in (5, 4, 3)
    ]
    assert gaps[0] < 1e-5
    assert gaps[0] <= gaps[1] + 1e-9
    assert reduce_in_gap_metric(K, 3).A.shape == (3, 3)
    factors = control.ss(*coprime(loop_plant("K", K)).right(), 0)
    hankel = np.sort(control.hankel_singular_values(factors))
    for gap, left_out in zip(gaps[1:], (1, 2), strict=True):
        assert gap <= 2 * hankel[:left_out].sum() + 1e-6


s = control.tf("s")


def wanted(system, dt=0, band_hz=None):
    return TargetLoop.checked(consistent_matrices(control.ss(system)), dt, band_hz)


s = control.tf("s")
A = np.random.default_rng(0).standard_normal((5, 5))
WIDE = np.random.default_rng(1).standard_normal((5, 3))


def pieces(G, crossover=10.0, dt=0):
    G = control.ss(G)
    one = control.ss(crossover / s)
    if dt:
        G, one = control.c2d(G, dt), control.c2d(one, dt)
    count = min(G.ninputs, G.noutputs)
    shape = SystemMatrices(*(np.kron(np.eye(count), M) for M in consistent_matrices(one)))
    return consistent_matrices(G), TargetLoop.checked(shape, dt, None)


@pytest.mark.parametrize("dt", [0, 0.01])
@pytest.mark.parametrize(
    "plant",
    [
        1 / (s + 1) ** 2,
        1 / s**2,
        1 / (s - 1),
        (3 - s) / (s + 1) ** 2,
        control.ss([[0, 1], [-400, -0.02]], [[0], [1]], [[1, 0]], 0),
        control.ss(A, WIDE[:, :2], WIDE.T[:2], 0),
        control.ss(A, WIDE, WIDE.T[:2], 0),
        control.ss(A, WIDE[:, :2], WIDE.T, 0),
    ],
)
def test_the_shaped_plant_has_the_gain_of_the_target_within_a_percent(plant, dt):
    G, wanted = pieces(plant, dt=dt)
    W = target_weight(G, wanted)
    assert wanted.distance_of(in_series(W, G))[0] < 1.01
    # The weight has no unstable poles; those on the boundary are the target's.
    poles = np.linalg.eigvals(W.A)
    assert (np.abs(poles) < 1 + 1e-9 if dt else poles.real < 1e-9).all()


def test_what_a_plant_does_not_permit_is_said():
    said = limits_in_words(*pieces((3 - s) / (s + 1) ** 2))
    assert "zero in the right half plane at 3 rad/s" in said
    assert "the target has 10 rad/s" in said
    assert limits_in_words(*pieces((3 - s) / (s + 1) ** 2, 1.0)) == ""
    assert "unstable pole at 8 rad/s" in limits_in_words(*pieces(1 / (s - 8)))
    assert limits_in_words(*pieces(1 / (s - 2))) == ""
    discrete = limits_in_words(*pieces(1 / (s - 8), dt=0.01))
    assert "unstable pole at 8 rad/s" in discrete


def test_a_plant_without_gain_is_refused():
    G, wanted = pieces(control.ss(-1, 1, 0, 0))
    with pytest.raises(InvalidInputError, match="plant without gain in the band"):
        target_weight(G, wanted)
