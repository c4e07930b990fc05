"""Records made in a loop: fits and diagnoses run the loop from its references."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import robustpolish as rp
from robustpolish.simulation import Feedback, FeedbackTerm

J, FALLS, DAMPING, FRICTION, NOISE = 0.02, 1.5, 0.05, 0.08, 2e-4
"""An unstable pendulum: inertia, negative stiffness, damping, dry friction; its encoder's noise."""
T, KP, KD, LIMIT = 0.005, 6.0, 0.3, 1.2


def record(friction=FRICTION, seconds=12.0, seed=0):
    """Integrate the pendulum in its loop, the controller written by hand, with noise in it."""
    rng = np.random.default_rng(seed)
    steps = round(seconds / T)
    time = T * np.arange(steps)
    asked = np.repeat(rng.uniform(-0.15, 0.15, steps // 60 + 1), 60)[:steps]
    state, last = np.array([0.02, 0.0]), None
    shown, torques = np.empty(steps), np.empty(steps)
    for k in range(steps):
        shown[k] = state[0] + NOISE * rng.standard_normal()
        error = asked[k] - shown[k]
        torque = KP * error + KD / T * (error - (error if last is None else last))
        torques[k], last = np.clip(torque, -LIMIT, LIMIT), error

        def slope(_, s, u=torques[k]):
            dry = friction * np.tanh(s[1] / 1e-3)
            return [s[1], (u + FALLS * s[0] - DAMPING * s[1] - dry) / J]

        state = solve_ivp(slope, (0, T), state, "LSODA", rtol=1e-8, atol=1e-10).y[:, -1]
    return xr.Dataset(
        {
            "wanted": ("time", asked, {"units": "rad"}),
            "M": ("time", torques, {"units": "N m"}),
            "phi": ("time", shown, {"units": "rad"}),
        },
        {"time": ("time", time, {"units": "s"})},
    )


def pendulum(inertia=J, falls=FALLS, damping=DAMPING, **loop):
    given = {"limit": LIMIT, "kp": KP, **loop}
    term = FeedbackTerm("phi", given.pop("kp"), derivative=KD, reference="wanted")
    return rp.MechanicalModel(
        [rp.Dof("phi", inertia, rotational=True)],
        [rp.Spring(("phi", "ground"), -falls)],
        [rp.Damper(("phi", "ground"), damping)],
        [rp.Input("M", "phi")],
        [rp.Output("phi", "phi")],
        feedback=[Feedback("M", T, [term], **given)],
    )


@pytest.fixture(scope="module")
def smooth():
    return record(friction=0.0)


@pytest.fixture(scope="module")
def rough():
    return record()


@pytest.mark.parametrize("columns", [["wanted", "M", "phi"], ["wanted", "phi"]])
def test_the_true_machine_runs_like_the_record(smooth, columns):
    """An unstable machine runs freely in its loop, and needs no record of what was commanded."""
    found = rp.compare(pendulum(), smooth[columns])
    assert found.outputs["phi"].rmse < 10 * NOISE  # the noise moves the machine, too
    assert found.reproducible
    assert found.notes == ()


def test_wrong_numbers_are_found_from_a_loop_that_is_unstable(smooth):
    wrong = pendulum(inertia=0.03, falls=1.05 * KP, damping=0.02)
    before = rp.compare(wrong, smooth)
    assert not before.reproducible
    assert "unstable in its loop (a pole at " in before.reproducibility.reason
    fitted = rp.refit(wrong, smooth[["wanted", "phi"]])
    found = fitted.model.parameters
    assert found["dof.phi.inertia"] == pytest.approx(J, rel=0.03)
    assert found["spring[0].stiffness"] == pytest.approx(-FALLS, rel=0.03)
    assert found["damper[0].damping"] == pytest.approx(DAMPING, rel=0.1)
    assert rp.compare(fitted.model, smooth).outputs["phi"].rmse < 10 * NOISE


def test_numbers_of_the_loop_are_found(smooth):
    model = pendulum(kp=4.5, limit=0.8, unknown=["phi.gain", "limit"])
    found = rp.refit(model, smooth[["wanted", "phi"]]).model.parameters
    share = [found["feedback[0].phi.gain"] / KP, found["feedback[0].limit"] / LIMIT]
    assert share == pytest.approx([1, 1], rel=0.1)


def test_a_missing_friction_is_found_in_the_loop(rough):
    trial = rp.try_effect(pendulum(), rough, "coulomb_friction", "phi")
    assert trial.worthwhile
    assert trial.effect.parameters["force"].value == pytest.approx(FRICTION, rel=0.1)
    found = rp.diagnose(pendulum(falls=1.8), rough[["wanted", "phi"]])
    assert [effect.at for effect in found.effects] == [("phi", "ground")]
    assert found.effects[0].kind in ("coulomb_friction", "dahl_friction")  # steep: they are alike
    assert found.effects[0].parameters["force"].value == pytest.approx(FRICTION, rel=0.1)


def test_what_is_not_known_of_a_loop_is_said(smooth):
    alone = replace(pendulum(), feedback=())
    notes = rp.compare(alone, smooth, window=0.2).notes
    assert any("M: past outputs predict it, as in a feedback loop" in note for note in notes)
    notes = rp.compare(pendulum(kp=3.0), smooth).notes
    assert any("M differs from what [feedback] makes" in note for note in notes)


QUBE = """
[dof.theta]
inertia = 2.35e-4
[dof.alpha]
inertia = 1.33e-4
[[coupled_inertia]]
between = ["theta", "alpha"]
value = 1.3e-4
[[spring]]  # gravity
between = ["alpha", "ground"]
stiffness = -0.01518
[[spring]]  # of the encoder's cable, not known
between = ["theta", "ground"]
stiffness = 0.0
[[damper]]
between = ["theta", "ground"]
damping = 1.2e-3
[[damper]]
between = ["alpha", "ground"]
damping = 5e-5
[[input]]
name = "plant_input"
torque_on = "theta"
gain = 0.005
unit = "V"
[[output]]
name = "theta"
measures = "theta"
quantity = "angle"
[[output]]
name = "alpha"
measures = "alpha"
quantity = "angle"
[feedback]
drives = "plant_input"
period = 0.002
limit = 10.0
feedforward = ["feedforward"]
[[feedback.term]]
of = "theta"
reference = "target_theta"
gain = -6.0
derivative = -1.8
lag = 0.02
[[feedback.term]]
of = "alpha"
reference = "target_alpha"
gain = -30.0
derivative = -2.5
lag = 0.02
"""


@pytest.mark.shared
@pytest.mark.long
def test_a_measured_inverted_pendulum(shared):
    """Runs 4 to 6, with no more than the errors of a fit by hand to runs 1 to 3."""
    runs = {i: shared / f"data/real/qube/run{i}.csv" for i in range(1, 7)}
    fitted = rp.refit(rp.MechanicalModel.from_toml(QUBE), [runs[i] for i in (1, 2, 3)])
    errors = rp.compare(fitted.model, [runs[i] for i in (4, 5, 6)]).records.values()
    by_hand = {"theta": (0.035, 0.056, 0.028), "alpha": (0.020, 0.035, 0.019)}
    for name, most in by_hand.items():
        assert all(e.outputs[name].rmse <= size for e, size in zip(errors, most, strict=True))


SERVO = """
[dof.q]
inertia = 1.0
[[damper]]
between = ["q", "ground"]
damping = 40.0
[[input]]
name = "drive"
torque_on = "q"
[[output]]
name = "theta"
measures = "q"
quantity = "angle"
[[effect]]
kind = "constant_force"
at = "q"
parameters = { force = 0.0 }
[feedback]
drives = "drive"
period = 0.005
delay = 0.02
limit = 60.0
unknown = ["theta.gain", "limit", "delay"]
[[feedback.term]]
of = "theta"
reference = "cmd"
gain = 400.0
"""


@pytest.mark.shared
@pytest.mark.long
def test_a_measured_servo_that_limits_its_speed(shared):
    """Of the loop nothing is known but its kind; the fit by hand left 0.044 rad."""
    folder = shared / "data/real/servo_rate_limit"
    fitted = rp.refit(rp.MechanicalModel.from_toml(SERVO), sorted(folder.glob("train*.csv")))
    left = rp.compare(fitted.model, sorted(folder.glob("test*.csv")))
    assert left.outputs["theta"].rmse < 1.3 * 0.044
