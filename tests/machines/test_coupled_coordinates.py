"""Coupled inertias and outputs that see several coordinates."""

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.machines.mechanical.data import definite_coupling_share
from robustpolish.machines.simulation import simulate_model
from tests.machine_files import machine

# Inertias between two coordinates: double pendulum, pendulum on a cart, on a moved base.
G = 9.81
PENDULUM = """
[dof.upper]
inertia = {upper}
[dof.lower]
inertia = {lower}
[[coupled_inertia]]
between = ["upper", "lower"]
value = {coupled}
"""


def double_pendulum(m1=1.0, m2=1.0, l1=0.5, l2=0.5, times=1.0):
    """Point masses on strings in absolute angles (Landau and Lifshitz, Mechanics, section 5)."""
    numbers = {
        "upper": (m1 + m2) * l1**2,
        "lower": m2 * l2**2,
        "coupled": times * m2 * l1 * l2,
    }
    rest = [f"""
[[spring]]
between = ["{end}", "ground"]
stiffness = {k}
[[damper]]
between = ["{end}", "{other}"]
damping = {d}
[[output]]
name = "{end}"
measures = "{end}"
quantity = "angle"
""" for end, other, k, d in (("upper", "ground", (m1 + m2) * G * l1, 0.02),
                              ("lower", "upper", m2 * G * l2, 0.01))]  # fmt: skip
    return rp.MechanicalModel.from_toml(PENDULUM.format(**numbers) + "".join(rest))


def frequencies(model):
    poles = np.linalg.eigvals(model.matrices.first_order()[0])
    return np.sort(np.abs(poles))[::2]


def test_equal_pendulums_swing_as_in_the_textbook():
    """With equal masses and lengths at the roots of (2 -+ sqrt(2)) g/l."""
    model = double_pendulum(m1=2.0, m2=2.0, l1=0.4, l2=0.4)
    expected = np.sqrt(np.array([2 - np.sqrt(2), 2 + np.sqrt(2)]) * G / 0.4)
    np.testing.assert_allclose(frequencies(model), expected, rtol=2e-3)  # damped a little
    undamped = model.with_parameters({"damper[0].damping": 0.0, "damper[1].damping": 0.0})
    np.testing.assert_allclose(frequencies(undamped), expected, rtol=1e-12)


@pytest.mark.parametrize(("m1", "m2", "l1", "l2"), [(1, 0.2, 0.3, 0.9), (0.1, 3, 1.0, 0.2)])
def test_unequal_pendulums_swing_as_the_eigenvalue_problem_says(m1, m2, l1, l2):
    model = double_pendulum(m1, m2, l1, l2)
    undamped = model.with_parameters({"damper[0].damping": 0.0, "damper[1].damping": 0.0})
    M = np.array([[(m1 + m2) * l1**2, m2 * l1 * l2], [m2 * l1 * l2, m2 * l2**2]])
    K = np.diag([(m1 + m2) * G * l1, m2 * G * l2])
    np.testing.assert_allclose(frequencies(undamped), np.sqrt(eigh(K, M)[0]), rtol=1e-10)


def swinging(noise=0.0, friction=0.0, seed=0):
    """A small swing of the nonlinear pendulum, by an integrator that is not the package's."""
    time = np.arange(3000) * 0.01
    m1, m2, l1, l2 = 1.0, 1.0, 0.5, 0.5

    def rhs(t, s):
        a, b, va, vb = s
        joint = 0.01 * (vb - va) + friction * np.tanh((vb - va) / 1e-3)
        M = [[(m1 + m2) * l1**2, m2 * l1 * l2 * np.cos(a - b)],
             [m2 * l1 * l2 * np.cos(a - b), m2 * l2**2]]  # fmt: skip
        f = [
            -m2 * l1 * l2 * vb**2 * np.sin(a - b)
            - (m1 + m2) * G * l1 * np.sin(a)
            - 0.02 * va
            + joint,
            m2 * l1 * l2 * va**2 * np.sin(a - b) - m2 * G * l2 * np.sin(b) - joint,
        ]
        return [va, vb, *np.linalg.solve(M, f)]

    start = [0.02, -0.03, 0.0, 0.0]
    angles = solve_ivp(rhs, (0, time[-1]), start, t_eval=time, rtol=1e-8, atol=1e-10).y[:2]
    random = np.random.default_rng(seed).standard_normal(angles.shape)
    angles = angles + noise * np.std(angles, axis=1)[:, None] * random
    data = dict(zip(("upper", "lower"), (("time", row) for row in angles), strict=True))
    return xr.Dataset(data, {"time": time})


