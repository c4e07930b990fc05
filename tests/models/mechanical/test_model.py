"""Mechanical models against hand-written matrices and the air bearing."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from robustpolish.errors import InvalidInputError, RobustPolishWarning
from robustpolish.models import (
    AirBearingParameters,
    Damper,
    Dof,
    Input,
    MechanicalModel,
    Output,
    Spring,
    air_bearing,
)
from robustpolish.simulation import linear_response

GROUND = ("x", "ground")


def two_masses(**changes):
    parts = {
        "dofs": [Dof("x_m", 0.6), Dof("x", 0.2)],
        "springs": [Spring(("x_m", "ground"), 1e5), Spring(("x_m", "x"), 3e4)],
        "dampers": [Damper(("x_m", "ground"), 13.0), Damper(("x", "x_m"), 2.0)],
        "inputs": [Input("F", ("x", "ground"), gain=-1.0)],
        "outputs": [Output("x", ("x", "ground"))],
    }
    return MechanicalModel(**{**parts, **changes})


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


def test_a_model_without_springs_integrates():
    model = MechanicalModel(
        [Dof("q", 95.0)],
        dampers=[Damper(("q", "ground"), 203.5)],
        inputs=[Input("V", ("q", "ground"), gain=35.15, unit="V")],
        outputs=[Output("q", ("q", "ground"))],
    )
    assert 0 in np.linalg.eigvals(model.state_space().A)
    assert model.unit_of(model.inputs[0]) == "V"


def test_rotation_has_its_units():
    model = MechanicalModel(
        [Dof("phi", 0.01, rotational=True)],
        [Spring(("phi", "ground"), 3.0)],
        inputs=[Input("T", ("phi", "ground"))],
        outputs=[Output("phi", ("phi", "ground"), "angle")],
    )
    assert model.outputs[0].quantity == "displacement"
    assert [model.unit_of(i) for i in (*model.inputs, *model.outputs)] == ["N m", "rad"]


@pytest.mark.parametrize("actuation", ["force", "displacement"])
@pytest.mark.parametrize("measured", ["state", "displacement"])
@pytest.mark.parametrize("dissipation", [0.0, 0.001])
def test_the_air_bearing_is_the_same_plant(actuation, measured, dissipation):
    parameters = AirBearingParameters()
    plant = air_bearing(parameters, dissipation, actuation, measured)
    ours = MechanicalModel.from_air_bearing(parameters, dissipation).linearize(
        actuation=actuation, measured=measured
    )
    for name in ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22"):
        np.testing.assert_allclose(getattr(ours, name), getattr(plant, name), rtol=1e-12)
    for names in ("states", "disturbance_names", "control_names", "performance_names"):
        assert getattr(ours, names) == getattr(plant, names)
    assert ours.measurement_names == plant.measurement_names
    assert dict(ours.units) == dict(plant.units)


def test_linearisation_takes_the_slope_of_effects():
    ground = ("x", "ground")
    model = two_masses().with_effect("cubic_stiffness", ground, {"stiffness": 4e9})
    np.testing.assert_allclose(model.linearize().A, two_masses().linearize().A)
    stiff = model.linearize(operating_point={"x": 1e-3})
    np.testing.assert_allclose(stiff.A[3, 2], -(3e4 + 3 * 4e9 * 1e-6) / 0.2, rtol=1e-6)


def test_linearisation_finds_the_equilibrium():
    model = MechanicalModel(
        [Dof("x", 2.0)], [Spring(("x", "ground"), 8.0)], outputs=[Output("x", ("x", "ground"))]
    )
    loaded = model.with_effect("constant_force", "x", {"force": 11.0}).with_effect(
        "cubic_stiffness", ("x", "ground"), {"stiffness": 3.0}
    )
    x = np.roots([3.0, 0.0, 8.0, -11.0])
    x = float(x[np.abs(x.imag) < 1e-9].real[0])
    np.testing.assert_allclose(loaded.linearize().A[1, 0], -(8 + 9 * x**2) / 2, rtol=1e-6)


def test_linearisation_keeps_the_states_of_effects():
    resonator = {"mass": 0.02, "stiffness": 500.0, "damping": 0.3}
    plant = two_masses().with_effect("attached_resonator", "x", resonator).linearize()
    three = MechanicalModel(
        [Dof("x_m", 0.6), Dof("x", 0.2), Dof("r", 0.02)],
        [*two_masses().springs, Spring(("x", "r"), 500.0)],
        [*two_masses().dampers, Damper(("x", "r"), 0.3)],
        outputs=two_masses().outputs,
    )
    by_size = lambda A: np.sort_complex(np.linalg.eigvals(A))  # noqa: E731
    np.testing.assert_allclose(by_size(plant.A), by_size(three.linearize().A), rtol=1e-8)


def test_linearisation_leaves_out_what_jumps_and_says_so():
    model = two_masses().with_effect("coulomb_friction", ("x", "ground"), {"force": 3.0})
    with pytest.warns(RobustPolishWarning, match="coulomb_friction at x, ground jumps"):
        plant = model.linearize()
    np.testing.assert_allclose(plant.A, two_masses().linearize().A)


def test_linearisation_applies_gains_and_delays():
    plain = two_masses()
    model = (
        plain.with_effect("input_gain", "F", {"gain": 1.5})
        .with_effect("sensor_gain", "x", {"gain": 0.5})
        .with_effect("input_delay", "F", {"delay": 1e-3})
    )
    here, there = model.linearize().system, plain.linearize().system
    w = 300.0
    expected = 0.75 * np.exp(-1j * w * 1e-3) * there(1j * w)[-1, 0]
    np.testing.assert_allclose(here(1j * w)[-1, 0], expected, rtol=1e-4)


def test_an_input_can_become_a_control():
    plant = two_masses().linearize(controls=["F"])
    assert plant.nw == 0
    assert plant.control_names == ("F",)
    np.testing.assert_allclose(plant.B2[:, 0], [0, 0, 0, -5.0])


def test_parameters_by_key_and_back():
    model = two_masses().with_effect("coulomb_friction", ("x", "ground"), {"force": 3.0})
    keys = model.parameters
    assert keys["dof.x.mass"] == 0.2
    assert keys["spring[1].stiffness"] == 3e4
    assert keys["effect[0].force"] == 3.0
    changed = model.with_parameters({"dof.x.mass": 0.3, "effect[0].force": 4.0})
    assert changed.parameters["dof.x.mass"] == 0.3
    assert changed.effects[0].parameters["force"] == 4.0
    assert model.parameters["dof.x.mass"] == 0.2
    with pytest.raises(InvalidInputError, match=r"dof\.y\.mass"):
        model.with_parameters({"dof.y.mass": 1.0})


def test_models_travel_to_other_processes():
    model = two_masses().with_effect("coulomb_friction", ("x", "ground"), {"force": 3.0})
    model.state_space()
    again = pickle.loads(pickle.dumps(model))
    assert again == model
    assert "matrices" not in vars(again)  # made anew where they are needed
    np.testing.assert_array_equal(again.matrices.K, model.matrices.K)
    assert copy.deepcopy(model) == model
    assert isinstance(replace(model, name="other"), MechanicalModel)


def test_a_replaced_part_gives_new_matrices():
    model = two_masses()
    assert model.matrices.K[0, 0] == 1.3e5
    stiffer = replace(model, springs=[Spring(("x_m", "ground"), 2e5)])
    assert stiffer.springs == (Spring(("x_m", "ground"), 2e5),)
    assert stiffer.matrices.K[0, 0] == 2e5


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: Dof("x", -1.0), ("dof", "x", "mass")),
        (lambda: Dof("x", "1", rotational=True), ("dof", "x", "inertia")),
        (lambda: two_masses(springs=[Spring(GROUND, np.nan)]), ("spring", 0, "stiffness")),
        (lambda: two_masses(dampers=[Damper(("x", "y"), 1.0)]), ("damper", 0, "between")),
        (lambda: Input("F", GROUND, gain=0), ("input", "F", "gain")),
        (lambda: two_masses(inputs=[Input("F", GROUND)] * 2), ("input", "F")),
        (lambda: two_masses(outputs=[Output("x", GROUND, "angle")]), ("output", "x", "quantity")),
        (
            lambda: two_masses(inputs=[Input("v", GROUND, "velocity")]),
            ("input", "v", "motion_of"),
        ),
        (lambda: two_masses().with_effect("input_gain", "x"), ("effect", 0, "at")),
        (lambda: two_masses(spin_frequency=-1.0), ("spin_frequency",)),
    ],
)
def test_errors_carry_keys(make, key):
    with pytest.raises(InvalidInputError) as caught:
        make()
    assert caught.value.key == key
    assert pickle.loads(pickle.dumps(caught.value)).key == key


def test_the_table_shows_units_of_effects():
    turning = MechanicalModel(
        [Dof("phi", 1.0, rotational=True)],
        [Spring(("phi", "ground"), 1.0)],
        [Damper(("phi", "ground"), 1.0)],
        outputs=[Output("angle", ("phi", "ground"))],
    )
    turning = turning.with_effect("cubic_stiffness", "phi", {"stiffness": 2.0})
    shown = str(turning.with_effect("sensor_offset", "angle", {"offset": 0.1}))
    for unit in ("kg m^2", "N m/rad\n", "N m s/rad", "N m/rad^3", "0.1  rad"):
        assert unit in shown


BAD = {
    "mass": (lambda: two_masses(dofs=[Dof("x", -1.0)]), r"dof\.x\.mass"),
    "zero mass": (lambda: MechanicalModel([Dof("x", 0.0)], outputs=[Output("x", GROUND)]), "mass"),
    "no dof": (lambda: MechanicalModel([]), "dof"),
    "no output": (lambda: MechanicalModel([Dof("x", 1.0)]), "output"),
    "text for a number": (lambda: Dof("x", "1"), "quotation marks"),
    "nan": (lambda: two_masses(springs=[Spring(GROUND, np.nan)]), r"spring\[0\]\.stiffness"),
    "nowhere": (lambda: two_masses(springs=[Spring(("x", "y"), 1.0)]), r"'y'.*x_m, x, ground"),
    "one end": (lambda: two_masses(springs=[Spring(("x",), 1.0)]), "two ends"),
    "same end": (lambda: two_masses(dampers=[Damper(("x", "x"), 1.0)]), "twice"),
    "same dof": (lambda: two_masses(dofs=[Dof("x", 1.0), Dof("x", 1.0)]), "of this name"),
    "same input": (lambda: two_masses(inputs=[Input("F", GROUND)] * 2), "of this name"),
    "same output": (lambda: two_masses(outputs=[Output("x", GROUND)] * 2), "of this name"),
    "gain": (lambda: Input("F", GROUND, gain=0), "gain"),
    "quantity": (lambda: two_masses(outputs=[Output("x", GROUND, "position")]), "quantity"),
    "angle of a mass": (lambda: two_masses(outputs=[Output("x", GROUND, "angle")]), "which has"),
    "mixed": (
        lambda: MechanicalModel(
            [Dof("x", 1.0), Dof("p", 1.0, rotational=True)],
            [Spring(("x", "p"), 1.0)],
            outputs=[Output("x", GROUND)],
        ),
        "one in m and one in rad",
    ),
    "velocity alone": (lambda: two_masses(inputs=[Input("v", GROUND, "velocity")]), "displacement"),
    "force on imposed": (
        lambda: two_masses(inputs=[Input("b", GROUND, "displacement"), Input("F", GROUND)]),
        "imposed",
    ),
    "drive of a free mass": (
        lambda: two_masses(outputs=[Output("D", ("x",), "force", drive=True)]),
        "imposes",
    ),
    "spin": (lambda: two_masses(spin_frequency=-1.0), "spin_frequency"),
    "unknown effect": (lambda: two_masses().with_effect("magic", GROUND), "magic"),
    "effect nowhere": (lambda: two_masses().with_effect("coulomb_friction", ("u", "x")), "'u'"),
    "effect on no input": (lambda: two_masses().with_effect("input_gain", "x"), "one of F"),
    "velocity's name": (lambda: two_masses(dofs=[Dof("x", 1.0), Dof("dx", 1.0)]), "velocity of"),
    "a string of dofs": (lambda: MechanicalModel("x"), "list"),
    "control": (lambda: two_masses().linearize(controls=["q"]), "controls"),
    "operating point": (lambda: two_masses().linearize(operating_point={"q": 1.0}), "'q'"),
}


@pytest.mark.parametrize("case", BAD)
def test_refused_with_the_key(case):
    make, message = BAD[case]
    with pytest.raises(InvalidInputError, match=message):
        make()
