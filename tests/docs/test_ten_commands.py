"""The page of ten commands does what it says, from an empty folder to C code."""

import json
import re
import shlex
from pathlib import Path

import pytest

import robustpolish as rp
from tests.app.command_line import run

PAGE = Path(__file__).parents[2] / "docs" / "ten_commands.md"


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:coulomb_friction at y, ground jumps at rest")
def test_ten_commands_lead_from_nothing_to_a_learned_machine_and_its_controller(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    lines = re.findall(r"^```console\n\$ robustpolish (.+)\n```$", PAGE.read_text("utf-8"), re.M)
    told = [run(*shlex.split(line)).stdout for line in lines]
    assert len(told) == 10
    assert [text.count(": worth its numbers") for text in told[3:6]] == [0, 0, 1]
    steps = json.loads(Path("steps.json").read_text())["ledger"]
    wrong, again, right = (step["nrmse"]["y"] for step in steps[2:])
    noise = 20e-9 / float(rp.read_measurement("run.csv")["y"].std())
    assert right < 1.5 * noise < 0.1 * min(wrong, again)
    model = rp.MechanicalModel.from_toml("learned.toml")
    (effect,) = model.effects
    assert (effect.kind, effect.at) == ("coulomb_friction", ("y", "ground"))
    assert effect.values["force"] == pytest.approx(0.3, rel=0.01)
    # numbers that the record hardly determines stay where they were known to be
    known = rp.polishing.air_bearing_model()
    assert model.dof("y_m").mass == pytest.approx(known.dof("y_m").mass, rel=0.1)
    error = re.search(r"effect\[0\]\.force +([\d.]+) +([\d.]+)", told[6])
    assert abs(float(error[1]) - 0.3) < 4 * float(error[2])
    assert "can be built" in told[8]
    assert "cannot be built" not in told[8]
    assert "controller_step" in Path("controller.c").read_text()


def test_the_tutorial_of_the_air_bearing_is_the_first():
    root = PAGE.parents[1]
    for page in ("README.md", "docs/tutorials.md"):
        named = re.findall(r"notebooks/(\d\d)_", (root / page).read_text("utf-8"))
        assert named[0] == "00"
