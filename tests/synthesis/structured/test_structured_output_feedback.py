"""Tuned blocks: known optima, lower bounds, decentralised loops, units, code."""

import control
import numpy as np
import pytest
from published_plants import compleib
from small_plants import oscillator, two_masses

import robustpolish as rp
from robustpolish.errors import InfeasibleError, InvalidInputError, SolverError
from robustpolish.plants.plant import GeneralizedPlant

structured_output_feedback = rp.structured_output_feedback


def lag(numerator=1.0, denominator=(1.0, 1.0)):
    """Weigh S and K S of a plant from F to x."""
    G = control.tf([numerator], list(denominator), inputs="F", outputs="x")
    G = rp.GeneralizedPlant.from_loop(G, units={"F": "N", "x": "m"})
    return rp.mixed_sensitivity(G, performance=rp.weight(1e3, 0.5, 0.5), effort=0.05)


def test_pi_reaches_the_full_order_bound_of_a_lag():
    plant = lag()
    design = structured_output_feedback(plant, rp.tunable.pid("x", kind="PI", sign=-1))
    best = rp.output_feedback(plant)
    assert design.certificate.valid
    assert best.lower_bound <= design.certificate.achieved <= 1.001 * best.certificate.achieved
    block = design.details["blocks"]["pid_x"]
    assert block["Kp"] > 0
    assert block["Ki"] > 0
    assert [n.unit for n in block.numbers] == ["N/m", "N/(m s)"]
    K = design.controller
    assert K.state_labels == ["pid_x.integral"]
    assert (K.input_labels, K.output_labels) == (["x"], ["F"])
    assert K(2j) == pytest.approx(-(block["Kp"] + block["Ki"] / 2j))
    assert K.A.item() == 0.0


def test_both_notations_of_the_sign_give_the_same_loop():
    # x' = x + w + u with |Kp| up to 3: the norm 1 / (3 - 1) is reached at the limit.
    plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    Kp = rp.tunable.tunable("Kp", low=-3.0, high=3.0)
    for sign in (1, -1):
        design = structured_output_feedback(plant, rp.tunable.pid(kind="P", Kp=Kp, sign=sign))
        assert design.certificate.achieved == pytest.approx(0.5)
        (number,) = design.details["blocks"]["pid_y1"].numbers
        assert number.value == -3.0 * sign
        assert number.at_limit


def test_decentralised_gains_of_all_states_are_the_regulator():
    # Q = diag(1, 0), R = 0.25: the regulator of x'' + 0.1 x' + x = u, by its Riccati equation.
    P = oscillator()
    plant = rp.GeneralizedPlant.from_matrices(
        P.A, P.B1[:, :1], P.B2, P.C1, np.eye(2), D12=P.D12, measurements=["x", "v"], controls=["F"]
    )
    blocks = [rp.tunable.pid("x", kind="P", sign=-1), rp.tunable.pid("v", kind="P", sign=-1)]
    design = structured_output_feedback(plant, blocks, "h2")
    _, _, best = control.care(plant.A, plant.B2, np.diag([1.0, 0.0]), [[0.25]])
    found = design.details["blocks"]
    assert [found["pid_x"]["Kp"], found["pid_v"]["Kp"]] == pytest.approx(best[0], rel=1e-3)


def test_unstable_starts_limits_and_shared_numbers():
    plant = two_masses([[1.0, 0.5, 0, 0], [0, 0, 1.0, 0.5]])
    k = rp.tunable.tunable("k", 0.0, low=-5.0, high=5.0)
    blocks = [
        rp.tunable.pid(y, u, "P", Kp=k) for y, u in zip(("y1", "y2"), ("u1", "u2"), strict=True)
    ]
    plant = plant.replace(measurements=["y1", "y2"])
    assert not rp.certify(plant, np.zeros((2, 2))).stable
    design = structured_output_feedback(plant, blocks)
    same = design.gain.diagonal()
    assert same[0] == same[1] == design.details["blocks"].numbers["k"]
    assert -5.0 <= same[0] < 0
    # One number can be scanned.
    scanned = [
        rp.hinf_norm(plant.closed_loop(g * np.eye(2))).value for g in np.linspace(-5, -1.2, 200)
    ]
    assert design.certificate.achieved <= min(scanned) * (1 + 1e-4)


