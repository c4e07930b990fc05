"""Equations of motion as formulas, held against closed forms and scipy's integrator.

The equations that scipy integrates are written here by hand, not read from the files.
"""

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import robustpolish as rp
from robustpolish.errors import InvalidInputError, RobustPolishWarning
from robustpolish.identification.observer.runs import rest
from robustpolish.machines.simulation import simulate_model

READY = (
    "cart_and_pendulum", "rotary_pendulum", "double_pendulum", "ball_and_beam", "dc_motor",
    "magnetic_levitation", "two_link_arm", "quarter_car", "pneumatic_cylinder",
)  # fmt: skip


def ready(name):
    return rp.MechanicalModel.from_toml(name)


# Equations by hand: what a state and inputs give, with a force hidden at the coordinates.


def cart(p, hidden):
    M, m, g, ml, J = p["M"], p["m"], p["g"], p["m"] * p["l"], p["J"] + p["m"] * p["l"] ** 2

    def rates(s, u):
        _, phi, v, w = s
        inertia = np.array([[M + m, ml * np.cos(phi)], [ml * np.cos(phi), J]])
        push = u[0] - p["c"] * v + ml * np.sin(phi) * w**2
        force = [push, -ml * g * np.sin(phi) - p["d"] * w]
        return [v, w, *np.linalg.solve(inertia, np.add(force, hidden(s[:2], s[2:])))]

    return rates


def double(p, hidden):
    m1, a1, l1, J1, m2, a2, J2 = (p[n] for n in ("m_1", "a_1", "l_1", "J_1", "m_2", "a_2", "J_2"))

    def rates(s, u):
        x, y, v, w = s
        c, h = m2 * l1 * a2 * np.cos(x - y), m2 * l1 * a2 * np.sin(x - y)
        inertia = np.array([[J1 + m1 * a1**2 + m2 * l1**2, c], [c, J2 + m2 * a2**2]])
        joint = p["d_2"] * (v - w)
        upper = u[0] - (m1 * a1 + m2 * l1) * p["g"] * np.sin(x) - h * w**2 - p["d_1"] * v - joint
        lower = h * v**2 - m2 * a2 * p["g"] * np.sin(y) + joint
        return [v, w, *np.linalg.solve(inertia, np.add([upper, lower], hidden(s[:2], s[2:])))]

    return rates


def motor(p, hidden):
    def rates(s, u):
        x, v, i = s
        force = p["k"] * i - p["d"] * v + hidden([x], [v])[0]
        return [v, force / p["J"], (u[0] - p["R"] * i - p["k"] * v) / p["L"]]

    return rates


def cylinder(p, hidden):
    A, V, n = p["A"], p["V"], p["n"]

    def rates(s, u):
        x, v, a, b = s
        fill, drain = max(u[0], 0.0), min(u[0], 0.0)
        flow = p["T_R"] * p["k_v"]
        into_a = flow * (fill * (p["p_s"] - a) + drain * (a - p["p_0"]))
        into_b = -flow * (fill * (b - p["p_0"]) + drain * (p["p_s"] - b))
        force = A * (a - b) - p["c"] * v + hidden([x], [v])[0]
        return [v, force / p["m"], n * (into_a - A * a * v) / (V + A * x),
                n * (into_b + A * b * v) / (V - A * x)]  # fmt: skip

    return rates


CASES = {
    # equations, the effect that is hidden and its force, inputs with their bands, sizes, a sample
    "cart_and_pendulum": (
        cart, ("coulomb_friction", ("x", "ground"), {"force": 0.3, "width": 0.02}),
        lambda q, v: np.array([-0.3 * np.tanh(v[0] / 0.02), 0.0]), 0.3, 3.0, 1.1, 0.005,
    ),
    "double_pendulum": (
        double, ("quadratic_damping", ("phi_2", "ground"), {"coefficient": 4e-4}),
        lambda q, v: np.array([0.0, -4e-4 * v[1] * abs(v[1])]), 0.3, 4.0, 0.08, 0.005,
    ),
    "dc_motor": (
        motor, ("coulomb_friction", ("phi", "ground"), {"force": 2e-3, "width": 0.5}),
        lambda q, v: np.array([-2e-3 * np.tanh(v[0] / 0.5)]), 0.5, 30.0, 4.0, 0.001,
    ),
    "pneumatic_cylinder": (
        cylinder, ("cubic_stiffness", ("x", "ground"), {"stiffness": 4e6}),
        lambda q, v: np.array([-4e6 * q[0] ** 3]), 0.3, 6.0, 3.0, 0.002,
    ),
}  # fmt: skip


