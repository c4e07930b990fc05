"""`robustpolish norms --model`: from named disturbances to named outputs."""

import json

import pytest

import robustpolish as rp
from tests.cli.command_line import run
from tests.machine_design.machines import SPINDLE


def test_norms_of_a_machine(tmp_path):
    path = tmp_path / "machine.toml"
    path.write_text(SPINDLE)
    chosen = ("--disturbance", "F", "--performance", "x")
    found = json.loads(run("norms", "--model", str(path), *chosen, "--json").stdout)
    system = rp.MechanicalModel.from_toml(SPINDLE).state_space()[0, 1]
    assert found["hinf"]["value"] == pytest.approx(float(rp.hinf_norm(system)))
    assert found["h2"]["value"] == pytest.approx(float(rp.h2_norm(system)))
    assert found["unit"]["hinf"] == "m/N"
    assert "from F_cut, F to slide, spindle" in run("norms", "--model", str(path)).stdout
    rp.air_bearing().save(tmp_path / "plant.json")
    own = json.loads(run("norms", "--json").stdout)
    again = json.loads(run("norms", "--plant", str(tmp_path / "plant.json"), "--json").stdout)
    assert again["hinf"] == own["hinf"]
    assert (
        "Write slide" in run("norms", "--model", str(path), "--performance", "slid", code=2).stderr
    )