def test_a_record_of_a_pendulum_gives_its_coupling():
    """In units of the larger inertia, which a decay shows no size of."""
    data = swinging(noise=0.005)
    assert rp.compare(double_pendulum(), data).nrmse < 0.01
    fitted = rp.refit(double_pendulum(times=0.9), data)
    found = fitted.model.parameters
    assert found["dof.upper.inertia"] == 0.5
    assert found["coupled_inertia[0].value"] == pytest.approx(0.25, rel=0.01)
    assert fitted.units["coupled_inertia[0].value"] == "kg m^2"
    assert fitted.nrmse["lower"] == pytest.approx(0.0055, rel=0.2)


@pytest.mark.long
def test_friction_in_the_joint_of_a_pendulum_is_found():
    found = rp.diagnose(double_pendulum(), swinging(noise=0.005, friction=0.002))
    assert [e.kind for e in found.effects] == ["coulomb_friction"]
    assert set(found.effects[0].at) == {"upper", "lower"}
    assert found.effects[0].parameters["force"].value == pytest.approx(0.002, rel=0.05)


def cart(value=0.3, **changes):
    """A cart of 2 kg with a pendulum of 0.5 kg and 0.6 m."""
    parts = {
        "dofs": [rp.Dof("x", 2.5), rp.Dof("theta", 0.18, rotational=True)],
        "springs": [rp.Spring(("x", "ground"), 90.0), rp.Spring(("theta", "ground"), 2.943)],
        "dampers": [rp.Damper(("x", "ground"), 0.5), rp.Damper(("theta", "ground"), 0.01)],
        "inputs": [rp.Input("F", ("x", "ground"))],
        "outputs": [rp.Output("a", ("theta", "ground"), "acceleration")],
        "coupled_inertias": [rp.machines.CoupledInertia(("x", "theta"), value)],
    }
    return rp.MechanicalModel(**{**parts, **changes})


def test_a_displacement_and_an_angle_are_coupled_by_a_first_moment():
    model = cart()
    M = np.array([[2.5, 0.3], [0.3, 0.18]])
    A, B, C, D = model.matrices.first_order()
    np.testing.assert_allclose(A[2:, :2], -np.linalg.solve(M, np.diag([90.0, 2.943])))
    np.testing.assert_allclose(A[2:, 2:], -np.linalg.solve(M, np.diag([0.5, 0.01])))
    np.testing.assert_allclose(B[2:, 0], np.linalg.solve(M, [1.0, 0.0]))
    np.testing.assert_allclose(C[0], A[3])
    assert D[0, 0] == B[3, 0]
    assert "kg m\n" in repr(model)
    plant = model.linearize(controls=["theta"])
    order = [plant.states.index(name) for name in ("x", "theta", "dx", "dtheta")]
    np.testing.assert_allclose(plant.A[np.ix_(order, order)], A)
    np.testing.assert_allclose(plant.B2[order][2:, 0], np.linalg.solve(M, [0.0, 1.0]))
    np.testing.assert_allclose(plant.D22[0, 0], np.linalg.inv(M)[1, 1])


