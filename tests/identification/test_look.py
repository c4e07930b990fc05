"""A look at records: what is in them, and drafts of machines whose numbers are known."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy import signal

import robustpolish as rp
from robustpolish.machines.simulation import simulate_model
from tests.app.command_line import run
from tests.identification.oscillators import oscillator

GROUND = "ground"
RATE, SAMPLES = 1000.0, 8000
TIME = np.arange(SAMPLES) / RATE
NOISE = np.random.default_rng(3).normal(size=SAMPLES)
FORCES = {
    "white": NOISE,
    "blow": 50 * np.exp(-(((TIME - 0.2) / 0.002) ** 2)),
    "chirp": np.cos(2 * np.pi * (1 + 4 * TIME) * TIME),
}


def slide():
    """Natural frequency 19.49 Hz, damping ratio 1.84 %."""
    return oscillator(3e4, 9.0, dofs=[rp.Dof("x", 2.0)])


def chain():
    """Two masses, the force on the second."""
    return rp.MechanicalModel(
        [rp.Dof("a", 2.0), rp.Dof("b", 1.0)],
        [rp.Spring(("a", GROUND), 4e4), rp.Spring(("b", "a"), 1.5e4)],
        [rp.Damper(("a", GROUND), 8.0), rp.Damper(("b", "a"), 4.0)],
        [rp.Input("F", ("b", GROUND))],
        [rp.Output("a", ("a", GROUND)), rp.Output("b", ("b", GROUND))],
    )


def recorded(model, force, noise=0.01):
    table = pd.DataFrame({"time [s]": TIME, "F [N]": force})
    outputs = simulate_model(model, rp.read_measurement(table, at_limit=["F"])).outputs
    random = np.random.default_rng(0)
    for name, y in zip(model.output_names, outputs.T, strict=True):
        table[f"{name} [m]"] = y + noise * y.std() * random.normal(size=y.size)
    return table


@pytest.mark.parametrize("hold", [0.0, 1.0])
@pytest.mark.parametrize("force", FORCES)
def test_numbers_and_hold_of_an_oscillator(force, hold):
    machine = slide().with_effect("input_hold", ("F",), {"order": hold})
    found = rp.look(recorded(machine, FORCES[force], noise=0.1))
    assert found.holds == {"F": "not held" if hold else "held"}
    numbers = found.draft.parameters
    for key, value in slide().parameters.items():
        assert numbers[key] == pytest.approx(value, rel=0.01)
    (mode,) = found.modes["draft"]
    assert (mode.frequency, mode.damping) == pytest.approx((19.49, 0.0184), rel=0.01)
    if force != "blow":  # which is over before most of the averages begin
        assert [m.frequency for m in found.modes["response"]] == pytest.approx([19.49], rel=0.01)
    assert found.loop != "yes"


@pytest.mark.parametrize("force", FORCES)
def test_two_masses_and_where_the_force_acts(force):
    found = rp.look(recorded(chain(), FORCES[force]))
    assert found.draft.inputs[0].on == ("b", GROUND)
    assert found.draft.dof("a").mass == pytest.approx(2.0, rel=0.02)
    assert found.draft.dof("b").mass == pytest.approx(1.0, rel=0.02)
    assert [m.frequency for m in found.modes["draft"]] == pytest.approx([15.05, 29.15], rel=0.01)
    assert max(found.left.values()) < 0.02


def test_free_decay_and_a_force_whose_unit_is_not_known():
    decay = np.exp(-2 * TIME) * np.cos(2 * np.pi * 20 * TIME)
    found = rp.look(pd.DataFrame({"time [s]": TIME, "x [mm]": decay}))
    for mode in (*found.modes["draft"], *found.modes["motion"]):
        assert (mode.frequency, mode.damping) == pytest.approx((20.0, 2 / 40 / np.pi), rel=0.02)
    assert (found.loop, found.response) == ("not known", None)
    table = recorded(slide(), NOISE).rename(columns={"F [N]": "amplifier", "x [m]": "probe"})
    found = rp.look(table, inputs=["amplifier"])
    assert found.draft.inputs[0].gain == pytest.approx(0.5, rel=0.01)  # per kg
    assert found.channels["probe"]["unit"] == ""


def test_channels_gaps_and_limits(tmp_path):
    table = recorded(
        slide(), np.clip(3 * signal.lfilter(*signal.butter(2, 0.05), NOISE), -0.5, 0.5)
    )
    x = table.pop("x [m]")
    step = 0.1 * x.std()
    table["x [um]"] = 1e6 * step * np.round(x / step)
    table["oil [K]"] = 293.0
    table.loc[100, "x [um]"] = np.nan
    path = tmp_path / "run.csv"
    table.drop(index=range(2000, 2500)).to_csv(path, index=False)
    result = run("look", str(path), "--out", str(tmp_path / "draft.toml"), "--json")
    found = json.loads(result.stdout)
    assert found["channels"]["x"]["step"] == pytest.approx(step, rel=1e-3)
    assert found["channels"]["x"]["missing"] == 1
    assert found["channels"]["F"]["at_limit"] > 0.2
    assert found["channels"]["oil"]["deviation"] == 0
    assert (found["channels"]["oil"]["role"], found["channels"]["x"]["unit"]) == ("", "um")
    assert found["sampling"]["gaps"] == 1
    # The draft compares at once, with the options that were told.
    part = found["options"][0].split()
    again = run("compare", str(path), "--model", str(tmp_path / "draft.toml"), *part, "--json")
    assert json.loads(again.stdout)["outputs"]["x"]["nrmse"] < 0.1


def looped(reference, gain):
    """A sampled loop about the slide, with noise on its sensor."""
    plant = signal.cont2discrete(([1 / 2.0], [1, 4.5, 1.5e4]), 1 / RATE)
    b, a = plant[0].ravel(), plant[1]
    u, y, random = np.zeros(SAMPLES), np.zeros(SAMPLES), np.random.default_rng(1)
    noise = 1e-6 * random.normal(size=SAMPLES)
    for k in range(2, SAMPLES):
        y[k] = b[1] * u[k - 1] + b[2] * u[k - 2] - a[1] * y[k - 1] - a[2] * y[k - 2]
        u[k] = reference[k] - gain * (y[k] + noise[k])
    return pd.DataFrame({"time [s]": TIME, "F [N]": u, "x [m]": y + noise})


@pytest.mark.parametrize(("gain", "loop"), [(0.0, "no sign"), (2e4, "yes")])
def test_feedback(gain, loop):
    slow = signal.lfilter(*signal.butter(2, 0.1), NOISE)
    assert rp.look(looped(slow, gain)).loop == loop


def test_what_cannot_be_looked_at_is_refused():
    table = recorded(slide(), NOISE)
    with pytest.raises(rp.InvalidInputError, match=r"no channel 'y'.*F, x"):
        rp.look(table, outputs=["y"])
    with pytest.raises(rp.InvalidInputError, match="40 samples"):
        rp.look(table, between=(0.0, 0.02))


@pytest.mark.shared
@pytest.mark.parametrize(
    ("name", "loop", "frequency"),
    [
        ("real/daisy_robot_arm/train.csv", "no sign", 63.0),
        ("real/brb_mode1/train.csv", "not known", 80.4),
        ("real/sloshing/train.csv", "not known", 1.22),
        ("real/flexible_link/train.csv", "yes", None),
        ("belt_axis/fric_a.csv", "yes", None),
        ("real/qube/run1.csv", "yes", None),
    ],
)
def test_measured_machines(shared, tmp_path, name, loop, frequency):
    data, draft = str(shared / "data" / name), str(tmp_path / "draft.toml")
    found = json.loads(run("look", data, "--out", draft, "--json").stdout)
    assert found["loop"] == loop
    if frequency is not None:
        assert found["modes"]["draft"][0]["frequency"] == pytest.approx(frequency, rel=0.01)
    run("compare", data, "--model", draft)
