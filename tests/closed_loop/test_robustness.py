"""Robustness of a design over the errors of a fit."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.closed_loop.sampled_loops import loop_norm
from robustpolish.errors import InvalidInputError
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring

# Designs held against the errors of a fit.

AT = ("x", "ground")
MASS, STIFFNESS = "dof.x.mass", "spring[0].stiffness"


def machine(stiffness=800.0, damping=4.0):
    return rp.MechanicalModel(
        [Dof("x", 2.0)], [Spring(AT, stiffness)], [Damper(AT, damping)],
        [Input("F", AT)], [Output("x", AT)],
    )  # fmt: skip


def with_state(model):
    return model.linearize(measured="state")


@dataclass(frozen=True)
class Fitted:
    model: rp.MechanicalModel
    covariance: xr.DataArray


def covariance(keys, matrix):
    return xr.DataArray(matrix, dims=("key", "other"), coords={"key": keys, "other": keys})


@pytest.fixture(scope="module")
def design():
    return rp.state_feedback(with_state(machine()), control_weight=1e-3)


def test_without_errors_every_machine_is_the_nominal_one(design):
    check = rp.simulation.check_robustness(
        design, machine(), standard_errors={STIFFNESS: 0.0}, plant_of=with_state, samples=3
    )
    assert check.norms == pytest.approx(design.certificate.achieved, rel=1e-5)
    assert check.unit == design.gain_unit == "m/N"
    assert check.plot().get_xlabel().startswith("H-infinity norm [")
    assert check.share_stable == 1.0
    assert check.least_share_stable == pytest.approx(0.05 ** (1 / 3))


def test_threads_give_the_bits_of_one_by_one(design):
    own = {"standard_errors": {STIFFNESS: 80.0, MASS: 0.1}, "plant_of": with_state, "samples": 10}
    alone = rp.simulation.check_robustness(design, machine(), **own)
    with ThreadPoolExecutor(2) as threads:
        beside = rp.simulation.check_robustness(design, machine(), executor=threads, **own)
    assert np.array_equal(alone.norms, beside.norms)
    assert np.array_equal(alone.parameters, beside.parameters)


def test_each_norm_is_that_of_its_machine(design):
    errors = {STIFFNESS: 80.0, MASS: 0.1}
    how = {"standard_errors": errors, "plant_of": with_state, "samples": 20, "seed": 4}
    check = rp.simulation.check_robustness(design, machine(), **how)
    assert np.std(check.parameters, axis=0) == pytest.approx([80.0, 0.1], rel=0.4)
    frequency = 1j * np.linspace(1, 60, 4000)
    for row, found in zip(check.parameters, check.norms, strict=True):
        model = machine().with_parameters(dict(zip(check.keys, row, strict=True)))
        loop = with_state(model).with_full_state().closed_loop(design.controller)
        # z is x, and the price on u, which is a fixed gain of the state
        C = np.vstack([loop.C[:1], 1e-3 * design.gain])
        pencils = frequency[:, None, None] * np.eye(2) - loop.A
        response = C @ np.linalg.solve(pencils, np.asarray(loop.B, complex)[None])
        assert found == pytest.approx(np.max(np.linalg.norm(response[:, :, 0], axis=1)), rel=1e-3)
    again = rp.simulation.check_robustness(design, machine(), **how)
    assert np.array_equal(again.norms, check.norms)


def test_what_the_fit_ties_together_stays_together(design):
    """A mass and a stiffness that are known by their ratio leave the resonance where it is."""
    keys = [MASS, STIFFNESS]
    size = np.array([0.2, 80.0])
    tied = Fitted(machine(), covariance(keys, np.outer(size, size)))
    check = rp.simulation.check_robustness(design, tied, plant_of=with_state, samples=30)
    ratio = check.parameters[:, 1] / check.parameters[:, 0]
    assert ratio == pytest.approx(400.0)
    assert np.std(check.parameters[:, 0]) > 0.1


def test_unstable_machines_are_counted(design):
    """A damper that may be negative: the loop is lost where control does not make up for it."""
    model = machine().with_effect("input_gain", ("F",), {"gain": 1.0})
    loose = rp.given_controller(
        model.linearize(measured="state").with_full_state(), np.array([[200.0, -1.0]])
    )
    check = rp.simulation.check_robustness(
        loose, model, standard_errors={STIFFNESS: 350.0}, plant_of=with_state, samples=100
    )
    expected = np.mean(check.parameters[:, 0] > 200.0)
    assert check.share_stable == pytest.approx(expected)
    assert 0.8 < check.share_stable < 1
    assert np.isinf(check.worst)
    assert check.worst_parameters[STIFFNESS] < 200
    assert "unstable" in check.plot().get_title()


def test_output_feedback_keeps_its_price_and_noise():
    plant = machine().linearize()
    design = rp.output_feedback(plant, control_weight=1e-3, measurement_noise=1e-4)
    check = rp.simulation.check_robustness(
        design, machine(), standard_errors={STIFFNESS: 8.0}, samples=10
    )
    assert check.median == pytest.approx(design.certificate.achieved, rel=0.1)
    assert check.worst >= check.median


def test_h2_norms():
    design = rp.state_feedback(with_state(machine()), "h2", control_weight=1e-3)
    check = rp.simulation.check_robustness(
        design, machine(), standard_errors={STIFFNESS: 8.0}, plant_of=with_state, samples=5
    )
    assert check.norms == pytest.approx(design.certificate.achieved, rel=0.1)
    assert loop_norm(design.closed_loop, "h2") == pytest.approx(design.certificate.achieved)


def test_numbers_without_a_known_error_are_left_out(design):
    errors = {STIFFNESS: 8.0, MASS: np.inf}
    check = rp.simulation.check_robustness(
        design, machine(), standard_errors=errors, plant_of=with_state, samples=5
    )
    assert check.keys == (STIFFNESS,)
    assert check.left_out == (MASS,)
    assert "not determined" in repr(check)


def test_an_effect_that_was_learnt_counts_by_its_slope():
    model = machine().with_effect("cubic_stiffness", AT, {"stiffness": 1e6})

    def bent(changed):
        return changed.linearize(measured="state", operating_point={"x": 0.01})

    design = rp.state_feedback(bent(model), control_weight=1.0)
    check = rp.simulation.check_robustness(
        design, model, standard_errors={"effect[0].stiffness": 2e5}, plant_of=bent, samples=20
    )
    assert np.std(check.norms) > 0.01 * check.median


def test_bad_input_is_refused(design):
    other = rp.MechanicalModel([Dof("q", 1.0)], outputs=[Output("x", "q")])
    with pytest.raises(rp.InvalidInputError, match="states q, dq"):
        rp.simulation.check_robustness(design, other, standard_errors={"dof.q.mass": 0.1})
    with pytest.raises(rp.InvalidInputError, match="mass"):
        rp.simulation.check_robustness(design, machine(), standard_errors={"mass": 0.1})
    with pytest.raises(rp.InvalidInputError, match="standard_errors"):
        rp.simulation.check_robustness(design, machine())
    with pytest.raises(rp.InvalidInputError, match="samples"):
        rp.simulation.check_robustness(design, machine(), standard_errors={MASS: 0.1}, samples=0)
    with pytest.raises(rp.InvalidInputError, match="Design"):
        rp.simulation.check_robustness(machine(), machine(), standard_errors={MASS: 0.1})
    with pytest.raises(rp.InvalidInputError, match="as large as its value"):
        rp.simulation.check_robustness(
            design, machine(), standard_errors={MASS: 1e6, STIFFNESS: 1e9},
            plant_of=with_state, samples=2000,
        )  # fmt: skip


def test_a_mass_stays_positive(design):
    check = rp.simulation.check_robustness(
        design, machine(), standard_errors={MASS: 1.0}, plant_of=with_state, samples=60
    )
    assert 0 < check.parameters.min() < 1.0
    assert check.nominal_parameters.tolist() == [2.0]


@pytest.mark.parametrize(
    ("variance", "samples", "told"),
    [
        (-1.0, 5, "standard_errors: got a negative variance"),
        (np.inf, 5, "learned: got no number with a known error"),
        (1.0, True, "samples: got True"),
        (1.0, 2.5, "samples: got 2.5"),
        (1e6, 1000, "standard_errors: got an error of dof.x.mass as large as its value"),
    ],
)
def test_bad_draws_are_named(design, variance, samples, told):
    learned = Fitted(machine(), covariance([MASS], [[variance]]))
    with pytest.raises(InvalidInputError, match=told):
        rp.simulation.check_robustness(design, learned, plant_of=with_state, samples=samples)


# What a check over many machines says.


def check(norms, left_out=()):
    norms = np.array(norms)
    masses = np.arange(1.0, norms.size + 1)[:, None]
    return rp.results.RobustnessCheck(
        "hinf", 1.0, norms, ("dof.x.mass",), masses, np.array([1.0]), left_out
    )


def test_the_least_share_is_the_exact_bound_of_clopper_and_pearson():
    """With all of n stable, the share p at which p^n is 5 %; with none of them, nothing."""
    assert check([1.0] * 59).least_share_stable == pytest.approx(0.05 ** (1 / 59))
    assert check([1.0, np.inf]).least_share_stable == pytest.approx(1 - 0.95**0.5)
    assert check([np.inf, np.inf]).least_share_stable == 0.0


def test_the_worst_machine_is_named():
    found = check([0.9, 3.0, 1.2])
    assert (found.samples, found.share_stable) == (3, 1.0)
    assert (found.median, found.worst) == (1.2, 3.0)
    assert found.worst_parameters == {"dof.x.mass": 2.0}


def test_the_picture_leaves_unstable_loops_out_and_says_so():
    ax = check([0.9, 1.1, np.inf, 1.2]).plot()
    assert sum(bar.get_height() for bar in ax.patches) == 3
    assert ax.get_title() == "1 of 4 unstable"
    assert check([0.9]).plot().get_title() == ""


def test_limits_hold_as_often_as_they_say():
    # Norms evenly between 0 and 1 stand for any distribution: the share within r is r.
    random, held, worst = np.random.default_rng(0), 0, 0
    for _ in range(2000):
        one = check(random.uniform(size=30))
        held += one.least_share_within(0.8, 0.9) <= 0.8
        worst += one.least_share_within(one.worst) <= one.worst
    assert held / 2000 > 0.9 - 0.02
    assert worst / 2000 == pytest.approx(0.95, abs=0.015)


def test_upper_limit_of_the_share():
    assert check([1.0] * 3).most_share_stable == 1.0
    assert check([1.0, np.inf]).most_share_stable == pytest.approx(0.95**0.5)
    with pytest.raises(rp.InvalidInputError, match="between 0 and 1"):
        check([1.0]).least_share_within(1.0, 95)


# Another machine in the place of the one that a design was made for.


def plant(stiffness):
    return machine(stiffness).linearize()


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"states": ["q", "dq"]}, "plant_of: got states q, dq, expected those of the design's"),
        ({"controls": ["push"]}, "plant_of: got controls push"),
        ({"disturbances": ["gust"]}, "plant_of: got disturbances gust"),
        ({"performance": ["tip"]}, "plant_of: got performance outputs tip"),
        ({"measurements": ["tip"]}, "plant_of: got measurements tip"),
    ],
)
def test_a_plant_with_other_signals_is_refused(change, told):
    design = rp.given_controller(plant(800.0), [[0.0]])
    with pytest.raises(InvalidInputError, match=told):
        rp.simulation.check_robustness(
            design,
            machine(),
            standard_errors={STIFFNESS: 8.0},
            plant_of=lambda model: model.linearize().replace(**change),
            samples=2,
        )