def record(name, hide=True, seconds=4.0, noise=0.0, off=0.0):
    """A record of a ready machine whose numbers are off by a share, and those numbers."""
    equations, _, force, low, high, size, step = CASES[name]
    model, rng = ready(name), np.random.default_rng(3)
    (own,) = model.equations
    numbers = {
        key: value * (1.0 if key in own.known else 1 + off * rng.uniform(-1, 1))
        for key, value in own.values.items()
    }
    time = np.arange(0.0, seconds, step)
    lines = [
        np.sin(2 * np.pi * f * time + rng.uniform(0, 2 * np.pi)) for f in np.linspace(low, high, 15)
    ]
    u = size * np.sqrt(2 / 15) * np.sum(lines, axis=0)
    rates = equations(numbers, force if hide else lambda q, v: np.zeros(len(q)))
    begin = rest(model)
    found = solve_ivp(
        lambda t, s: rates(s, [np.interp(t, time, u)]), (0, time[-1]), begin.vector, "RK45",
        time, max_step=step, rtol=1e-8, atol=1e-10,
    )  # fmt: skip
    columns = {model.inputs[0].name: u}
    for i, coordinate in enumerate(own.coordinates):
        y = found.y[i]
        columns[coordinate] = y + noise * np.std(y) * rng.standard_normal(y.size)
    data = {key: ("time", column) for key, column in columns.items()}
    return model, xr.Dataset(data, {"time": time}), numbers


@pytest.mark.parametrize("name", CASES)
def test_runs_are_those_of_scipy(name):
    model, data, _ = record(name)
    begin = rest(model)
    found = simulate_model(
        model.with_effect(*CASES[name][1]), data, begin.state, begin.internal, substeps=8
    )
    for i, output in enumerate(model.output_names):
        measured = data[output].values
        assert np.max(np.abs(found.outputs[:, i] - measured)) < 2e-4 * np.ptp(measured)


@pytest.mark.parametrize("name", READY)
def test_a_ready_machine_is_written_and_read(name):
    model = ready(name)
    assert rp.MechanicalModel.from_toml(model.to_toml()) == model
    assert str(model.equations[0].law[model.free[0]]) in str(model)


# Linear parts: closed forms.


def test_a_cart_balances_its_pendulum_upright():
    model = ready("cart_and_pendulum")
    plant = model.linearize(["F"], operating_point={"phi": np.pi})
    p = model.equations[0].values
    ml = p["m"] * p["l"]
    inertia = np.array([[p["M"] + p["m"], -ml], [-ml, p["J"] + ml * p["l"]]])
    force = np.array([[0, 0, -p["c"], 0, 1], [0, ml * p["g"], 0, -p["d"], 0]])
    by = np.linalg.inv(inertia) @ force
    assert plant.states == ("x", "dx", "phi", "dphi")
    assert np.allclose(plant.A[1::2][:, [0, 2, 1, 3]], by[:, :4], rtol=1e-12)
    assert np.allclose(plant.B2[1::2, 0], by[:, 4], rtol=1e-12)


def test_a_motor_with_its_current_has_the_transfer_function_of_textbooks():
    model = ready("dc_motor")
    J, d, k, R, L = model.equations[0].values.values()
    s = 2j * np.pi * np.array([0.1, 3.0, 80.0])
    known = k / (s * ((L * s + R) * (J * s + d) + k**2))
    shown = model.frequency_response(np.imag(s) / (2 * np.pi)).values[:, 0, 0]
    assert np.allclose(shown, known, rtol=1e-9)
    assert model.state_space().state_labels == ["phi", "phi_dot", "i"]


def test_a_levitated_ball_falls_off_with_its_closed_form():
    """About z0 the magnet is a negative spring of 2 m g / z0, whatever its constant."""
    model = ready("magnetic_levitation")
    poles = np.linalg.eigvals(model.state_space().A)
    assert np.max(poles.real) == pytest.approx(np.sqrt(2 * 9.81 / 0.01), rel=1e-6)
    with pytest.warns(RobustPolishWarning, match="no equilibrium"):
        model.linearize(["u"], operating_point={"z": 0.02})


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("cart_and_pendulum", {"l": 0.34, "m": 0.15, "c": 0.9}),
        ("dc_motor", {"R": 9.1, "k": 0.05}),
        ("double_pendulum", {"l_1": 0.22, "J_2": 6e-4}),
    ],
)
def test_uncertain_numbers_are_those_of_the_model(name, numbers):
    model = ready(name)
    values = {f"parameter.{key}": value for key, value in numbers.items()}
    system = model.uncertain({key: (0.5 * v, 2.0 * v) for key, v in values.items()}).at(values)
    known = model.with_parameters(values).state_space()
    assert np.allclose(system.A, known.A, rtol=1e-9, atol=1e-9)
    assert np.allclose(system.B, known.B, rtol=1e-9, atol=1e-12)


