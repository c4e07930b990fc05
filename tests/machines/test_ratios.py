"""Pulleys, screws, gears and levers, held against the same machine referred to one side by hand."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.machines.simulation import simulate_model

R, J, M, K, D = 0.02, 1.2e-3, 12.0, 3e5, 150.0
"""A pulley's radius, motor and carriage, and the belt between them."""
ACROSS = [
    ("backlash", ("carriage", "motor"), {"gap": 2e-5}),
    ("cubic_stiffness", ("motor", "carriage"), {"stiffness": 1e14}),
    ("coulomb_friction", ("carriage", "motor"), {"force": 5.0}),
    ("coulomb_friction", ("carriage", "ground"), {"force": 20.0}),
]


def belt(inertia=J, stiffness=K):
    return rp.MechanicalModel(
        [rp.Dof("motor", inertia, rotational=True), rp.Dof("carriage", M)],
        [rp.Spring(("motor", "carriage"), stiffness)],
        [rp.Damper(("motor", "carriage"), D), rp.Damper(("motor", "ground"), 0.02)],
        [rp.Input("torque", "motor")],
        [rp.Output("enc", "motor"), rp.Output("scale", "carriage"),
         rp.Output("stretch", ("carriage", "motor")),
         rp.Output("pull", ("carriage", "motor"), "force")],
        ratios=[rp.Ratio(("carriage", "motor"), R)],
    )  # fmt: skip


def referred(model):
    """The belt axis in metres at the carriage: q = T p with T = diag(1 / R, 1)."""
    motor = rp.Dof("motor", model.dof("motor").mass / R**2)
    return replace(
        model,
        dofs=(motor, model.dof("carriage")),
        ratios=(),
        dampers=(model.dampers[0], rp.Damper(("motor", "ground"), 0.02 / R**2)),
        inputs=(rp.Input("torque", "motor", gain=1 / R, unit="N m"),),
        outputs=(rp.Output("enc", ("motor",), weights=(1 / R,), unit="rad"), *model.outputs[1:]),
    )


def torque(samples=1500, rate=2000.0, size=0.6):
    time = np.arange(samples) / rate
    phases = np.random.default_rng(4).uniform(0, 2 * np.pi, 40)
    wave = np.cos(2 * np.pi * np.multiply.outer(time, 3.0 * np.arange(1, 41)) + phases).sum(axis=1)
    data = {"torque": ("time", size * wave / 6, {"units": "N m"})}
    return xr.Dataset(data, {"time": time})


def test_a_motor_on_a_belt_swings_at_its_closed_form():
    model = belt().with_parameters({"damper[0].damping": 0.0, "damper[1].damping": 0.0})
    poles = np.sort(np.abs(np.linalg.eigvals(model.matrices.first_order()[0])))
    assert poles[-1] == pytest.approx(np.sqrt(K * (1 / M + R**2 / J)), rel=1e-12)
    np.testing.assert_allclose(model.matrices.M, np.diag([J, M]))
    np.testing.assert_allclose(model.matrices.K, K * np.array([[R**2, -R], [-R, 1]]))


def test_matrices_are_those_referred_by_hand():
    model, hand, T = belt(), referred(belt()), np.diag([1 / R, 1])
    m, h = model.matrices, hand.matrices
    for name in "MCK":
        np.testing.assert_allclose(T @ getattr(m, name) @ T, getattr(h, name), rtol=1e-12)
    np.testing.assert_allclose(T @ m.B, h.B)
    lines = np.geomspace(1, 200, 20)
    np.testing.assert_allclose(
        model.frequency_response(lines), hand.frequency_response(lines), rtol=1e-9
    )


@pytest.mark.parametrize(("kind", "at", "values"), ACROSS)
def test_effects_act_across_a_ratio(kind, at, values):
    data = torque()
    model, hand = (m.with_effect(kind, at, values) for m in (belt(), referred(belt())))
    expected = simulate_model(hand, data, substeps=4).outputs
    found = simulate_model(model, data, substeps=4).outputs
    linear = simulate_model(belt(), data, substeps=4).outputs
    size = np.max(np.abs(expected), axis=0)
    assert np.max(np.abs(linear - expected) / size) > 0.01
    np.testing.assert_allclose(found / size, expected / size, atol=1e-7)
    assert simulate_model(model, data).outputs.shape == found.shape


LEAD = 0.01 / (2 * np.pi)


