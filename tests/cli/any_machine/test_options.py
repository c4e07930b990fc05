"""The options that name a machine."""

import pytest

import robustpolish as rp
from robustpolish.app.cli.design import named_machine
from tests.machine_design.machines import SPINDLE


def test_a_machine_by_its_file(tmp_path):
    model, plant = tmp_path / "machine.toml", tmp_path / "plant.json"
    model.write_text(SPINDLE)
    rp.air_bearing().save(plant)
    assert isinstance(named_machine(str(model), None), rp.MechanicalModel)
    assert isinstance(named_machine(None, str(plant)), rp.GeneralizedPlant)
    with pytest.raises(rp.InvalidInputError, match="one of the two"):
        named_machine(str(model), str(plant))
