"""`robustpolish brush`: what it prints and saves."""

import json

import pandas as pd
import pytest
import xarray as xr

from tests.cli.command_line import run


@pytest.mark.parametrize("ending", ["csv", "nc"])
def test_brush_saves_its_signals(tmp_path, ending):
    target = tmp_path / f"brush.{ending}"
    result = run("brush", "--duration", "0.02", "--out", str(target), "--json")
    forces = json.loads(result.stdout)["forces"]
    assert 5 < forces["F_z"]["largest"] < 50
    if ending == "csv":
        assert len(pd.read_csv(target)) == 401
    else:
        with xr.open_dataset(target) as saved:
            assert saved.sizes["time"] == 401
    before = target.read_bytes()
    assert "--force" in run("brush", "--duration", "0.02", "--out", str(target), code=2).stderr
    assert target.read_bytes() == before