def drive(**parts):
    """A motor, a rigid gear of 20, a rigid screw of 10 mm per turn, and a table on a spring."""
    given = {
        "dofs": [rp.Dof("table", 8.0), rp.Dof("motor", 2e-4, True), rp.Dof("nut", 3e-3, True)],
        "springs": [rp.Spring(("table", "ground"), 4e4)],
        "dampers": [rp.Damper(("motor", "ground"), 1e-4)],
        "inputs": [rp.Input("T", "motor")],
        "outputs": [rp.Output("w", "motor", "angular_velocity"), rp.Output("x", "table")],
        "ratios": [rp.Ratio(("nut", "motor"), -1 / 20), rp.Ratio(("table", "nut"), LEAD)],
    }  # fmt: skip
    return rp.MechanicalModel(**{**given, **parts})


def test_rigid_gears_and_screws_reflect_inertias():
    model, m, lead = drive(), drive().matrices, LEAD
    assert (model.free, m.states) == (("table",), ("table", "table_dot"))
    np.testing.assert_allclose(m.M, [[8 + (3e-3 + 20**2 * 2e-4) / lead**2]])
    np.testing.assert_allclose(m.C, [[1e-4 * (20 / lead) ** 2]])
    np.testing.assert_allclose([m.B[0, 0], m.Sv[0, 0], m.Sq[1, 0]], [-20 / lead, -20 / lead, 1])
    heavier = model.with_parameters({"ratio[0].value": 0.1, "dof.nut.inertia": 0.0})
    np.testing.assert_allclose(heavier.matrices.M, [[8 + 10**2 * 2e-4 / lead**2]])
    plant = model.linearize(controls=["T"])
    assert plant.A[1, 0] == pytest.approx(-4e4 / m.M[0, 0])
    sure = model.uncertain({"dof.motor.inertia": 0.5}).at({"dof.motor.inertia": 3e-4})
    other = model.with_parameters({"dof.motor.inertia": 3e-4}).state_space()
    np.testing.assert_allclose(sure.A, other.A)


def test_the_imposed_coordinate_leads_whatever_it_is_tied_to():
    """The torque that turns a motor moves all that follows it."""
    model = drive(
        inputs=[rp.Input("phi", "motor", "displacement")],
        outputs=[rp.Output("T", ("motor",), "force", drive=True), rp.Output("x", "table")],
    )
    n, w = -LEAD / 20, 2 * np.pi * 3.0
    response = model.frequency_response([3.0]).sel(input="phi")
    inertia = 2e-4 + 3e-3 / 20**2 + 8 * n**2
    assert response.sel(output="x").item() == pytest.approx(n)
    assert response.sel(output="T").item() == pytest.approx(4e4 * n**2 - inertia * w**2 + 1e-4j * w)


def test_a_lever_turns_the_motion_round_and_bears_friction():
    """Arms of 0.1 and 0.3 m: a third of the motion; friction at the short end counts a third."""
    parts = ([rp.Dof("long", 1.0), rp.Dof("short", 2.0)], [rp.Spring(("long", "ground"), 900.0)])
    lever = rp.MechanicalModel(*parts, outputs=[rp.Output("short", "short")],
                               ratios=[rp.Ratio(("short", "long"), -0.1 / 0.3)])  # fmt: skip
    lever = lever.with_effect("coulomb_friction", "short", {"force": 6.0})
    seen = [rp.Output("short", ("long",), weights=(-1 / 3,))]
    hand = rp.MechanicalModel([rp.Dof("long", 1 + 2 / 9)], parts[1], outputs=seen)
    hand = hand.with_effect("coulomb_friction", "long", {"force": 2.0})
    data, start = xr.Dataset(coords={"time": np.arange(800) * 1e-3}), [0.05, 0.0]
    np.testing.assert_allclose(
        *(simulate_model(m, data, start, substeps=4).outputs for m in (lever, hand)),
        atol=1e-9,
    )


def test_a_file_names_the_ratio_or_the_lead():
    model = belt()
    assert rp.MechanicalModel.from_toml(model.to_toml()) == model
    assert model.parameters["ratio[0].value"] == R
    for text in ("carriage - motor  value        0.02  m/rad", "3e+05  N/m", "displacement  rad"):
        assert text in repr(model)
    text = model.to_toml().replace(f"value = {R}", "lead = 0.005")
    assert rp.MechanicalModel.from_toml(text).ratios[0].value == 0.005 / (2 * np.pi)
    pushed = replace(model, inputs=(rp.Input("F", ("motor", "carriage")),))
    assert pushed.unit_of(pushed.inputs[0]) == "N"
    assert rp.MechanicalModel.from_toml(pushed.to_toml()) == pushed


