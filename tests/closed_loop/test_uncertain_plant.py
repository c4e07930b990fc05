"""Another machine in the place of the one that a design was made for."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.closed_loop.sampled_loops import loop_norm, with_added_signals
from robustpolish.errors import InvalidInputError

AT = ("x", "ground")


def plant(stiffness):
    model = rp.MechanicalModel(
        [rp.Dof("x", 2.0)], [rp.Spring(AT, stiffness)], [rp.Damper(AT, 4.0)],
        [rp.Input("F", AT)], [rp.Output("x", AT)],
    )  # fmt: skip
    return model.linearize()


def priced(machine):
    """With a price on u behind the displacement and noise on y behind the force."""
    return machine.replace(
        B1=np.hstack([machine.B1, [[0.0], [0.0]]]),
        C1=np.vstack([machine.C1, [[0.0, 0.0]]]),
        D12=[[0.0], [1e-3]], D11=np.zeros((2, 2)), D21=[[0.0, 1e-4]],
        disturbances=[*machine.disturbance_names, "noise"],
        performance=[*machine.performance_names, "price"],
    )  # fmt: skip


def test_the_machine_is_new_and_price_and_noise_stay():
    nominal, other = priced(plant(800.0)), plant(900.0)
    found = with_added_signals(nominal, other)
    np.testing.assert_array_equal(found.A, other.A)
    np.testing.assert_array_equal(found.B1[:, :1], other.B1)
    for name in ("D12", "D21", "C2", "B2"):
        np.testing.assert_array_equal(getattr(found, name), getattr(nominal, name))
    assert found.system.input_labels == nominal.system.input_labels
    assert found.system.output_labels == nominal.system.output_labels
    assert found.A[1, 0] == pytest.approx(-450.0)


def test_a_measured_state_is_made_up_for():
    nominal = plant(800.0).with_full_state()
    assert with_added_signals(nominal, plant(900.0)).measurement_names == nominal.measurement_names


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
    with pytest.raises(InvalidInputError, match=told):
        with_added_signals(plant(800.0), plant(900.0).replace(**change))


def test_norms_of_loops():
    lag = control.ss(-2.0, 1.0, 1.0, 0.0)
    assert loop_norm(lag, "hinf") == pytest.approx(0.5)
    assert loop_norm(lag, "h2") == pytest.approx(0.5)
    sampled = control.ss(0.5, 1.0, 1.0, 0.0, 0.1)
    assert loop_norm(sampled, "hinf") == pytest.approx(2.0)
    assert loop_norm(control.ss(2.0, 1.0, 1.0, 0.0), "hinf") == np.inf
    constant = control.StateSpace([], [], [], [[3.0]])
    assert loop_norm(constant, "hinf") == pytest.approx(3.0)
