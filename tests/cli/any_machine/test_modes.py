"""`robustpolish modes --model`: frequencies of a machine, effects linearised about rest."""

import json

import pytest

import robustpolish as rp
from tests.cli.command_line import run
from tests.machine_design.machines import SPINDLE


def test_modes_of_a_machine(tmp_path):
    path = tmp_path / "machine.toml"
    path.write_text(SPINDLE)
    found = json.loads(run("modes", "--model", str(path), "--json").stdout)["modes"]
    own = rp.modes(rp.MechanicalModel.from_toml(SPINDLE).state_space())
    assert [mode["frequency_hz"] for mode in found] == pytest.approx(
        [mode.frequency_hz for mode in own]
    )
    rp.air_bearing().save(tmp_path / "plant.json")
    assert "194.0691" in run("modes", "--plant", str(tmp_path / "plant.json")).stdout
    model = rp.MechanicalModel.from_toml(SPINDLE)
    force = {"stiffness": 1e9}
    model.with_effect("cubic_stiffness", ("slide", "ground"), force).to_toml(path)
    again = json.loads(run("modes", "--model", str(path), "--json").stdout)["modes"]
    assert again[0]["frequency_hz"] == pytest.approx(found[0]["frequency_hz"])  # flat at rest