def test_held_numbers_stay_and_bounds_hold():
    plant = lag()
    Kp = rp.tunable.tunable("Kp", 0.5, low=0.4, high=0.6)
    block = rp.tunable.pid("x", kind="PD", Kp=Kp, Tf=0.25, sign=-1) * rp.tunable.low_pass(
        damping=0.7
    )
    design = structured_output_feedback(plant, block)
    blocks = design.details["blocks"]
    assert 0.4 <= blocks["pid_x"]["Kp"] <= 0.6
    assert (blocks["pid_x"]["Tf"], blocks["low_pass_x"]["damping"]) == (0.25, 0.7)
    assert "held" in repr(design)


def test_integral_action_that_nobody_asked_for_is_told():
    design = structured_output_feedback(oscillator(), rp.tunable.pid(sign=-1))
    assert design.certificate.valid
    assert design.details["idle_integrals"] == ("pid_y1.Ki",)
    assert "asks for no integral action" in design.message


def test_from_the_blocks_to_code_and_files(tmp_path):
    pi = rp.tunable.pid("x", kind="PI", sign=-1)
    design = structured_output_feedback(lag(), pi, target=0.6)
    design.save(tmp_path / "design.json")
    again = rp.load(tmp_path / "design.json")
    assert again.details["blocks"].blocks == design.details["blocks"].blocks
    started = structured_output_feedback(lag(), pi, initial=again, target=0.6)
    assert started.certificate.achieved <= 0.6
    sampled = design.discretize(0.01)
    assert sampled.certificate.valid
    sampled.export_c(tmp_path, name="loop")
    assert "loop_step" in (tmp_path / "loop.c").read_text()


def test_fixed_order_on_a_discrete_plant():
    G = control.StateSpace([[1.1]], [[1.0]], [[1.0]], 0, 0.1)
    design = structured_output_feedback(
        rp.GeneralizedPlant.from_loop(G), rp.tunable.fixed_order(order=1), target=3.0
    )
    assert design.certificate.valid
    assert design.controller.dt == 0.1


def test_a_wrong_sign_is_suspected():
    unstable = lag(1.0, (1.0, -1.0))
    with pytest.raises(SolverError, match="sign=-1 is negative feedback"):
        structured_output_feedback(
            unstable,
            rp.tunable.pid("x", kind="P", Kp=rp.tunable.tunable("Kp", low=0.0)),
            time_limit=20,
        )


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"plant": control.tf([1.0], [1.0, 1.0])}, "expected a GeneralizedPlant"),
        ({"norm": "h3"}, "one of 'hinf', 'h2'"),
        ({"gain_bound": 3.0}, "for blocks with integrators"),
        ({"initial": {"Kp": 1.0}}, "names among pid_x.Kp, pid_x.Ki"),
        ({"initial": {"pid_x.Kp": np.nan}}, "a number between"),
        ({"initial": 3.0}, "numbers by name"),
        ({"time_limit": 0.0}, "time_limit"),
    ],
)
def test_refuses(given, words):
    arguments = {"plant": lag(), "blocks": [rp.tunable.pid("x", kind="PI")], **given}
    with pytest.raises(InvalidInputError, match=words):
        structured_output_feedback(**arguments)


def test_refuses_a_plant_between_nothing():
    G = control.ss([[-1.0]], [[1.0]], [[1.0]], 0)
    plant = rp.GeneralizedPlant(G, measurements=1, controls=1)
    with pytest.raises(InvalidInputError, match="0 disturbances w and 0 performance outputs z"):
        structured_output_feedback(plant, rp.tunable.pid())


def wood_berry():
    """Return the column of Wood and Berry (1973) with delays by Pade, weighted."""

    def entry(gain, constant, delay):
        return gain * control.tf(*control.pade(delay, 2)) / control.tf([constant, 1.0], [1.0])

    rows = [
        [entry(12.8, 16.7, 1), entry(-18.9, 21.0, 3)],
        [entry(6.6, 10.9, 7), entry(-19.4, 14.4, 3)],
    ]
    G = control.ss(control.combine_tf(rows))
    G = control.StateSpace(G, inputs=["R", "S"], outputs=["xD", "xB"])
    return rp.mixed_sensitivity(G, performance=rp.weight(1e3, 0.05 / 6.28, 0.5), effort=0.5)