# A function, and equations beside masses and springs.


def pendulum_law(t, q, v, z, u, p, M, f, dz):
    M[0, 0] = p[0] * p[1] ** 2
    f[0] = u[0] - p[0] * p[2] * p[1] * np.sin(q[0]) - p[3] * v[0]


PENDULUM = {
    "coordinates": {"phi": "rad"},
    "inputs": {"T": "N m"},
    "parameters": {
        "m": (0.5, "kg"), "l": (0.4, "m"), "g": (9.81, "m/s^2"), "d": (0.01, "N m s/rad"),
    },
}  # fmt: skip
SWING = {"phi": "m*l**2*phi_ddot = T - m*g*l*sin(phi) - d*phi_dot"}


def test_a_function_is_as_good_as_its_formula():
    models = [
        rp.MechanicalModel(
            equations=[rp.Equations(law, **PENDULUM)], outputs=[rp.Output("phi", "phi")]
        )
        for law in (pendulum_law, SWING)
    ]
    time = np.arange(400) * 0.01
    data = xr.Dataset({"T": ("time", np.sin(3 * time))}, {"time": time})
    by_function, by_formula = (simulate_model(model, data).outputs for model in models)
    assert np.allclose(by_function, by_formula, rtol=1e-9, atol=1e-12)
    assert np.ptp(by_formula) > 1.0
    assert np.allclose(models[0].state_space().A, models[1].state_space().A)
    with pytest.raises(InvalidInputError, match="formulas"):
        models[0].to_toml()


def test_a_current_drives_masses_and_springs():
    """A coil on a spring: the equations give the force, the rest of the file the machine."""
    model = rp.MechanicalModel.from_toml("""
[dof.x]
mass = 0.5
[[spring]]
between = ["x", "ground"]
stiffness = 200.0
[[equation]]
of = "x"
unit = "m"
formula = "0 = k*i"
[[equation]]
of = "i"
unit = "A"
formula = "L*i_dot = u - R*i - k*x_dot"
[parameter]
k = { value = 4.0, unit = "N/A" }
R = { value = 2.0, unit = "ohm" }
L = { value = 0.01, unit = "H" }
[[input]]
name = "u"
unit = "V"
gain = 3.0
[[output]]
name = "x"
measures = "x"
""")
    s = 2j * np.pi * np.array([0.5, 3.0, 20.0])
    known = 3 * 4.0 / ((0.5 * s**2 + 200.0) * (0.01 * s + 2.0) + 16.0 * s)
    assert np.allclose(model.frequency_response(np.imag(s) / 2 / np.pi).values[:, 0, 0], known)
    assert model.parameters["dof.x.mass"] == 0.5
    time = np.arange(2000) * 1e-3
    data = xr.Dataset({"u": ("time", np.ones(2000))}, {"time": time})
    still = simulate_model(model, data).outputs[-1, 0]
    assert still == pytest.approx(3 * 4.0 / 2.0 / 200.0, rel=0.01)


def test_effects_push_where_inertia_changes():
    """A constant torque on the second joint of an arm holds it where its weight does."""
    model = ready("two_link_arm").with_effect("constant_force", "q_2", {"force": 0.5})
    time = np.arange(0.0, 30.0, 0.01)
    none = {name: ("time", np.zeros(time.size)) for name in ("T_1", "T_2")}
    q1, q2 = simulate_model(model, xr.Dataset(none, {"time": time})).outputs[-1]
    p = model.equations[0].values
    lower = p["m_2"] * p["a_2"] * p["g"]
    assert lower * np.sin(q1 + q2) == pytest.approx(0.5, rel=1e-4)
    upper = (p["m_1"] * p["a_1"] + p["m_2"] * p["l_1"]) * p["g"]
    assert upper * np.sin(q1) == pytest.approx(-0.5, rel=1e-4)


# Fits and diagnoses.


def test_a_refit_finds_the_numbers():
    model, data, numbers = record("dc_motor", hide=False, noise=0.002, off=0.1)
    found = rp.refit(model, data).model.parameters
    # a run without load tells the constant, and the time in which it comes up to speed
    assert found["parameter.k"] == pytest.approx(numbers["k"], rel=0.02)
    known, shown = numbers["J"] * numbers["R"], found["parameter.J"] * found["parameter.R"]
    assert shown == pytest.approx(known, rel=0.05)
    with pytest.raises(InvalidInputError, match="parameter"):
        model.with_parameters({"parameter.Q": 1.0})


