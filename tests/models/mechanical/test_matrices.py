"""Mass, damping and stiffness matrices, against hand-written ones and integration."""

import numpy as np
from scipy.integrate import solve_ivp

from robustpolish.linear.response import linear_response
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from tests.models.mechanical.two_masses import two_masses


def test_matrices_of_two_masses():
    m = two_masses().matrices
    np.testing.assert_allclose(m.M, np.diag([0.6, 0.2]))
    np.testing.assert_allclose(m.K, [[1.3e5, -3e4], [-3e4, 3e4]])
    np.testing.assert_allclose(m.C, [[15.0, -2.0], [-2.0, 2.0]])
    np.testing.assert_allclose(m.B, [[0.0], [-1.0]])


def test_state_space_is_the_equation_of_motion():
    system = two_masses().state_space()
    assert system.state_labels == ["x_m", "x", "x_m_dot", "x_dot"]
    np.testing.assert_allclose(system.A[3], [3e4 / 0.2, -3e4 / 0.2, 2 / 0.2, -2 / 0.2])
    np.testing.assert_allclose(system.B[:, 0], [0, 0, 0, -5.0])


def test_outputs_of_every_quantity_agree_with_each_other():
    ground = ("x", "ground")
    outputs = [
        Output("x", ground),
        Output("v", ground, "velocity"),
        Output("a", ground, "acceleration"),
        Output("rel", ("x", "x_m")),
        Output("f", ("x", "x_m"), "force"),
    ]
    model = two_masses(outputs=outputs)
    time = np.linspace(0, 0.2, 4001)
    force = np.sin(80 * time) ** 2
    y, s = linear_response(model.state_space(), time, force[:, None])
    dt = time[1]
    np.testing.assert_allclose(
        np.gradient(y[:, 0], dt)[5:-5], y[5:-5, 1], atol=2e-4 * np.ptp(y[:, 1])
    )
    np.testing.assert_allclose(
        np.gradient(y[:, 1], dt)[5:-5], y[5:-5, 2], atol=2e-4 * np.ptp(y[:, 2])
    )
    np.testing.assert_allclose(y[:, 3], s[:, 1] - s[:, 0])
    np.testing.assert_allclose(y[:, 4], 3e4 * y[:, 3] + 2.0 * (s[:, 3] - s[:, 2]))
    # Newton on x alone: the connection pulls it back, the input acts with gain -1.
    np.testing.assert_allclose(0.2 * y[:, 2], -force - y[:, 4], atol=1e-9)


def test_a_force_between_two_masses_acts_on_both():
    m = two_masses(inputs=[Input("F", ("x", "x_m"))]).matrices
    np.testing.assert_allclose(m.B[:, 0], [-1.0, 1.0])


def test_imposed_motion_drives_the_free_mass():
    model = two_masses(
        inputs=[Input("base", ("x_m", "ground"), "displacement", gain=2.0)],
        outputs=[Output("x", ("x", "ground")), Output("rel", ("x", "x_m"))],
    )
    assert model.free == ("x",)
    system = model.state_space()
    assert system.input_labels == ["base", "base_dot"]
    omega = 150.0
    time = np.linspace(0, 0.3, 6001)
    base = np.column_stack([np.sin(omega * time), omega * np.cos(omega * time)])
    y, _ = linear_response(system, time, base)

    def rhs(t, s):
        d, v = 2 * np.sin(omega * t), 2 * omega * np.cos(omega * t)
        return [s[1], (-3e4 * (s[0] - d) - 2.0 * (s[1] - v)) / 0.2]

    exact = solve_ivp(rhs, (0, 0.3), [0, 0], t_eval=time, rtol=1e-10, atol=1e-12).y[0]
    np.testing.assert_allclose(y[:, 0], exact, atol=1e-4 * np.ptp(exact))
    np.testing.assert_allclose(y[:, 1], y[:, 0] - 2 * base[:, 0], rtol=1e-12)


def test_a_test_rig_has_force_outputs_and_no_states():
    rig = MechanicalModel(
        [Dof("x", 2.0)],
        [Spring(("x", "ground"), 50.0)],
        [Damper(("x", "ground"), 4.0)],
        [Input("x", ("x", "ground"), "displacement")],
        [Output("f", ("x", "ground"), "force"), Output("drive", ("x",), "force", drive=True)],
    )
    system = rig.state_space()
    assert system.input_labels == ["x", "x_dot", "x_ddot"]
    np.testing.assert_allclose(system.D, [[50.0, 4.0, 0.0], [50.0, 4.0, 2.0]])


def test_free_decay_needs_no_input():
    model = two_masses(inputs=[])
    system = model.state_space()
    assert system.input_labels == ["no_input"]
    time = np.linspace(0, 0.1, 101)
    y, _ = linear_response(system, time, np.zeros((101, 1)), [0, 1e-3, 0, 0])
    assert 0.5e-3 < np.abs(y).max() <= 1.001e-3
