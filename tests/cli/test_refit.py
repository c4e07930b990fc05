"""`robustpolish refit`: one file or several, the JSON, the saved model, and bad input."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from robustpolish.app.cli.learn import compare, refit
from robustpolish.machines.mechanical.model import MechanicalModel
from tests.cli.test_compare import CSV, MODEL, table


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "data.csv").write_text(CSV)
    (tmp_path / "again.csv").write_text(table(600, noise=0.02))
    (tmp_path / "model.toml").write_text(MODEL.replace("2e4", "2.3e4"))
    return tmp_path


def run(folder, *arguments, data=("data.csv",), command=refit, model="model.toml"):
    files = [str(folder / name) for name in data]
    words = [*files, "--model", str(folder / model), *map(str, arguments)]
    return CliRunner().invoke(command, words)


@pytest.mark.parametrize("data", [("data.csv",), ("data.csv", "again.csv")])
def test_the_numbers_come_out_and_the_model_is_saved(folder, data):
    saved, out = folder / "fitted.toml", folder / "out.json"
    result = run(folder, "--save", saved, "--json", out, data=data)
    assert result.exit_code == 0, result.output
    assert "spring[0].stiffness" in result.output
    content = json.loads(out.read_text())
    found = content["parameters"]
    ratio = found["spring[0].stiffness"]["value"] / found["dof.x.mass"]["value"]
    assert ratio == pytest.approx(4e4, rel=1e-3)
    assert found["spring[0].stiffness"]["unit"] == "N/m"
    assert len(content["records"]) == len(data)
    for each in content["records"].values():
        assert 0.009 < each["nrmse"]["x"] < 0.03
        assert each["reproducible"]
    assert ("Record by record" in result.output) == (len(data) > 1)
    assert 0.009 < content["nrmse"]["x"] < (0.011 if len(data) == 1 else 0.02)
    assert "fit 98.9" in run(folder, command=compare, model="fitted.toml").output
    assert run(folder, "--save", saved, data=data).exit_code == 2  # it exists
    assert run(folder, "--save", saved, "--force", data=data).exit_code == 0


def test_frequency_responses_are_recognised(folder):
    lines = np.arange(5.0, 60.0, 0.5)
    curve = MechanicalModel.from_toml(MODEL).frequency_response(lines).values[:, 0, 0] * 1e6
    rows = [f"{f},{h.real},{h.imag}" for f, h in zip(lines, curve, strict=True)]
    head = "frequency [Hz],x/F real [um/N],x/F imag [um/N]"
    (folder / "frf.csv").write_text("\n".join([head, *rows]) + "\n")
    result = run(folder, "--json", data=("frf.csv",))
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)["parameters"]
    ratio = found["spring[0].stiffness"]["value"] / found["dof.x.mass"]["value"]
    assert ratio == pytest.approx(4e4, rel=1e-3)
    assert run(folder, data=("frf.csv", "data.csv")).exit_code == 2


def test_bad_input_ends_with_code_2_and_writes_nothing(folder):
    (folder / "data.csv").write_text("time [s],F [N]\n0,1\n0.1,2\n")
    saved = folder / "fitted.toml"
    result = run(folder, "--save", saved, data=("data.csv", "again.csv"))
    assert result.exit_code == 2
    assert "x" in result.output
    assert not saved.exists()
