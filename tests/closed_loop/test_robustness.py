"""Designs held against the errors of a fit."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.closed_loop.sampled_loops import loop_norm
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring

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
    check = rp.simulation.check_robustness(
        design, machine(), standard_errors={STIFFNESS: 80.0, MASS: 0.1}, plant_of=with_state,
        samples=20, seed=4,
    )  # fmt: skip
    assert np.std(check.parameters, axis=0) == pytest.approx([80.0, 0.1], rel=0.4)
    for row, found in zip(check.parameters, check.norms, strict=True):
        model = machine().with_parameters(dict(zip(check.keys, row, strict=True)))
        loop = with_state(model).with_full_state().closed_loop(design.controller)
        frequency = 1j * np.linspace(1, 60, 4000)
        # z is x, and the price on u, which is a fixed gain of the state
        gain = 1e-3 * design.gain
        C = np.vstack([loop.C[:1], gain])
        response = np.array(
            [C @ np.linalg.solve(s * np.eye(2) - loop.A, np.asarray(loop.B)) for s in frequency]
        )
        assert found == pytest.approx(np.max(np.linalg.norm(response[:, :, 0], axis=1)), rel=1e-3)
    again = rp.simulation.check_robustness(
        design, machine(), standard_errors={STIFFNESS: 80.0, MASS: 0.1}, plant_of=with_state,
        samples=20, seed=4,
    )  # fmt: skip
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
        loose, model, standard_errors={STIFFNESS: 250.0}, plant_of=with_state, samples=400
    )
    expected = np.mean(check.parameters[:, 0] > 200.0)
    assert check.share_stable == pytest.approx(expected)
    assert 0.9 < check.share_stable < 1
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