@pytest.mark.parametrize(
    ("parts", "message"),
    [({"ratios": [rp.Ratio(("nut", "motor"), 0)]}, "other than 0"),
     ({"ratios": [rp.Ratio(("nut", "ground"), 2)]}, "the ground does not move"),
     ({"ratios": [rp.Ratio(("nut", "gear"), 2)]}, "one of 'table', 'motor', 'nut'"),
     ({"ratios": [rp.Ratio(("nut", "motor"), 2), rp.Ratio(("motor", "nut"), 2)]}, "Remove the oth"),
     ({"ratios": [*drive().ratios, rp.Ratio(("table", "motor"), 2)]}, r"ratio\[2\].*close a ring"),
     ({"outputs": [rp.Output("x", ("table", "nut"))]}, "a rigid ratio ties.*Put a spring"),
     ({"springs": [rp.Spring(("table", "motor"), 1)]}, "one in m and one in rad.*Name the ratio"),
     ({"inputs": [rp.Input(name, name, "displacement") for name in ("nut", "motor")]},
      "rigid ratios tie, expected one imposed motion"),
     ({"dofs": [rp.Dof("table", 0), rp.Dof("motor", 0, True), rp.Dof("nut", 0, True)]}, "above 0"),
     ({"coupled_inertias": [rp.machines.CoupledInertia(("table", "nut"), -1e6)]},
      "positive kinetic")],
)  # fmt: skip
def test_bad_ratios_are_refused(parts, message):
    with pytest.raises(InvalidInputError, match=message):
        drive(**parts)


def test_a_ratio_is_not_uncertain():
    with pytest.raises(InvalidInputError, match=r"of a ratio.*with_parameters"):
        drive().uncertain({"ratio[0].value": 0.1})


def measured():
    """A record of the axis by an integrator that is not the package's."""
    data = torque(1500, 1000.0)
    time = data["time"].values

    def rhs(t, s):
        pull = K * (s[1] - R * s[0]) + D * (s[3] - R * s[2])
        push = np.interp(t, time, data["torque"].values)
        return [s[2], s[3], (push + R * pull - 0.02 * s[2]) / J, -pull / M]

    s = solve_ivp(rhs, (0, time[-1]), [0.0] * 4, "LSODA", time, rtol=1e-8, atol=1e-11).y
    random = np.random.default_rng(1).standard_normal((2, time.size))
    for name, unit, row, white in zip(("enc", "scale"), ("rad", "m"), s, random, strict=False):
        data[name] = ("time", row + 2e-3 * np.std(row) * white, {"units": unit})
    return data


def measuring(model):
    """The model with the sensors of the record only."""
    return replace(model, outputs=model.outputs[:2])


def test_a_refit_weighs_motor_and_belt_in_their_own_units():
    fitted = rp.refit(measuring(belt(1e-3, 2.4e5)), measured())
    found, true = fitted.model.parameters, belt().parameters
    for key in ("dof.motor.inertia", "dof.carriage.mass", "spring[0].stiffness"):
        assert abs(found[key] - true[key]) < 4 * fitted.stderr[key]
    assert found["dof.motor.inertia"] == pytest.approx(J, rel=0.01)
    assert found["ratio[0].value"] == R
    assert (fitted.units["dof.motor.inertia"], fitted.units["spring[0].stiffness"]) == (
        "kg m^2", "N/m")  # fmt: skip


def test_of_tied_masses_the_sum_is_fitted():
    """The motor's inertia counts 6 times the carriage's, and takes what the sum has to become."""
    start = replace(measuring(belt()), springs=(), dampers=belt().dampers[1:])
    data = simulate_model(start, torque(1000)).outputs
    data = torque(1000).assign(enc=("time", data[:, 0]), scale=("time", data[:, 1]))
    light = start.with_parameters({"dof.carriage.mass": 10.0})
    found = rp.refit(light, data).model.parameters
    assert found["dof.carriage.mass"] == pytest.approx(12.0, rel=1e-3)
    assert found["dof.motor.inertia"] == J


@pytest.mark.shared
def test_a_belt_axis_is_read_from_its_raw_columns(shared):
    """Torque in N m, encoder in rad and scale in um, as the model referred by hand reads them."""
    model = measuring(belt()).with_parameters({"damper[1].damping": 50 * R**2})
    model = replace(model, dampers=(*model.dampers, rp.Damper(("carriage", "ground"), 15.0)))
    friction = ("coulomb_friction", ("carriage", "ground"), {"force": 25.0, "width": 2e-4})
    path = shared / "data/belt_axis/fric_small.csv"
    assert rp.compare(model.with_effect(*friction), path).nrmse < 0.02
    assert rp.compare(model, path).nrmse > 0.2