def test_an_effect_pushes_both_coordinates():
    """A cubic spring on the cart, held against an integrator that is not the package's."""
    model = cart(outputs=[rp.Output("theta", ("theta", "ground"), "angle")])
    model = model.with_effect("cubic_stiffness", ("x", "ground"), {"stiffness": 4e3})
    time = np.arange(2000) * 0.005
    force = 20 * np.sin(2 * np.pi * 0.9 * time)
    M = np.array([[2.5, 0.3], [0.3, 0.18]])

    def rhs(t, s):
        x, theta, v, w = s
        f = [20 * np.sin(2 * np.pi * 0.9 * t) - 90 * x - 0.5 * v - 4e3 * x**3,
             -2.943 * theta - 0.01 * w]  # fmt: skip
        return [v, w, *np.linalg.solve(M, f)]

    expected = solve_ivp(rhs, (0, time[-1]), [0.0] * 4, t_eval=time, rtol=1e-9, atol=1e-12).y[1]
    data = xr.Dataset({"F": ("time", force)}, {"time": time})
    found = simulate_model(model, data).outputs[:, 0]
    assert np.max(np.abs(found - expected)) < 2e-3 * np.max(np.abs(expected))


def test_a_moved_base_swings_a_pendulum_by_its_acceleration():
    """J theta'' + m l x'' + k theta = 0 with x imposed."""
    model = cart(
        inputs=[rp.Input("x", ("x", "ground"), "displacement")],
        outputs=[rp.Output("theta", ("theta", "ground"), "angle"),
                 rp.Output("drive", ("x",), "force", drive=True)],
    )  # fmt: skip
    assert model.matrices.signals == ("x", "x_dot", "x_ddot")
    w = 2 * np.pi * 0.3
    ratio = 0.3 * w**2 / (2.943 - 0.18 * w**2 + 0.01j * w)
    response = model.frequency_response([0.3])
    assert response.sel(output="theta", input="x").item() == pytest.approx(ratio, rel=1e-9)
    drive = 90 - 2.5 * w**2 + 0.5j * w - 0.3 * w**2 * ratio
    assert response.sel(output="drive", input="x").item() == pytest.approx(drive, rel=1e-9)


def test_the_file_holds_what_is_coupled():
    model = double_pendulum()
    assert rp.MechanicalModel.from_toml(model.to_toml()) == model
    assert model.parameters["coupled_inertia[0].value"] == 0.25
    assert "coupled inertia" in repr(model)
    less = model.with_parameters({"coupled_inertia[0].value": -0.1})
    assert less.coupled_inertias[0].value == -0.1
    with pytest.raises(InvalidInputError, match=r"line 8: .*value.*less than 0.35"):
        double_pendulum(times=1.5)


@pytest.mark.parametrize(
    ("between", "value", "message"),
    [(("x", "ground"), 0.1, "the ground does not move"), (("x",), 0.1, "two coordinates"),
     (("x", "x"), 0.1, "two ends"), (("x", "y"), 0.1, "one of 'x', 'theta'"),
     (("x", "theta"), "a", "a finite number"), (("x", "theta"), -0.68, "less than 0.67082"),
     (("x", "theta"), 0.68, "less than 0.67082.*positive kinetic energy")],
)  # fmt: skip
def test_bad_couplings_are_refused(between, value, message):
    with pytest.raises(InvalidInputError, match=message):
        cart(coupled_inertias=[rp.machines.CoupledInertia(between, value)])


def test_three_couplings_that_are_too_much_together_are_refused():
    dofs = [rp.Dof(name, 1.0) for name in "abc"]
    pairs = [("a", "b"), ("b", "c"), ("c", "a")]
    outputs = [rp.Output("a", ("a", "ground"))]

    def with_all(value):
        coupled = [rp.machines.CoupledInertia(pair, value) for pair in pairs]
        return rp.MechanicalModel(dofs, outputs=outputs, coupled_inertias=coupled)

    model = with_all(-0.49)
    with pytest.raises(InvalidInputError, match="with the other coupled inertias some has none"):
        with_all(-0.51)
    changes = {f"coupled_inertia[{i}].value": -0.9 for i in range(3)}
    share = definite_coupling_share(model, changes)
    assert share * 0.9 == pytest.approx(0.5, rel=2e-3)
    assert model.with_parameters({key: share * value for key, value in changes.items()})
    assert definite_coupling_share(model, {}) == 1.0


