"""Tasks from files: what the sections say, what counts instead, slips with their line."""

import pytest

import robustpolish as rp
from tests.machine_design.machines import DESIGN, SPINDLE, WEIGHTS


def test_a_file_says_what_is_asked():
    task = rp.read_design_task(SPINDLE + DESIGN)
    assert task.controls == ("F",)
    assert task.plant.limits["F"] == 200.0
    assert task.plant.nx == 6
    changed = rp.read_design_task(SPINDLE + DESIGN, measurements=["x", "acc"], norm="h2")
    assert changed.plant.ny == 2
    assert changed.norm == "h2"
    assert set(rp.read_design_task(SPINDLE + DESIGN + WEIGHTS).weights) == {"performance", "effort"}


def test_the_sections_stay_with_the_model(tmp_path):
    path = tmp_path / "machine.toml"
    model = rp.MechanicalModel.from_toml(SPINDLE + DESIGN + WEIGHTS)
    model.with_parameters({"dof.slide.mass": 13.0}).to_toml(path)
    again = rp.MechanicalModel.from_toml(path)
    assert again.design == model.design
    assert again != model
    assert hash(again.with_parameters({"dof.slide.mass": 12.0})) == hash(model)
    assert rp.read_design_task(path).plant.nx == 6
    kept = '[design]\nfull_state = true\norder = 3\nnames = ["a"]\n'
    assert rp.MechanicalModel.from_toml(SPINDLE + kept).to_toml().endswith(kept)


def test_a_plant_and_a_section_of_its_own(tmp_path):
    rp.air_bearing().save(tmp_path / "plant.json")
    section = tmp_path / "asked.toml"
    section.write_text('[design]\ncontrols = ["x"]\nperformance = ["x"]\n')
    task = rp.read_design_task(tmp_path / "plant.json", section)
    assert task.plant.control_names == ("u_x",)
    assert rp.read_design_task(tmp_path / "plant.json").plant.nu == 6
    section.write_text("[dof.x]\nmass = 1.0\n")
    with pytest.raises(rp.InvalidInputError, match="expected one of design, weights"):
        rp.read_design_task(rp.air_bearing(), section)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('controls = ["F"]', 'control = ["F"]', r"line 34: design\.control:.*Write controls"),
        ('controls = ["F"]', 'controls = ["G"]', "line 34: controls: got 'G'"),
        ("bandwidth_hz = 1000.0", "bandwith_hz = 1.0", r"line 41: actuators\.F\.bandwith_hz"),
        ("bandwidth_hz = 5000.0", "bandwidth_hz = 0", r"line 44: sensors\.x\.bandwidth_hz"),
        ("crossover_hz = 10.0", "crossover = 10.0", r"line 47: weights\.performance\.crossover"),
        ("low = 20.0", "low = 0.1", r"line 47: weights\.performance\.low"),
        ("[weights]", "[weight]", "weight: got an unknown key.*Write weights"),
        ("control_weight = 1e-6", "control_weight = 1979-05-27", r"design\.control_weight"),
        ("[design.sensors]", "[design.weights]\neffort = 1.0\n[design.sensors]", "Join them"),
        ("measurements", "norm = 3\nmeasurements", "line 35: norm: got 3"),
    ],
)
def test_slips_with_their_line(old, new, says):
    text = SPINDLE + DESIGN + WEIGHTS
    assert old in text
    with pytest.raises(rp.InvalidInputError, match=says):
        rp.read_design_task(text.replace(old, new, 1))


def test_what_is_no_machine():
    with pytest.raises(rp.InvalidInputError, match=r"nowhere.toml \(No such file"):
        rp.read_design_task("nowhere.toml")
    with pytest.raises(rp.InvalidInputError, match=r"nowhere.json \(No such file"):
        rp.read_design_task("nowhere.json")
    with pytest.raises(rp.InvalidInputError, match=r"control.*Write controls"):
        rp.read_design_task(rp.air_bearing(), control=["u_x"])
    with pytest.raises(rp.InvalidInputError, match="a MechanicalModel or a GeneralizedPlant"):
        rp.read_design_task(3)  # type: ignore[arg-type]