@pytest.mark.long
@pytest.mark.parametrize("name", CASES)
def test_a_diagnosis_names_what_is_hidden(name):
    model, data, _ = record(name, seconds=12.0, noise=0.01, off=0.03)
    found = rp.diagnose(model, data)
    kind, at, values = CASES[name][1]
    assert [(effect.kind, effect.at) for effect in found.effects] == [(kind, at)]
    size = next(iter(values))
    assert found.effects[0].values[size] == pytest.approx(values[size], rel=0.1)


@pytest.mark.long
def test_a_diagnosis_of_a_machine_that_is_as_written_finds_nothing():
    model, data, _ = record("double_pendulum", hide=False, seconds=12.0, noise=0.01, off=0.03)
    assert rp.diagnose(model, data).verdict in ("adequate", "parameters")


# Bad input.


@pytest.mark.parametrize(
    ("law", "changes", "message"),
    [
        ("m*l**2*phi_ddot = T - Q*phi", {}, "got 'Q'"),
        ("m*l**2*phi_ddot = T - m*g*sin(phi)", {}, "- joins"),
        ("m*l*phi_ddot = T/l", {}, "not in rad's force"),
        ("m*l**2*phi_ddot + T", {}, "equals sign"),
        ("m*l**2*phi_ddot = T = 0", {}, "equals sign"),
        ("m*l**2*sin(phi_ddot) = T", {}, "linearly|sin is taken"),
        ("T = d*phi_dot", {}, "singular mass matrix"),
        ("-m*l**2*phi_ddot = T", {}, "singular mass matrix"),
        (SWING["phi"], {"parameters": {"m": (0.5, "kg")}}, "got 'g'"),
        (
            SWING["phi"],
            {"parameters": PENDULUM["parameters"] | {"m": 0.5}},
            "a number and its unit",
        ),
        (SWING["phi"], {"parameters": PENDULUM["parameters"] | {"m": (0.5, "g")}}, "SI unit"),
        (SWING["phi"], {"parameters": PENDULUM["parameters"] | {"T": (1.0, "N m")}}, "'T' twice"),
        (SWING["phi"], {"parameters": PENDULUM["parameters"] | {"phi_dot": (1.0, "1")}}, "twice"),
        (SWING["phi"], {"coordinates": {"phi": "deg"}}, "'m' or 'rad'"),
        (SWING["phi"], {"states": {"i": "A"}}, "without an equation"),
        (SWING["phi"], {"known": ["k"]}, "a parameter"),
        (SWING["phi"], {"start": {"k": 1.0}}, "a coordinate, a state or an input"),
        (SWING["phi"], {"start": {"phi": np.nan}}, "finite"),
        ("m*l**2*phi_ddot = T/phi", {}, "finite|joins|force"),
        ("m*l**2*phi_ddot = T*__import__", {}, "__import__"),
    ],
)
def test_bad_equations_are_refused(law, changes, message):
    with pytest.raises(InvalidInputError, match=message):
        rp.MechanicalModel(
            equations=[rp.Equations({"phi": law}, **{**PENDULUM, **changes})],
            outputs=[rp.Output("phi", "phi")],
        )


def test_balances_on_the_wrong_coordinates_are_refused():
    law = ready("cart_and_pendulum").equations[0]
    shifted = {**law.law, "x": "(M + m)*x_ddot = F - c*x_dot"}
    with pytest.raises(InvalidInputError, match="symmetric"):
        rp.Equations(shifted, law.coordinates, law.parameters, inputs=law.inputs)


def test_a_file_says_on_which_line():
    text = ready("dc_motor").to_toml()
    line = next(i for i, row in enumerate(text.splitlines(), 1) if "L*i_dot" in row)
    with pytest.raises(InvalidInputError, match=f"line {line - 3}|line {line}") as caught:
        rp.MechanicalModel.from_toml(text.replace("u - R*i", "u - R*j"))
    assert "'j'" in str(caught.value)
    with pytest.raises(InvalidInputError, match="one equation of each"):
        rp.MechanicalModel.from_toml(text.replace('of = "i"', 'of = "phi"'))
    with pytest.raises(InvalidInputError, match="equations that have it"):
        rp.MechanicalModel.from_toml(
            '[dof.x]\nmass = 1.0\n[start]\nx = 1.0\n[[output]]\nname = "x"\nmeasures = "x"'
        )
