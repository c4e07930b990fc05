"""Sensors that see sums of coordinates, and machines that turn: from the file to the diagnosis."""

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import robustpolish as rp
from robustpolish.errors import InvalidInputError

BEAM = """
[dof.q1]
mass = 1.0
[dof.q2]
mass = 1.0
[[spring]]
between = ["q1", "ground"]
stiffness = 400.0
[[spring]]
between = ["q2", "ground"]
stiffness = 3000.0
[[damper]]
between = ["q1", "ground"]
damping = 0.8
[[damper]]
between = ["q2", "ground"]
damping = 1.5
[[input]]
name = "F"
force_on = "q1"
[[input]]
name = "G"
force_on = "q2"
[[output]]
name = "tip"
measures = { q1 = 0.8, q2 = -0.3 }
[[output]]
name = "middle"
measures = { q2 = 1.1, q1 = 0.5 }
quantity = "acceleration"
"""
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
    assert [found.outputs[name].nrmse for name in ("tip", "middle")] == pytest.approx(
        [0.003, 0.003], rel=0.2
    )
    assert found.notes == ()
    np.testing.assert_allclose(model.state_space().C[0], [0.8, -0.3, 0, 0])


def test_a_sum_of_modes_survives_the_file_and_shows_itself():
    model = rp.MechanicalModel.from_toml(BEAM)
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
BAD = {
    "too few": (rp.Output("x", ("q1", "q2"), weights=(1.0,)), "one number for each"),
    "twice": (rp.Output("x", ("q1", "q1"), weights=(1.0, 1.0)), "one number for each"),
    "unknown": (rp.Output("x", ("q1", "q"), weights=(1.0, 1.0)), "one of q1, q2, theta"),
    "ground": (rp.Output("x", ("q1", "ground"), weights=(1.0, 1.0)), "one of q1, q2, theta"),
    "nothing": (rp.Output("x", ("q1", "q2"), weights=(0.0, 0.0)), "not 0"),
    "text": (rp.Output("x", ("q1", "q2"), weights=(1.0, "a")), "a finite number"),
    "force": (rp.Output("x", ("q1", "q2"), "force", weights=(1.0, 1.0)), "sum of a force"),
    "mixed": (rp.Output("x", ("q1", "theta"), weights=(1.0, 1.0)), "in m and in rad"),
    "angle": (rp.Output("x", ("q1", "q2"), "angle", weights=(1.0, 1.0)), "translation"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_sums_are_refused(case):
    output, message = BAD[case]
    with pytest.raises(InvalidInputError, match=message):
        rp.MechanicalModel(DOFS, outputs=[output])


def test_a_shift_and_a_turn_need_a_unit():
    lever = rp.Output("end", ("q1", "theta"), weights=(1.0, 0.25), unit="m")
    model = rp.MechanicalModel(DOFS, outputs=[lever])
    assert model.unit_of(model.outputs[0]) == "m"


SHAFT = """
[dof.motor]
inertia = 0.002
[dof.load]
inertia = 0.01
[[spring]]
between = ["motor", "load"]
stiffness = 8.0
[[damper]]
between = ["motor", "load"]
damping = 0.004
[[damper]]
between = ["load", "ground"]
damping = 0.03
"""
TORQUE = """
[[spring]]
between = ["load", "ground"]
stiffness = 3.0
[[input]]
name = "T"
torque_on = "motor"
[[output]]
name = "phi"
measures = "load"
quantity = "angle"
[[output]]
name = "w"
measures = "motor"
quantity = "angular_velocity"
"""
IMPOSED = """
[[input]]
name = "drive"
motion_of = "motor"
quantity = "angle"
[[output]]
name = "phi"
measures = "load"
relative_to = "motor"
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