# Sensors that see sums of coordinates, and machines that turn: from the file to the diagnosis.
BEAM = machine("beam")
TIME = np.arange(4000) / 500


def smooth_force(seed, top=16.0):
    random = np.random.default_rng(seed)
    lines = np.arange(1, 81) * top / 80
    phases = random.uniform(0, 2 * np.pi, 80)
    return lambda t: np.cos(2 * np.pi * np.multiply.outer(t, lines) + phases).mean(axis=-1) * 40


def beam(cubic=0.0):
    """A record of two modes, by an integrator that is not the package's."""
    F, G = smooth_force(1), smooth_force(2)

    def rhs(t, s):
        a1 = F(t) - 0.8 * s[2] - 400.0 * s[0] - cubic * s[0] ** 3
        return [s[2], s[3], a1, G(t) - 1.5 * s[3] - 3000.0 * s[1]]

    s = solve_ivp(rhs, (0, TIME[-1]), [0, 0, 0, 0], t_eval=TIME, rtol=1e-9, atol=1e-12).y
    a = np.array([rhs(t, row) for t, row in zip(TIME, s.T, strict=True)])[:, 2:]
    noise = np.random.default_rng(3).standard_normal((2, TIME.size))
    tip, middle = 0.8 * s[0] - 0.3 * s[1], 1.1 * a[:, 1] + 0.5 * a[:, 0]
    columns = {
        "F": F(TIME), "G": G(TIME),
        "tip": tip + 0.003 * np.std(tip) * noise[0],
        "middle": middle + 0.003 * np.std(middle) * noise[1],
    }  # fmt: skip
    return xr.Dataset({k: ("time", v) for k, v in columns.items()}, {"time": TIME})


def test_a_sum_of_modes_is_simulated():
    model = rp.MechanicalModel.from_toml(BEAM)
    found = rp.compare(model, beam())
    errors = [found.outputs[name].nrmse for name in ("tip", "middle")]
    assert errors == pytest.approx([0.003, 0.003], rel=0.2)
    assert found.notes == ()


def test_a_sum_of_modes_survives_the_file_and_shows_itself():
    model = rp.MechanicalModel.from_toml(BEAM)
    np.testing.assert_allclose(model.state_space().C[0], [0.8, -0.3, 0, 0])
    again = rp.MechanicalModel.from_toml(model.to_toml())
    assert again.outputs == model.outputs
    assert again.outputs[0].weights == (0.8, -0.3)
    assert "0.8 q1 -0.3 q2" in repr(model)


@pytest.mark.long
def test_a_sum_of_modes_shows_what_is_missing():
    model = rp.MechanicalModel.from_toml(BEAM)
    data = beam(cubic=2e4)
    found = rp.diagnose(model, data)
    assert [(e.kind, e.at[0]) for e in found.effects] == [("cubic_stiffness", "q1")]
    assert found.effects[0].parameters["stiffness"].value == pytest.approx(2e4, rel=0.05)
    assert "tip: 96 % of the error" in rp.residual_analysis(rp.compare(model, data)).explain()


DOFS = [rp.Dof("q1", 1.0), rp.Dof("q2", 1.0), rp.Dof("theta", 1.0, rotational=True)]


@pytest.mark.parametrize(
    ("of", "weights", "quantity", "message"),
    [(("q1", "q2"), (1.0,), "displacement", "one number for each"),
     (("q1", "q1"), (1.0, 1.0), "displacement", "one number for each"),
     (("q1", "q"), (1.0, 1.0), "displacement", "one of 'q1', 'q2', 'theta'"),
     (("q1", "ground"), (1.0, 1.0), "displacement", "one of 'q1', 'q2', 'theta'"),
     (("q1", "q2"), (0.0, 0.0), "displacement", "not 0"),
     (("q1", "q2"), (1.0, "a"), "displacement", "a finite number"),
     (("q1", "q2"), (1.0, 1.0), "force", "sum of a force"),
     (("q1", "theta"), (1.0, 1.0), "displacement", "in m and in rad"),
     (("q1", "q2"), (1.0, 1.0), "angle", "translation")],
)  # fmt: skip
def test_bad_sums_are_refused(of, weights, quantity, message):
    with pytest.raises(InvalidInputError, match=message):
        rp.MechanicalModel(DOFS, outputs=[rp.Output("x", of, quantity, weights=weights)])


