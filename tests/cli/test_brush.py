"""`robustpolish brush`: what it prints and saves."""

import json

import numpy as np
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


def test_brush_on_a_mould_along_a_path(tmp_path):
    side = np.linspace(-30.0, 30.0, 31)
    grid = np.add.outer(side**2 / 100, side**2 / 160)
    lines = [["x", *side], *([x, *row] for x, row in zip(side, grid, strict=True))]
    mould, path = tmp_path / "mould.csv", tmp_path / "path.csv"
    mould.write_text("\n".join(",".join(map(str, line)) for line in lines))
    path.write_text("x,y\n-10,0\n10,0\n")
    files = ("--mould", str(mould), "--path", str(path))
    result = run("brush", "--duration", "0.02", *files, "--speed", "0.04", "--json")
    assert 5 < json.loads(result.stdout)["forces"]["F_z"]["largest"] < 50
    result = run("brush", "--duration", "0.02", *files, code=2)
    assert "speed" in result.stderr