@pytest.mark.long
def test_two_pi_loops_of_a_column_have_the_signs_of_the_literature():
    plant = wood_berry()
    blocks = [rp.tunable.pid("xD", "R", "PI", sign=-1), rp.tunable.pid("xB", "S", "PI", sign=-1)]
    design = structured_output_feedback(plant, blocks)
    best = rp.output_feedback(plant)
    # Full order reaches 0.58; Luyben's gains are 0.375 and -0.075.
    assert best.lower_bound < design.certificate.achieved < 0.86
    found = design.details["blocks"]
    assert 0.1 < found["pid_xD"]["Kp"] < 1.0
    assert -0.2 < found["pid_xB"]["Kp"] < 0


@pytest.mark.long
@pytest.mark.shared
@pytest.mark.parametrize(("name", "order"), [("AC4", 0), ("HE1", 0), ("AC4", 2)])
def test_a_free_state_space_is_the_fixed_order_feedback(shared, name, order):
    plant = compleib(shared, name)
    mask = np.ones((order + plant.nu, order + plant.ny))
    known = rp.static_output_feedback(plant, structure=mask, order=order)
    block = rp.tunable.fixed_order(order=order) if order else rp.tunable.static_gain()
    found = structured_output_feedback(plant, block)
    assert found.certificate.achieved == pytest.approx(known.certificate.achieved, rel=0.01)


# Controllers of at most k states: between static and full order, certified, with their bound.


def test_more_states_never_do_worse_and_all_stay_above_the_bound():
    plant = oscillator()
    full = rp.output_feedback(plant)
    found = [rp.output_feedback(plant, order=k, effort=0.2) for k in (0, 1, 2)]
    norms = [design.certificate.achieved for design in found]
    for k, design in enumerate(found):
        assert design.certificate.valid
        assert design.controller.nstates <= k
        assert design.lower_bound == pytest.approx(full.lower_bound, rel=1e-6)
        assert design.certificate.achieved >= full.lower_bound * (1 - 1e-6)
        assert f"{k} state" in design.message or f"of the {k} states" in design.message
    assert norms[0] >= norms[1] * (1 - 1e-4)
    assert norms[1] >= norms[2] * (1 - 1e-4)
    assert norms[2] <= full.certificate.achieved * 1.004
    # A static gain is what static output feedback finds.
    static = rp.static_output_feedback(plant)
    assert norms[0] == pytest.approx(static.certificate.achieved, rel=1e-3)


def test_the_limit_counts_the_states_of_all_decoupled_parts():
    one = oscillator()
    both = GeneralizedPlant.from_matrices(
        *(np.kron(np.eye(2), M) for M in (one.A, one.B1, one.B2, one.C1, one.C2)),
        D12=np.kron(np.eye(2), one.D12),
        D21=np.kron(np.eye(2), one.D21),
    )
    design = rp.output_feedback(both, order=1, effort=0.02)
    assert design.certificate.valid
    assert design.controller.nstates <= 1


@pytest.mark.parametrize(
    ("given", "argument"),
    [
        ({"order": -1}, "order"),
        ({"order": 1.5}, "order"),
        ({"order": True}, "order"),
        ({"order": "two"}, "order"),
        ({"order": 1, "method": "lmi"}, "method"),
        ({"order": 1, "gamma": 3.0}, "gamma"),
        ({"order": 1, "effort": 0.0}, "effort"),
        ({"order": 1, "time_limit": -1.0}, "time_limit"),
    ],
)
def test_refuses_what_makes_no_sense(given, argument):
    with pytest.raises(InvalidInputError, match=rf"^{argument}"):
        rp.output_feedback(oscillator(), **given)


def test_a_fixed_mode_is_refused_for_every_order():
    plant = GeneralizedPlant.from_matrices(
        [[1.0, 0.0], [0.0, -1.0]], [[1.0], [1.0]], [[0.0], [1.0]], [[1.0, 1.0]], [[1.0, 1.0]]
    )
    with pytest.raises(InfeasibleError):
        rp.output_feedback(plant, order=1)


# What the search reached, with 3 % of room, and what it had reached without reduced full-order
# designs and shorter controllers to start from.
REACHED = {("DLR3", 2): (560.0, 1619.0), ("HE6", 2): (47.5, 146.0), ("IH", 0): (1e-4, 1.59)}


@pytest.mark.long
@pytest.mark.shared
@pytest.mark.parametrize(("name", "order"), REACHED)
def test_plants_of_twenty_to_forty_states(shared, name, order):
    design = rp.output_feedback(compleib(shared, name), order=order)
    assert design.certificate.valid
    assert design.controller.nstates <= order
    assert design.certificate.achieved <= REACHED[name, order][0]