def test_a_shift_and_a_turn_need_a_unit():
    lever = rp.Output("end", ("q1", "theta"), weights=(1.0, 0.25), unit="m")
    model = rp.MechanicalModel(DOFS, outputs=[lever])
    assert model.unit_of(model.outputs[0]) == "m"


SHAFT = """
dof.motor.inertia = 0.002
dof.load.inertia = 0.01
damper = [{ between = ["motor", "load"], damping = 0.004 },
          { between = ["load", "ground"], damping = 0.03 }]
"""
TORQUE = """
spring = [{ between = ["motor", "load"], stiffness = 8.0 },
          { between = ["load", "ground"], stiffness = 3.0 }]
input = [{ name = "T", torque_on = "motor" }]
output = [{ name = "phi", measures = "load", quantity = "angle" },
          { name = "w", measures = "motor", quantity = "angular_velocity" }]
"""
IMPOSED = """
spring = [{ between = ["motor", "load"], stiffness = 8.0 }]
input = [{ name = "drive", motion_of = "motor", quantity = "angle" }]
output = [{ name = "phi", measures = "load", relative_to = "motor" }]
"""


def shaft(friction, imposed):
    drive = smooth_force(5, top=10.0)

    def rhs(t, s):
        motor, load, wm, wl = s
        torsion = 8.0 * (motor - load) + 0.004 * (wm - wl)
        slip = friction * np.tanh(wl / 0.01)
        ground = 0.0 if imposed else 3.0 * load
        al = (torsion - 0.03 * wl - slip - ground) / 0.01
        return [wm, wl, (0.01 * drive(t) - torsion) / 0.002, al]

    def moved(t, s):
        h = 1e-5
        m = 0.05 * drive(t)
        wm = 0.05 * (drive(t + h) - drive(t - h)) / (2 * h)
        return [s[1], rhs(t, [m, s[0], wm, s[1]])[3]]

    start, law = ([0.05 * drive(0.0), 0.0], moved) if imposed else ([0.0] * 4, rhs)
    s = solve_ivp(law, (0, TIME[-1]), start, t_eval=TIME, rtol=1e-8, atol=1e-10).y
    noise = np.random.default_rng(6).standard_normal((2, TIME.size))
    if imposed:
        columns = {"drive": (0.05 * drive(TIME), "rad"), "phi": (s[0] - 0.05 * drive(TIME), "rad")}
    else:
        columns = {"T": (0.01 * drive(TIME), "N m"), "phi": (s[1], "rad"), "w": (s[2], "rad/s")}
    for name, row in zip(("phi", "w"), noise, strict=True):
        if name in columns:
            values, unit = columns[name]
            columns[name] = (values + 0.003 * np.std(values) * row, unit)
    data = {name: ("time", values, {"units": unit}) for name, (values, unit) in columns.items()}
    return xr.Dataset(data, {"time": TIME})


@pytest.mark.long
@pytest.mark.parametrize("imposed", [False, True], ids=["torque", "imposed angle"])
def test_machines_that_turn_go_all_the_way(imposed):
    model = rp.MechanicalModel.from_toml(SHAFT + (IMPOSED if imposed else TORQUE))
    good = rp.compare(model, shaft(0.0, imposed))
    assert good.nrmse < 0.005
    assert good.notes == ()
    friction = 0.02 if imposed else 0.006  # much of what drives the load, without holding it
    data = shaft(friction, imposed)
    found = rp.diagnose(model, data)
    assert [(e.kind, e.at[0]) for e in found.effects] == [("coulomb_friction", "load")]
    assert found.effects[0].parameters["force"].value == pytest.approx(friction, rel=0.1)
    assert rp.compare(found.model, data).nrmse < 0.3 * rp.compare(model, data).nrmse
