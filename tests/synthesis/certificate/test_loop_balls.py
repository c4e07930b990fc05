"""Controllers may come as transfer functions."""

import sys

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.linear.arithmetic import balls
from robustpolish.synthesis.proofs.bounded_real import BITS, enclose_system, gain_at


def plant(signals=1, dt=0):
    one = np.eye(signals)
    return rp.GeneralizedPlant.from_matrices(one, one, one, one, one, dt=dt)


@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_a_transfer_function_is_certified_as_its_realisation_is(norm):
    K = control.tf([-30.0, -200.0], [1.0, 40.0])
    found = rp.certify(plant(), K, norm)
    other = rp.certify(plant(), control.ss(K), norm)
    assert found.valid, found.reasons
    assert found.achieved == pytest.approx(other.achieved, rel=1e-9)
    assert found.poles == pytest.approx(other.poles)


def test_a_discrete_transfer_function_is_certified():
    K = control.tf([-0.5], [1.0, 0.1], 0.1)
    assert rp.certify(plant(dt=0.1), K).valid
    with pytest.raises(rp.InvalidInputError, match="controller"):
        rp.certify(plant(), K)


def test_several_signals_are_realised_with_the_fewest_states():
    K = control.TransferFunction([[[-3.0], [0.0]], [[0.0], [-3.0]]], [[[0.01, 1.0]] * 2] * 2)
    certificate = rp.certify(plant(2), K)
    assert certificate.valid, certificate.reasons
    assert certificate.poles.size == 4


def test_without_slycot_the_message_says_so(monkeypatch):
    for name in [name for name in sys.modules if name.split(".")[0] == "slycot"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "slycot", None)
    lag = control.tf([-3.0], [0.01, 1.0])
    assert rp.certify(plant(), lag).valid  # one input and one output need none
    K = control.TransferFunction([[[-3.0]] * 2] * 2, [[[0.01, 1.0]] * 2] * 2)
    with pytest.raises(rp.InvalidInputError, match=r"slycot is missing.*state-space realisation"):
        rp.certify(plant(2), K)


def test_a_design_of_a_transfer_function_has_the_names_of_the_plant():
    design = rp.given_controller(plant(), control.tf([-3.0], [0.01, 1.0]))
    assert design.controller.input_labels == list(design.plant.measurement_names)
    assert design.controller.output_labels == list(design.plant.control_names)
    assert design.certificate.valid


@pytest.mark.parametrize(
    ("controller", "told"),
    [
        (control.tf([-3.0, 1, 0], [1.0, 1]), "improper TransferFunction.*Add a lag"),
        (control.combine_tf([[control.tf([1], [1, 1])] * 2]), "1 outputs and 2 inputs"),
        (control.frd([1, 1], [1, 2]), "got FrequencyResponseData.*TransferFunction or a gain"),
        ("high", "real matrix"),
    ],
)
def test_other_controllers_are_refused_with_the_right_hint(controller, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        rp.certify(plant(), controller)


def test_a_plant_has_to_name_its_signals():
    with pytest.raises(rp.InvalidInputError, match=r"plant: got TransferFunction.*measurements="):
        rp.certify(control.tf([1], [1, 1]), [[-3.0]])


@pytest.mark.parametrize("damping", [1e-1, 1e-13])
def test_the_gain_of_many_states_is_right_to_the_last_digit(damping):
    """Light damping makes doubles useless, so that balls solve it all."""
    A = np.zeros((64, 64))
    for k in range(32):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[0.0, 1.0], [-1.0, -damping]]
    B, C = np.tile([[0.0], [1.0]], (32, 1)), np.tile([[1.0, 0.0]], (1, 32))
    loop = enclose_system(control.StateSpace(A, B, C, 0))
    with balls.precision(BITS):
        assert gain_at(loop, 1.0) == pytest.approx(32 / damping, rel=1e-15)
        assert gain_at(loop, np.inf) == 0.0
