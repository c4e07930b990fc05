"""Mechanical models: parts, matrices, linearisation, responses, uncertain numbers."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import robustpolish as rp
from robustpolish.errors import InvalidInputError, RobustPolishWarning
from robustpolish.linear.response import linear_response
from robustpolish.machines.effects.effect import Effect, lookup
from robustpolish.machines.effects.user_defined import own_kind
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring

GROUND = ("x", "ground")
READS_U = own_kind({"formula": "f = -c*u*v", "units": {"c": "N s/(m V)"}, "channels": {"u": "V"}})


def two_masses(**changes):
    """Return a bearing on a spring and a tool on the bearing, with other parts where named."""
    parts = {
        "dofs": [Dof("x_m", 0.6), Dof("x", 0.2)],
        "springs": [Spring(("x_m", "ground"), 1e5), Spring(("x_m", "x"), 3e4)],
        "dampers": [Damper(("x_m", "ground"), 13.0), Damper(("x", "x_m"), 2.0)],
        "inputs": [Input("F", GROUND, gain=-1.0)],
        "outputs": [Output("x", GROUND)],
    }
    return MechanicalModel(**{**parts, **changes})


# Each part of a model, checked when it is made.


def only(dofs=None, springs=()):
    """Return a model of one body, if nothing else is said, that shows its displacement."""
    return MechanicalModel(dofs or [Dof("x", 2.0)], springs, outputs=[Output("x", GROUND)])


@pytest.mark.parametrize(
    ("make", "told"),
    [(lambda: Dof("ground", 1.0), "a name other than 'ground'"),
     (lambda: Dof("a.b", 1.0), "dof: got 'a.b', expected a name without a dot"),
     (lambda: Input(" ", GROUND), "input: got ' ', expected a name"),
     (lambda: Input("F", GROUND, gain=0.0), r"input\.F\.gain: got 0.0, expected a number other"),
     (lambda: Input("F", GROUND, unit=""), r"input\.F\.unit: got '', expected a unit"),
     (lambda: Output("x", GROUND, unit=3), r"output\.x\.unit: got 3, expected a unit"),
     (lambda: only(dofs=[Dof("x", 0.0)]), "mass"), (lambda: MechanicalModel([]), "dof"),
     (lambda: MechanicalModel([Dof("x", 1.0)]), "output"), (lambda: MechanicalModel("x"), "list"),
     (lambda: two_masses(springs=[Spring(("x",), 1.0)]), "two ends"),
     (lambda: two_masses(dampers=[Damper(("x", "x"), 1.0)]), "twice"),
     (lambda: two_masses(dofs=[Dof("x", 1.0), Dof("x", 1.0)]), "of this name"),
     (lambda: two_masses(outputs=[Output("x", GROUND)] * 2), "of this name"),
     (lambda: two_masses(outputs=[Output("x", GROUND, "position")]), "quantity"),
     (lambda: only(dofs=[Dof("x", 1.0), Dof("p", 1.0, True)], springs=[Spring(("x", "p"), 1.0)]),
      "one in m and one in rad"),
     (lambda: two_masses(inputs=[Input("b", GROUND, "displacement"), Input("F", GROUND)]),
      "imposed"),
     (lambda: two_masses(outputs=[Output("D", ("x",), "force", drive=True)]), "imposes"),
     (lambda: two_masses().with_effect("magic", GROUND), "magic"),
     (lambda: two_masses().with_effect("coulomb_friction", ("u", "x")), "'u'"),
     (lambda: two_masses(dofs=[Dof("x", 1.0), Dof("dx", 1.0)]), "velocity of"),
     (lambda: two_masses().linearize(controls=["q"]), "controls"),
     (lambda: two_masses().linearize(operating_point={"q": 1.0}), "'q'")],
)  # fmt: skip
def test_bad_parts_are_named(make, told):
    with pytest.raises(InvalidInputError, match=told):
        make()


@pytest.mark.parametrize(
    ("make", "key"),
    [(lambda: Dof("x", -1.0), ("dof", "x", "mass")),
     (lambda: Dof("x", "1", rotational=True), ("dof", "x", "inertia")),
     (lambda: two_masses(springs=[Spring(GROUND, np.nan)]), ("spring", 0, "stiffness")),
     (lambda: two_masses(dampers=[Damper(("x", "y"), 1.0)]), ("damper", 0, "between")),
     (lambda: Input("F", GROUND, gain=0), ("input", "F", "gain")),
     (lambda: two_masses(inputs=[Input("F", GROUND)] * 2), ("input", "F")),
     (lambda: two_masses(outputs=[Output("x", GROUND, "angle")]), ("output", "x", "quantity")),
     (lambda: two_masses(inputs=[Input("v", GROUND, "velocity")]), ("input", "v", "motion_of")),
     (lambda: two_masses().with_effect("input_gain", "x"), ("effect", 0, "at")),
     (lambda: two_masses(effects=[Effect.of(READS_U, GROUND)]), ("effect", 0, "at")),
     (lambda: two_masses(spin_frequency=-1.0), ("spin_frequency",))],
)  # fmt: skip
def test_errors_carry_keys(make, key):
    with pytest.raises(InvalidInputError) as caught:
        make()
    assert caught.value.key == key
    assert pickle.loads(pickle.dumps(caught.value)).key == key


# Mass, damping and stiffness matrices, against hand-written ones and integration.


def test_state_space_is_the_equation_of_motion():
    system = two_masses().state_space()
    assert system.state_labels == ["x_m", "x", "x_m_dot", "x_dot"]
    np.testing.assert_allclose(system.A[3], [3e4 / 0.2, -3e4 / 0.2, 2 / 0.2, -2 / 0.2])
    np.testing.assert_allclose(system.B[:, 0], [0, 0, 0, -5.0])


def test_outputs_of_every_quantity_agree_with_each_other():
    outputs = [
        Output("x", GROUND), Output("v", GROUND, "velocity"), Output("a", GROUND, "acceleration"),
        Output("rel", ("x", "x_m")), Output("f", ("x", "x_m"), "force"),
    ]  # fmt: skip
    model = two_masses(outputs=outputs)
    time = np.linspace(0, 0.2, 4001)
    force = np.sin(80 * time) ** 2
    y, s = linear_response(model.state_space(), time, force[:, None])
    dt = time[1]
    for k in (0, 1):
        rate = np.gradient(y[:, k], dt)[5:-5]
        np.testing.assert_allclose(rate, y[5:-5, k + 1], atol=2e-4 * np.ptp(y[:, k + 1]))
    np.testing.assert_allclose(y[:, 3], s[:, 1] - s[:, 0])
    np.testing.assert_allclose(y[:, 4], 3e4 * y[:, 3] + 2.0 * (s[:, 3] - s[:, 2]))
    # Newton on x alone: the connection pulls it back, the input acts with gain -1.
    np.testing.assert_allclose(0.2 * y[:, 2], -force - y[:, 4], atol=1e-9)


def test_imposed_motion_drives_the_free_mass():
    model = two_masses(
        inputs=[Input("base", ("x_m", "ground"), "displacement", gain=2.0)],
        outputs=[Output("x", GROUND), Output("rel", ("x", "x_m"))],
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
        [Spring(GROUND, 50.0)],
        [Damper(GROUND, 4.0)],
        [Input("x", GROUND, "displacement")],
        [Output("f", GROUND, "force"), Output("drive", ("x",), "force", drive=True)],
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


# The data of a model: copied, sent, changed.


def test_rotation_has_its_units():
    model = MechanicalModel(
        [Dof("phi", 0.01, rotational=True)],
        [Spring(("phi", "ground"), 3.0)],
        inputs=[Input("T", ("phi", "ground"))],
        outputs=[Output("phi", ("phi", "ground"), "angle")],
    )
    assert model.outputs[0].quantity == "displacement"
    assert [model.unit_of(i) for i in (*model.inputs, *model.outputs)] == ["N m", "rad"]


def test_models_travel_to_other_processes():
    model = two_masses().with_effect("coulomb_friction", GROUND, {"force": 3.0})
    model.state_space()
    again = pickle.loads(pickle.dumps(model))
    assert again == model
    assert "matrices" not in vars(again)  # made anew where they are needed
    np.testing.assert_array_equal(again.matrices.K, model.matrices.K)
    assert copy.deepcopy(model) == model
    assert isinstance(replace(model, name="other"), MechanicalModel)


def test_parameters_by_key_and_back():
    model = two_masses().with_effect("coulomb_friction", GROUND, {"force": 3.0})
    known = {"dof.x.mass": 0.2, "spring[1].stiffness": 3e4, "effect[0].force": 3.0}
    assert model.parameters.items() >= known.items()
    new = {"dof.x.mass": 0.3, "effect[0].force": 4.0, "effect[0].width": 0.1}
    changed = model.with_parameters(new)
    assert changed.parameters.items() >= new.items()
    assert changed.effects[0].parameters == {"force": 4.0, "width": 0.1}
    assert model.parameters.items() >= known.items()
    with pytest.raises(InvalidInputError, match=r"dof\.y\.mass"):
        model.with_parameters({"dof.y.mass": 1.0})


@pytest.mark.parametrize("bad", [True, "2", float("nan"), float("inf"), -1.0, 0.0, 1e200])
def test_a_mass_that_is_changed_is_checked(bad):
    with pytest.raises(InvalidInputError, match=r"dof\.x\.mass"):
        two_masses().with_parameters({"dof.x.mass": bad})


def test_the_matrices_are_those_of_the_changed_numbers():
    model = two_masses().with_effect("coulomb_friction", GROUND, {"force": 3.0})
    known = model.matrices
    stiffer = model.with_parameters({"spring[1].stiffness": 6e4})
    assert stiffer.matrices.K[1, 1] == 2 * known.K[1, 1]
    assert model.with_parameters({"effect[0].force": 4.0}).matrices is known
    with pytest.raises(ValueError, match="read-only"):
        known.inverse_mass[0, 0] = 1.0


def test_a_channel_is_a_signal_in_a_unit_of_its_own_that_nothing_holds():
    base = only(springs=[Spring(GROUND, 3.0)]).with_channel("u", "V")
    assert base.channels == ("u",)
    held = replace(base, springs=(Spring(("x", "u"), 3.0),))
    seen = replace(base, outputs=(Output("x", ("x", "u")),))
    table = replace(base, inputs=(Input("u", ("u", "ground"), "displacement"),))
    metres = replace(base, inputs=(Input("u", ("u", "ground"), "displacement", unit="m"),))
    sensor = replace(base, inputs=(Input("u", ("u", "ground"), "displacement", 2e-3, "V"),))
    assert [m.channels for m in (held, seen, table, metres, sensor)] == [()] * 5


# Mechanical models as users make them.


def test_an_effect_may_be_given_by_its_kind():
    base = only()
    assert 0 in np.linalg.eigvals(base.state_space().A)  # nothing holds it
    named = base.with_effect("cubic_stiffness", "x", {"stiffness": 3.0})
    assert base.with_effect(lookup("cubic_stiffness"), "x", {"stiffness": 3.0}) == named
    assert named.effects[0].own is None


def test_a_channel_is_added_once():
    base = only()
    twice = base.with_effect(READS_U, "x", {"c": 1.0}).with_effect(READS_U, "x", {"c": 2.0})
    assert twice.dof_names == ("x", "u")
    assert twice.input_names == ("u",)
    assert twice.unit_of(twice.inputs[0]) == "V"
    assert base.with_channel("u", "V").without_effects() == twice.without_effects()
    with pytest.raises(InvalidInputError, match="Rename"):
        twice.with_channel("u", "V")


# How a model shows itself.


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


# The slopes of effects in a linear model, against derivatives known by hand.


def test_linearisation_takes_the_slope_of_effects():
    model = two_masses().with_effect("cubic_stiffness", GROUND, {"stiffness": 4e9})
    np.testing.assert_allclose(model.linearize().A, two_masses().linearize().A)
    stiff = model.linearize(operating_point={"x": 1e-3})
    np.testing.assert_allclose(stiff.A[3, 2], -(3e4 + 3 * 4e9 * 1e-6) / 0.2, rtol=1e-6)


def test_linearisation_finds_the_equilibrium():
    model = only(springs=[Spring(GROUND, 8.0)])
    loaded = model.with_effect("constant_force", "x", {"force": 11.0}).with_effect(
        "cubic_stiffness", GROUND, {"stiffness": 3.0}
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
    model = two_masses().with_effect("coulomb_friction", GROUND, {"force": 3.0})
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


def test_linearisation_keeps_lags_and_what_relaxes():
    plain = two_masses()
    values = {"stiffness": 900.0, "time": 2e-3}
    model = plain.with_effect("maxwell_element", ("x", "x_m"), values)
    lagging = model.with_effect("input_lag", "F", {"lag": 4e-3})
    s = 300.0j
    here, there = (each.linearize().system(s)[-1, 0] for each in (lagging, model))
    np.testing.assert_allclose(here, there / (1 + 4e-3 * s), rtol=1e-9)
    # a spring and a damper in a row, beside those that are there
    branch = 900.0 * 2e-3 * s / (1 + 2e-3 * s)
    stiffer = replace(plain, springs=(*plain.springs, Spring(("x", "x_m"), branch.real)))
    both = replace(stiffer, dampers=(*plain.dampers, Damper(("x", "x_m"), branch.imag / s.imag)))
    np.testing.assert_allclose(there, both.linearize().system(s)[-1, 0], rtol=1e-6)


# The response of mechanical models over frequency.
LINES = np.array([0.1, 0.3, 0.5, 2.0])
S = 2j * np.pi * LINES


def oscillator(quantity="displacement", **changes):
    parts = {
        "dofs": [Dof("x", 2.0)], "springs": [Spring(GROUND, 8.0)],
        "dampers": [Damper(GROUND, 0.4)], "inputs": [Input("F", GROUND)],
        "outputs": [Output("y", GROUND, quantity)],
    }  # fmt: skip
    return MechanicalModel(**{**parts, **changes})


def receptance(stiffness=8.0, damping=0.4, mass=2.0):
    return 1 / (mass * S**2 + damping * S + stiffness)


@pytest.mark.parametrize(
    ("quantity", "order", "unit"),
    [("displacement", 0, "m/N"), ("velocity", 1, "m/s/N"), ("acceleration", 2, "m/s^2/N")],
)
def test_receptance_mobility_accelerance(quantity, order, unit):
    response = oscillator(quantity).frequency_response(LINES)
    np.testing.assert_allclose(response.values[:, 0, 0], receptance() * S**order, rtol=1e-12)
    assert response["units"].item() == unit


def test_effects_are_linearised_where_they_can_be():
    model = (
        oscillator()
        .with_effect("cubic_stiffness", GROUND, {"stiffness": 4.0})
        .with_effect("coulomb_friction", GROUND, {"force": 1.0})
    )
    response = model.frequency_response(LINES, operating_point={"x": 0.5})
    np.testing.assert_allclose(response.values[:, 0, 0], receptance(11.0), rtol=1e-6)
    assert "jumps at rest" in response.attrs["notes"][0]


def test_delays_gains_and_holds_of_inputs():
    model = (
        oscillator()
        .with_effect("input_delay", "F", {"delay": 0.2})
        .with_effect("sensor_gain", "y", {"gain": 3.0})
        .with_effect("input_hold", "F", {"order": 0.0})
    )
    expected = 3 * receptance() * np.exp(-0.2 * S)
    left_out = model.frequency_response(LINES)
    np.testing.assert_allclose(left_out.values[:, 0, 0], expected, rtol=1e-9)
    assert "sampling time" in left_out.attrs["notes"][0]
    held = model.frequency_response(LINES, sampling_time=0.1)
    factor = (1 - np.exp(-0.1 * S)) / (0.1 * S)
    np.testing.assert_allclose(held.values[:, 0, 0], expected * factor, rtol=1e-9)


@pytest.mark.parametrize(
    ("kind", "at", "values", "expected"),
    [("input_lag", "F", {"lag": 0.3}, receptance() / (1 + 0.3 * S)),
     ("maxwell_element", GROUND, {"stiffness": 5.0, "time": 0.4},
      1 / (1 / receptance() + 5.0 * 0.4 * S / (1 + 0.4 * S))),
     ("attached_resonator", "x", {"mass": 0.1, "stiffness": 1.0, "damping": 0.01},
      1 / (1 / receptance() + (1.0 + 0.01 * S) * 0.1 * S**2 / (0.1 * S**2 + 0.01 * S + 1.0)))],
)  # fmt: skip
def test_effects_with_a_memory_are_what_they_are_over_frequency(kind, at, values, expected):
    response = oscillator().with_effect(kind, at, values).frequency_response(LINES)
    np.testing.assert_allclose(response.values[:, 0, 0], expected, rtol=1e-6)


@pytest.mark.parametrize(("imposed", "order"), [("displacement", 0), ("velocity", 1)])
def test_imposed_motion_comes_with_its_derivatives(imposed, order):
    inputs = [Input("b", ("base", "ground"), "displacement", gain=2.0)]
    if order:
        inputs.append(Input("vb", ("base", "ground"), "velocity", gain=4.0))
    model = oscillator(
        dofs=[Dof("x", 2.0), Dof("base", 0.0)],
        springs=[Spring(("x", "base"), 8.0)],
        dampers=[Damper(("x", "base"), 0.4)],
        inputs=inputs,
    )
    transmitted = (8.0 + 0.4 * S) * receptance()
    response = model.frequency_response(LINES).sel(output="y")
    np.testing.assert_allclose(response.sel(input="b"), 2 * transmitted, rtol=1e-9)
    if order:
        np.testing.assert_allclose(response.sel(input="vb"), 4 * transmitted / S, rtol=1e-9)


def test_a_line_on_an_undamped_pole_is_nan():
    free = oscillator(springs=[], dampers=[])
    response = free.frequency_response([0.0, 1.0]).values[:, 0, 0]
    assert np.isnan(response[0])
    assert response[1] == pytest.approx(-1 / (2 * (2 * np.pi) ** 2))


def test_what_is_refused():
    with pytest.raises(InvalidInputError, match="one of each"):
        oscillator(inputs=[]).frequency_response(LINES)
    with pytest.raises(InvalidInputError, match="finite numbers"):
        oscillator().frequency_response([np.nan])


def test_a_sensor_that_sees_a_sum_of_coordinates():
    ground = ("z", "ground")
    model = oscillator(
        dofs=[Dof("x", 2.0), Dof("z", 1.0)],
        springs=[Spring(GROUND, 8.0), Spring(ground, 3.0)],
        dampers=[Damper(GROUND, 0.4), Damper(ground, 0.1)],
        inputs=[Input("F", GROUND), Input("G", ground)],
        outputs=[Output("tip", ("x", "z"), weights=(0.8, -0.3))],
    )
    response = model.frequency_response(LINES)
    expected = np.column_stack([0.8 * receptance(), -0.3 * receptance(3.0, 0.1, 1.0)])
    np.testing.assert_allclose(response.values[:, 0], expected, rtol=1e-12)


# A mechanical model as a plant for synthesis.


def test_an_input_can_become_a_control():
    plant = two_masses().linearize(controls=["F"])
    assert plant.nw == 0
    assert plant.control_names == ("F",)
    np.testing.assert_allclose(plant.B2[:, 0], [0, 0, 0, -5.0])


# The air bearing as a mechanical model.


def model():
    return MechanicalModel(
        [Dof("a", 2.0), Dof("b", 1.0), Dof("base", 0.0)],
        [Spring(("a", "base"), 800.0), Spring(("a", "b"), 300.0)], [Damper(("a", "b"), 1.5)],
        [Input("F", ("a", "ground")), Input("q", ("base", "ground"), "displacement")],
        [Output("b", "b"), Output("acc", "a", "acceleration"), Output("f", ("a", "b"), "force")],
        coupled_inertias=[rp.machines.CoupledInertia(("a", "b"), 0.3)],
    )  # fmt: skip


def same(found, wanted):
    for name in "ABCD":
        ours, theirs = getattr(found, name), getattr(wanted, name)
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-8)


def test_values_are_those_of_the_model():
    ranges = {
        "spring[0].stiffness": 0.1, "spring[1].stiffness": (200, 500), "dof.a.mass": (1.5, 4),
        "dof.b.mass": 0.2, "damper[0].damping": 0.5, "input.F.gain": 0.05,
        "coupled_inertia[0].value": 0.5,
    }  # fmt: skip
    machine = model().uncertain(ranges)
    copies = {block.element.name: block.copies for block in machine.blocks}
    assert copies == dict.fromkeys(ranges, 1) | {"coupled_inertia[0].value": 2}
    values = {
        "spring[0].stiffness": 850.0, "spring[1].stiffness": 480.0, "dof.a.mass": 3.1,
        "dof.b.mass": 1.15, "damper[0].damping": 1.0, "input.F.gain": 0.97,
        "coupled_inertia[0].value": 0.2,
    }  # fmt: skip
    found, wanted = machine.at(values), model().with_parameters(values).state_space()
    same(found, wanted)
    assert found.input_labels == wanted.input_labels
    assert found.state_labels == wanted.state_labels
    np.testing.assert_allclose(machine.nominal.A, model().state_space().A, atol=1e-10)


@pytest.mark.parametrize(
    ("ranges", "says"),
    [
        ({"spring[7].stiffness": 0.1}, "key of model.parameters"),
        ({"spring[0].stiffness": "10 %"}, "share"),
        ({"spring[0].stiffness": rp.uncertain.dynamics("d")}, "uncertain number"),
        ({"spring[0].stiffness": (900, 1000)}, "around the nominal"),
        ({"dof.a.mass": 1.5}, "share below 1"),
        ({"dof.base.mass": 0.1}, "is 0"),
        ({"input.q.gain": 0.1}, "imposed"),
        ([0.1], "mapping"),
    ],
)
def test_bad_ranges(ranges, says):
    with pytest.raises(InvalidInputError, match=says):
        model().uncertain(ranges)


def test_damping_that_may_vanish():
    machine = MechanicalModel(
        [Dof("x", 1.0)], [Spring(GROUND, 1.0)], [Damper(GROUND, 1.0)],
        inputs=[Input("F", GROUND)], outputs=[Output("x", "x")],
    )  # fmt: skip
    margin = rp.robust_stability(machine.uncertain({"damper[0].damping": (0, 2)}))
    assert margin.upper == pytest.approx(1, abs=1e-9)


KEYS = ("dof.a.mass", "dof.b.mass", "spring[0].stiffness", "damper[0].damping", "input.F.gain")


def test_numbers_of_an_ellipsoid():
    roots = np.tril(np.random.default_rng(0).uniform(0.01, 0.05, (5, 5)))
    known = {key: model().parameters[key] for key in KEYS}
    roots *= np.array(list(known.values()))[:, None]
    fit = rp.uncertain.ellipsoid(known, roots, name="fit")
    machine = model().uncertain({**fit, "spring[1].stiffness": 0.1})
    # A direction occurs as often as the numbers that it moves act in separate ways.
    copies = {block.element.name: block.copies for block in machine.blocks}
    assert copies.pop("spring[1].stiffness") == 1
    assert max(copies.values()) <= 3
    assert copies["fit[4]"] == 1
    np.testing.assert_allclose(machine.nominal.A, model().state_space().A, rtol=1e-9, atol=1e-9)
    point = fit.numbers({"fit[0]": 0.5, "fit[1]": -0.4, "fit[3]": 0.3, "fit[4]": -0.2})
    found = machine.at(point | {"spring[1].stiffness": 320.0})
    wanted = model().with_parameters(point | {"spring[1].stiffness": 320.0}).state_space()
    same(found, wanted)


def test_number_of_a_formula_has_its_own_nominal_value():
    grams = rp.uncertain.real("grams", 2100.0, percent=5)
    machine = model().uncertain({"dof.a.mass": grams / 1000})
    assert list(machine.elements) == ["grams"]
    wanted = model().with_parameters({"dof.a.mass": 2.15}).state_space()
    np.testing.assert_allclose(machine.at({"grams": 2150.0}).A, wanted.A, rtol=1e-10, atol=1e-9)
    own = rp.uncertain.real("dof.a.mass", 2.0, percent=5)
    assert list(model().uncertain({"dof.a.mass": own}).elements) == ["dof.a.mass"]
